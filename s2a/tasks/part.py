"""What tasks with an articulated part share: where gripper and grasp are, how far the part is open, how it is held.

The tool frame: origin between the finger pads (plus `tcp_offset`), z forward, y from the right finger to the left. The grasp
frame: at the mean of the part's grasp region, z into the furniture, y across the region's thin section (the world's up for a
horizontal bar), moving with the part. The opening is the path of the grasp point [m].
"""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
from typing import Any

import warp as wp

from s2a.env.state import State
from s2a.env.task import Task
from s2a.sim.simulation import Simulation
from s2a.tasks.part_handles import PartGeometry, PartHandles, PartMdp

OPPOSED = wp.constant(-0.5)
"""Cosine between the forces of both fingers below which they pinch: more than 120 degrees apart."""


@wp.struct
class Frames:
    """Poses of a world, world frame; the fingers' positions [m]."""

    tool: wp.transform
    grasp: wp.transform
    left: wp.vec3
    right: wp.vec3


DESCRIBED = wp.constant(22)
"""Numbers that `describe` writes."""


def observations(sim: Simulation, config: PartMdp) -> int:
    """Return the length of what `observe` writes, and `describe` where it is asked for."""
    return 2 * sim.layout.robot_joints + 5 + (int(DESCRIBED) if config.describe_part else 0)


@wp.func
def frames(s: State, h: PartHandles, world: int) -> Frames:
    """Return where tool, grasp and fingers are."""
    f, b = Frames(), h.bodies
    f.tool = s.body_q[world, b.tool_link] * b.tool
    f.grasp = s.body_q[world, b.part] * h.part[world].grasp
    f.left = wp.transform_get_translation(s.body_q[world, b.left])
    f.right = wp.transform_get_translation(s.body_q[world, b.right])
    return f


@wp.func
def tool_distance(f: Frames):
    """Return the distance from the tool to the grasp point [m]."""
    return wp.length(wp.transform_get_translation(f.tool) - wp.transform_get_translation(f.grasp))


@wp.func
def squared_action(s: State, world: int):
    """Return the sum of the squared actions."""
    effort = float(0.0)
    for i in range(s.action.shape[1]):
        effort += s.action[world, i] * s.action[world, i]
    return effort


@wp.func
def opening_of(s: State, h: PartHandles, world: int):
    """Return how far the part is open [m]."""
    return s.joint_q[world, h.part[world].coord] * h.part[world].lever_arm


@wp.func
def opening_speed(s: State, h: PartHandles, world: int):
    """Return how fast the part opens [m/s]."""
    return s.joint_qd[world, h.part[world].dof] * h.part[world].lever_arm


@wp.func
def opening_force(p: PartGeometry, wrench: wp.spatial_vector):
    """Return the force along the opening at the grasp point [N] of a wrench on the part about the world's origin."""
    force, torque = wp.spatial_top(wrench), wp.spatial_bottom(wrench)
    if p.slides == 1:
        return wp.dot(force, p.axis) * wp.sign(p.lever_arm)
    about = torque - wp.cross(p.origin, force)
    return wp.dot(about, p.axis) / p.lever_arm


@wp.func
def is_grasped(h: PartHandles, force: float, sense: float, world: int):
    """Return whether the gripper holds the part by its region: both fingers press with `force` [N] or more from opposed sides.

    What moves the part must be the grip: where anything else of the robot pushes it in the sense of the motion (1 opens, -1
    closes) with `force` or more and harder than the fingers, it is not grasped. A region wider than the gripper opens cannot
    be pinched: there one finger is enough.
    """
    p, c = h.part[world], h.contacts
    other = sense * opening_force(p, c.pull[world, 1])
    if other >= force and other > sense * opening_force(p, c.pull[world, 0]):
        return False
    if p.pinchable == 0:
        return wp.max(c.on_region[world, 0], c.on_region[world, 1]) >= force
    if wp.min(c.on_region[world, 0], c.on_region[world, 1]) < force:
        return False
    left, right = c.normal[world, 0], c.normal[world, 1]
    return wp.dot(left, right) < OPPOSED * wp.length(left) * wp.length(right)


@wp.kernel
def clear_region_force(h: PartHandles):
    """Forget the forces of the control step before."""
    world = wp.tid()
    h.contacts.peak[world] = 0.0
    for finger in range(2):
        h.region_force[world, finger] = 0.0


