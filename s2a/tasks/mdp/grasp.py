"""Frames of tool and grasp, opening, contact forces of a control step, and the one predicate of a grasp.

The tool frame: origin between the finger pads (plus `tcp_offset`), z forward, y from the right finger to the left. The grasp
frame of a part: at the mean of its grasp region, z into the furniture, y across the region's thin section (the world's up for a
horizontal bar), moving with the part; of a free object that of its body. The opening is the path of the grasp point [m].
"""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import warp as wp

from s2a.sim import world as worlds
from s2a.sim.contacts import PartContacts
from s2a.tasks.state import Carried, State, TaskTarget, World

wp.set_module_options({"enable_backward": False})  # half the time to compile

OPPOSED = wp.constant(worlds.OPPOSED)


@wp.struct
class Frames:
    """Poses of a world, world frame; the fingers' positions [m]."""

    tool: wp.transform
    grasp: wp.transform
    left: wp.vec3
    right: wp.vec3


@wp.func
def frames(s: State, w: World, world: int) -> Frames:
    """Return where tool, grasp and fingers are."""
    f = Frames()
    f.tool = s.body_q[world, w.tool_link] * w.tool
    f.grasp = s.body_q[world, w.body] * w.target[world].grasp
    f.left = wp.transform_get_translation(s.body_q[world, w.left])
    f.right = wp.transform_get_translation(s.body_q[world, w.right])
    return f


@wp.func
def tool_point(s: State, w: World, world: int):
    """Return the tool frame's origin [m]."""
    return wp.transform_get_translation(s.body_q[world, w.tool_link] * w.tool)


@wp.func
def tool_distance(f: Frames):
    """Return the distance from the tool to the grasp point [m]."""
    return wp.length(wp.transform_get_translation(f.tool) - wp.transform_get_translation(f.grasp))


@wp.func
def opening_at(w: World, coordinate: float, world: int):
    """Return the opening [m] at a coordinate of the part's joint."""
    return coordinate * w.target[world].lever_arm


@wp.func
def opening_of(s: State, w: World, world: int):
    """Return how far the part is open [m]."""
    return opening_at(w, s.joint_q[world, w.target[world].coord], world)


@wp.func
def opening_speed(s: State, w: World, world: int):
    """Return how fast the part opens [m/s]."""
    return s.joint_qd[world, w.target[world].dof] * w.target[world].lever_arm


@wp.func
def opening_force(t: TaskTarget, wrench: wp.spatial_vector):
    """Return the force along the opening at the grasp point [N] of a wrench on the part about the world's origin."""
    force, torque = wp.spatial_top(wrench), wp.spatial_bottom(wrench)
    if t.slides == 1:
        return wp.dot(force, t.axis) * wp.sign(t.lever_arm)
    about = torque - wp.cross(t.origin, force)
    return wp.dot(about, t.axis) / t.lever_arm


@wp.func
def opposition(c: PartContacts, world: int):
    """Return the cosine between the forces with which the fingers press on the region: -1 where they are opposed; 1 without."""
    left, right = c.normal[world, 0], c.normal[world, 1]
    lengths = wp.length(left) * wp.length(right)
    return wp.where(lengths > 0.0, wp.dot(left, right) / lengths, 1.0)


@wp.func
def is_pushed(w: World, force: float, sense: float, world: int):
    """Return whether the robot moves the target by something else than the fingers on its region, harder than by these.

    Of a part on a joint the force along its motion counts (sense 1 opens, -1 closes), from `force` [N] on; of a free object any
    contact of another link.
    """
    t, c = w.target[world], w.contacts
    if t.free == 1:
        return c.other_links[world] > wp.min(c.on_region[world, 0], c.on_region[world, 1])
    other = sense * opening_force(t, c.pull[world, 1])
    return other >= force and other > sense * opening_force(t, c.pull[world, 0])


