"""What kernels ask about a part: where gripper and grasp are, how far it is open, how it is held.

The tool frame: origin between the finger pads (plus `tcp_offset`), z forward, y from the right finger to the left. The grasp
frame: at the mean of the part's grasp region, z into the furniture, y across the region's thin section (the world's up for a
horizontal bar), moving with the part. The opening is the path of the grasp point [m].
"""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import warp as wp

from s2a.env.state import State
from s2a.sim.contacts import PartContacts
from s2a.tasks.part_handles import PartGeometry, PartHandles

OPPOSED = wp.constant(-0.5)
"""Cosine between the forces of both fingers below which they pinch: more than 120 degrees apart."""


@wp.struct
class Frames:
    """Poses of a world, world frame; the fingers' positions [m]."""

    tool: wp.transform
    grasp: wp.transform
    left: wp.vec3
    right: wp.vec3


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
def opposition(c: PartContacts, world: int):
    """Return the cosine between the forces with which the fingers press on the region: -1 where they are opposed; 1 without."""
    left, right = c.normal[world, 0], c.normal[world, 1]
    lengths = wp.length(left) * wp.length(right)
    return wp.where(lengths > 0.0, wp.dot(left, right) / lengths, 1.0)


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
    return opposition(c, world) < OPPOSED


@wp.func
def firmness(h: PartHandles, full: float, world: int):
    """Return how firmly the gripper holds a part that it opens, from 0, not grasped, to 1.

    It grows with the angle between the fingers' forces, from OPPOSED to `full`, cosines both. Near OPPOSED the fingers hook the
    handle as much as they press it.
    """
    if not is_grasped(h, h.contact_force, 1.0, world):
        return 0.0
    if h.part[world].pinchable == 0 or full >= OPPOSED:
        return 1.0
    return wp.min((OPPOSED - opposition(h.contacts, world)) / (OPPOSED - full), 1.0)
