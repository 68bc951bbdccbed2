"""What tasks with an articulated part share: where gripper and grasp are, how far the part is open, how it is held.

The tool frame: origin between the finger pads (plus `tcp_offset`), z forward, y from the right finger to the left. The grasp
frame: at the mean of the part's grasp region, z into the furniture, y across the region's thin section (the world's up for a
horizontal bar), moving with the part. The opening is the path of the grasp point [m].
"""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from s2a.articulation import opening_sign
from s2a.env.state import State
from s2a.env.task import MdpConfig, Task
from s2a.ranges import NotNegative, Positive
from s2a.sim.contacts import ContactSensor, PartContacts
from s2a.sim.simulation import Simulation
from s2a.sim.world import SimStage


@dataclass(frozen=True)
class PartMdp(MdpConfig):
    """What the decision processes with a part share.

    Attributes:
        velocity_scale: factor of the joint velocities in the observation.
        observation_limit: observations are clamped to +- this.
        tcp_offset: shift of the tool frame from the point between the pads, in that frame [m].
        contact_distance: distance of a contact from the annotated region up to which it is on it [m].
        contact_force: normal force from which a contact counts [N].
    """

    velocity_scale: float
    observation_limit: Positive
    tcp_offset: tuple[float, float, float]
    contact_distance: NotNegative
    contact_force: NotNegative


OPPOSED = wp.constant(-0.5)
"""Cosine between the forces of both fingers below which they pinch: more than 120 degrees apart."""


@wp.struct
class Part:
    """A world's part and grasp.

    Attributes:
        grasp: grasp frame in the part's body.
        base: world from the robot's base.
        lever: opening per unit of the joint's coordinate [1 or m], positive opens.
        axis, origin: of the joint, world frame [1, m].
        slides: 1 for a slide, 0 for a hinge.
        travel: opening at the open limit [m].
        pinchable: 1 where the region is thinner than the gripper opens.
    """

    grasp: wp.transform
    base: wp.quat
    lever: float
    axis: wp.vec3
    origin: wp.vec3
    slides: int
    travel: float
    pinchable: int


@wp.struct
class Bodies:
    """Indices within a world: the tool's link, the fingers, the part, its coordinate; the tool frame in its link."""

    tool_link: int
    left: int
    right: int
    part: int
    coord: int
    dof: int
    tool: wp.transform


@wp.struct
class PartHandles:
    """What the tasks with a part share.

    Attributes:
        part: shape [world].
        bodies: indices, the same in all worlds.
        contacts: of the last physics step.
        touch: largest force of the left and right finger on the region in the control step [N], shape [world 2].
        contact_force: force from which a contact counts [N].
        velocity_scale: factor of the joint velocities in the observation.
        observation_limit: observations are clamped to +- this.
    """

    part: wp.array(dtype=Part)
    bodies: Bodies
    contacts: PartContacts
    touch: wp.array2d(dtype=float)
    contact_force: float
    velocity_scale: float
    observation_limit: float


@wp.struct
class Frames:
    """Poses of a world, world frame; the fingers' positions [m]."""

    tool: wp.transform
    grasp: wp.transform
    left: wp.vec3
    right: wp.vec3


def observations(sim: Simulation) -> int:
    """Return the length of what `observe` writes."""
    return 2 * sim.layout.robot_joints + 5


def bind(sim: Simulation, sensor: ContactSensor, config: PartMdp) -> PartHandles:
    """Return the shared handles of worlds."""
    h, b, (left, right) = PartHandles(), Bodies(), sim.layout.finger_bodies
    b.tool_link, b.left, b.right, b.part = sim.layout.tool_body, left, right, sim.layout.part_body
    b.coord, b.dof = sim.layout.part_coord, sim.layout.part_dof
    b.tool = wp.transform(wp.vec3(*np.add(sim.robot.tool_offset, config.tcp_offset)), wp.quat_identity())
    kinds = [_part(stage, sim.robot.gripper.max_opening) for stage in sim.stages]
    h.part, h.bodies, h.contacts = wp.array([kinds[i] for i in sim.stage_of_env], dtype=Part), b, sensor.found
    h.touch, h.contact_force = wp.zeros((sim.num_envs, 2), dtype=float), config.contact_force
    h.velocity_scale, h.observation_limit = config.velocity_scale, config.observation_limit
    return h


def _part(stage: SimStage, max_opening: float) -> Part:
    p, joint = Part(), stage.joint
    p.grasp = wp.transform(*stage.grasp[:3], *stage.grasp[3:])
    p.base = wp.quat(*stage.base[3:])
    p.lever, p.travel = opening_sign(joint) * stage.lever, stage.travel
    p.axis, p.origin, p.slides = wp.vec3(*joint.axis), wp.vec3(*joint.origin), int(joint.kind == "prismatic")
    p.pinchable = int(stage.grasp_size[1] < max_opening)
    return p


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
    return s.joint_q[world, h.bodies.coord] * h.part[world].lever


@wp.func
def opening_speed(s: State, h: PartHandles, world: int):
    """Return how fast the part opens [m/s]."""
    return s.joint_qd[world, h.bodies.dof] * h.part[world].lever


@wp.func
def opening_force(p: Part, wrench: wp.spatial_vector):
    """Return the force along the opening at the grasp point [N] of a wrench on the part about the world's origin."""
    force, torque = wp.spatial_top(wrench), wp.spatial_bottom(wrench)
    if p.slides == 1:
        return wp.dot(force, p.axis) * wp.sign(p.lever)
    about = torque - wp.cross(p.origin, force)
    return wp.dot(about, p.axis) / p.lever


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
def clear_touch(h: PartHandles):
    """Forget the forces of the control step before."""
    world = wp.tid()
    h.contacts.peak[world] = 0.0
    for finger in range(2):
        h.touch[world, finger] = 0.0


@wp.kernel
def keep_touch(h: PartHandles):
    """Keep each finger's largest force on the region in the control step."""
    world = wp.tid()
    for finger in range(2):
        h.touch[world, finger] = wp.max(h.touch[world, finger], h.contacts.on_region[world, finger])


@wp.kernel
def observe(s: State, h: PartHandles):
    """Write the reference's observation, shape [world 2 * joints + 5].

    Joint positions scaled to their range and velocities, the vector from tool to grasp in the robot's base frame [m], the
    part's coordinate and velocity.
    """
    world = wp.tid()
    limit, b = h.observation_limit, h.bodies
    for i in range(s.joints):
        scaled = 2.0 * (s.joint_q[world, i] - s.lower[i]) / (s.upper[i] - s.lower[i]) - 1.0
        s.observation[world, i] = wp.clamp(scaled, -limit, limit)
        s.observation[world, s.joints + i] = wp.clamp(h.velocity_scale * s.joint_qd[world, i], -limit, limit)
    f = frames(s, h, world)
    between = wp.transform_get_translation(f.grasp) - wp.transform_get_translation(f.tool)
    seen = wp.quat_rotate_inv(h.part[world].base, between)
    for i in range(3):
        s.observation[world, 2 * s.joints + i] = wp.clamp(seen[i], -limit, limit)
    s.observation[world, 2 * s.joints + 3] = wp.clamp(s.joint_q[world, b.coord], -limit, limit)
    s.observation[world, 2 * s.joints + 4] = wp.clamp(s.joint_qd[world, b.dof], -limit, limit)


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

    def result(self, state: State) -> None:
        """Write how finished episodes went."""
        self.launch(self.KERNELS.write_result, state)