@wp.func
def is_grasped(w: World, force: float, sense: float, world: int):
    """Return whether the gripper holds the target by its region: both fingers press with `force` [N] or more from opposed sides.

    What moves the target must be the grip: where anything else of the robot pushes it harder in the sense of the motion (1
    opens, -1 closes), it is not grasped. A region wider than the gripper opens cannot be pinched: there one finger is enough.
    """
    c = w.contacts
    if is_pushed(w, force, sense, world):
        return False
    if w.target[world].pinchable == 0:
        return wp.max(c.on_region[world, 0], c.on_region[world, 1]) >= force
    if wp.min(c.on_region[world, 0], c.on_region[world, 1]) < force:
        return False
    return opposition(c, world) < OPPOSED


@wp.func
def firmness(w: World, world: int):
    """Return how firmly the gripper holds a target that it opens or carries, from 0, not grasped, to 1.

    It grows with the angle between the fingers' forces, from OPPOSED to `number.firm`, cosines both. Near OPPOSED the fingers
    hook the handle as much as they press it.
    """
    if not is_grasped(w, w.number.contact_force, 1.0, world):
        return 0.0
    if w.target[world].pinchable == 0 or w.number.firm >= OPPOSED:
        return 1.0
    return wp.min((OPPOSED - opposition(w.contacts, world)) / (OPPOSED - w.number.firm), 1.0)


@wp.kernel
def clear_contacts(s: State, w: World):
    """Clear the contact forces and the touch of the control step before."""
    world = wp.tid()
    w.contacts.peak[world] = 0.0
    if w.region_force.shape[0] > 0:
        w.region_force[world, 0] = 0.0
        w.region_force[world, 1] = 0.0
    if w.carried.shape[0] > 0:
        w.carried[world, Carried.touched] = 0.0


@wp.kernel
def keep_region_force(s: State, w: World):
    """Keep each finger's maximum force on the region in the control step."""
    world = wp.tid()
    for i in range(2):
        w.region_force[world, i] = wp.max(w.region_force[world, i], w.contacts.on_region[world, i])


@wp.struct
class SeenPart:
    """What a policy observes of a part where it now is: the grasp that is seen, axis and direction of opening, world frame."""

    grasp: wp.transform
    axis: wp.vec3
    along: wp.vec3
    size: wp.vec3
    slides: float
    lever_arm: float
    travel: float
    opening: float  # [m]
    # coordinate, velocity: of the joint [m or rad, a second]
    coordinate: float
    velocity: float


@wp.func
def seen_part(s: State, w: World, world: int):
    """Return what a policy sees of a world's part: the truth but for the error of the grasp."""
    d, t = SeenPart(), w.target[world]
    grasp = s.body_q[world, w.body] * t.grasp
    d.grasp = grasp * w.seen[world]
    d.opening = opening_of(s, w, world)
    d.axis = t.axis * wp.sign(t.lever_arm)
    d.size = t.size
    d.slides = float(t.slides)
    d.travel = t.travel
    d.along = d.axis
    d.lever_arm = 0.0
    if t.slides == 0:
        d.along = wp.normalize(wp.cross(d.axis, wp.transform_get_translation(grasp) - t.origin))
        d.lever_arm = wp.abs(t.lever_arm)
    d.coordinate = s.joint_q[world, t.coord]
    d.velocity = s.joint_qd[world, t.dof]
    return d


@wp.kernel
def misplace(s: State, w: World, length: wp.vec2, turn: wp.vec2):
    """Where an episode begins, shift and turn the seen grasp in random directions by amounts between two limits [m], [rad]."""
    world = wp.tid()
    if s.done[world] == 0:
        return
    rng = s.rng[world]
    shift = wp.sample_unit_sphere_surface(rng) * wp.randf(rng, length[0], length[1] + 1.0e-9)
    axis = wp.sample_unit_sphere_surface(rng)
    w.seen[world] = wp.transform(shift, wp.quat_from_axis_angle(axis, wp.randf(rng, turn[0], turn[1] + 1.0e-9)))
    s.rng[world] = rng