@wp.kernel
def update_region_force(h: PartHandles):
    """Keep each finger's maximum force on the region in the control step."""
    world = wp.tid()
    for finger in range(2):
        h.region_force[world, finger] = wp.max(h.region_force[world, finger], h.contacts.on_region[world, finger])


@wp.kernel
def observe(s: State, h: PartHandles):
    """Write the reference's observation, shape [world 2 * joints + 5].

    Joint positions scaled to their range and velocities, the vector from tool to grasp in the robot's base frame [m], the
    part's coordinate and velocity.
    """
    world = wp.tid()
    limit, p = h.observation_limit, h.part[world]
    for i in range(s.joints):
        scaled = 2.0 * (s.joint_q[world, i] - s.lower[i]) / (s.upper[i] - s.lower[i]) - 1.0
        s.observation[world, i] = wp.clamp(scaled, -limit, limit)
        s.observation[world, s.joints + i] = wp.clamp(h.velocity_scale * s.joint_qd[world, i], -limit, limit)
    f = frames(s, h, world)
    between = wp.transform_get_translation(f.grasp) - wp.transform_get_translation(f.tool)
    seen = wp.quat_rotate_inv(h.part[world].base, between)
    for i in range(3):
        s.observation[world, 2 * s.joints + i] = wp.clamp(seen[i], -limit, limit)
    s.observation[world, 2 * s.joints + 3] = wp.clamp(s.joint_q[world, p.coord], -limit, limit)
    s.observation[world, 2 * s.joints + 4] = wp.clamp(s.joint_qd[world, p.dof], -limit, limit)


@wp.func
def _write(s: State, h: PartHandles, world: int, first: int, values: wp.vec3):
    for i in range(3):
        s.observation[world, first + i] = wp.clamp(values[i], -h.observation_limit, h.observation_limit)


@wp.kernel
def describe(s: State, h: PartHandles):
    """Write what tells one part from another as the last DESCRIBED observations.

    The grasp in the tool frame: point [m], its y and z; in the robot's base frame the joint's axis, positive opens, and the
    direction in which the grasp point moves when the part opens; 1 for a slide, else 0; a hinge's lever arm, 0 for a slide,
    travel and opening [m]; the extents of the grasp region [m].
    """
    world = wp.tid()
    p, f = h.part[world], frames(s, h, world)
    grasp = wp.transform_inverse(f.tool) * f.grasp
    y, z = wp.vec3(0.0, 1.0, 0.0), wp.vec3(0.0, 0.0, 1.0)
    axis = p.axis * wp.sign(p.lever_arm)
    along = axis
    if p.slides == 0:
        along = wp.normalize(wp.cross(axis, wp.transform_get_translation(f.grasp) - p.origin))
    first = s.observation.shape[1] - DESCRIBED
    _write(s, h, world, first, wp.transform_get_translation(grasp))
    _write(s, h, world, first + 3, wp.transform_vector(grasp, y))
    _write(s, h, world, first + 6, wp.transform_vector(grasp, z))
    _write(s, h, world, first + 9, wp.quat_rotate_inv(p.base, axis))
    _write(s, h, world, first + 12, wp.quat_rotate_inv(p.base, along))
    _write(s, h, world, first + 15, p.size)
    _write(
        s, h, world, first + 18, wp.vec3(float(p.slides), wp.where(p.slides == 1, 0.0, wp.abs(p.lever_arm)), p.travel)
    )
    s.observation[world, first + 21] = wp.clamp(opening_of(s, h, world), -h.observation_limit, h.observation_limit)


class PartTask(Task):
    """A task with an articulated part: the shared observation, and the kernels `reset`, `update`, `write_result` of KERNELS."""

    KERNELS: Any

    def launch(self, kernel: wp.Kernel, state: State) -> None:
        """Launch a kernel of (state, handles) in all worlds."""
        wp.launch(kernel, dim=len(state.done), inputs=[state, self.handles])

    def reset(self, state: State) -> None:
        """Start a new episode where one ended."""
        self.launch(self.KERNELS.reset, state)

    def update(self, state: State) -> None:
        """Keep what reward terms and results read."""
        self.launch(self.KERNELS.update, state)

    def observe(self, state: State) -> None:
        """Write the observations."""
        wp.launch(observe, dim=len(state.done), inputs=[state, self.handles.p])
        if self.config.describe_part:
            wp.launch(describe, dim=len(state.done), inputs=[state, self.handles.p])

    def result(self, state: State) -> None:
        """Write how finished episodes went."""
        self.launch(self.KERNELS.write_result, state)
