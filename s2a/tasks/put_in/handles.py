"""What putting into a part keeps of an episode, and where the object and the gripper are against the part."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import warp as wp

from s2a.env.state import State
from s2a.env.task import columns
from s2a.tasks.pick_place.mdp import PickPlace, clearance, tool_of

Progress = columns(("carried", "loose", "still", "drift", "disturbed", "touched", "grasped", "ride", "coordinate"))
"""What is kept of a running episode: path while pinched and else [m]; steps at rest at the place; displacement since the last
touch [m]; of other bodies [m]; whether the robot touched the object in this control step; whether it was ever pinched; the part's
path towards shut with the untouched object in it [m or rad]; its coordinate in the physics step before."""


@wp.struct
class PutIn:
    """Handles of the task.

    Attributes:
        p: those of picking and placing; `p.goal` is the object's place with the part at zero.
        part: index of the part's body within a world.
        coord: its coordinate.
        surface: its hulls, a mesh in its body frame.
        inside: pose of the middle of its inside, the part at zero.
        half: half the extents of the inside [m].
        others: bodies that must not move, shape [other].
        progress: of the running episode, shape [world column].
        last, last_in: where its path was last measured, in the scene and against the part [m], shape [world].
        released, released_in: where the robot last touched it, likewise.
        origin: where the others were at the start [m], shape [world other].
        shut: coordinate up to which the part is shut [m or rad].
        lever: path of the grasp point per unit of the coordinate.
        min_ride: of the metrics [m].
    """

    p: PickPlace
    part: int
    coord: int
    surface: wp.uint64
    inside: wp.transform
    half: wp.vec3
    others: wp.array(dtype=int)
    progress: wp.array2d(dtype=float)
    last: wp.array(dtype=wp.vec3)
    last_in: wp.array(dtype=wp.vec3)
    released: wp.array(dtype=wp.vec3)
    released_in: wp.array(dtype=wp.vec3)
    origin: wp.array2d(dtype=wp.vec3)
    shut: float
    lever: float
    min_ride: float


@wp.func
def in_part(pose: wp.transform, part: wp.transform):
    """Return a pose as it is with the part at zero."""
    return wp.transform_inverse(part) * pose


@wp.func
def is_inside(h: PutIn, at: wp.vec3):
    """Return whether a point, the part at zero, is inside of it."""
    local = wp.transform_point(wp.transform_inverse(h.inside), at)
    return wp.abs(local[0]) <= h.half[0] and wp.abs(local[1]) <= h.half[1] and wp.abs(local[2]) <= h.half[2]


@wp.func
def place_error(s: State, h: PutIn, world: int):
    """Return the object's distance from its place against the part [m]."""
    now = in_part(s.body_q[world, h.p.body], s.body_q[world, h.part])
    return wp.length(wp.transform_get_translation(now) - wp.transform_get_translation(h.p.goal))


@wp.func
def turn_error(s: State, h: PutIn, world: int):
    """Return the angle between the object's rotation and the planned one against the part [rad]."""
    now = in_part(s.body_q[world, h.p.body], s.body_q[world, h.part])
    turn = wp.quat_inverse(wp.transform_get_rotation(h.p.goal)) * wp.transform_get_rotation(now)
    return 2.0 * wp.atan2(wp.length(wp.vec3(turn[0], turn[1], turn[2])), wp.abs(turn[3]))


@wp.func
def part_clearance(s: State, h: PutIn, point: wp.vec3, world: int):
    """Return the distance of a point from the part's surface [m], up to 1."""
    local = wp.transform_point(wp.transform_inverse(s.body_q[world, h.part]), point)
    found = wp.mesh_query_point_no_sign(h.surface, local, 1.0)
    if not found.result:
        return float(1.0)
    return wp.length(wp.mesh_eval_position(h.surface, found.face, found.u, found.v) - local)


@wp.func
def gripper_clearance(s: State, h: PutIn, world: int):
    """Return the smallest distance of tool and fingers from object and part [m]."""
    left = wp.transform_get_translation(s.body_q[world, h.p.left])
    right = wp.transform_get_translation(s.body_q[world, h.p.right])
    tool = tool_of(s, h.p, world)
    of_object = wp.min(
        clearance(s, h.p, tool, world), wp.min(clearance(s, h.p, left, world), clearance(s, h.p, right, world))
    )
    of_part = wp.min(
        part_clearance(s, h, tool, world), wp.min(part_clearance(s, h, left, world), part_clearance(s, h, right, world))
    )
    return wp.min(of_object, of_part)
