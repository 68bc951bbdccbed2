"""World: the one struct that rewards, observations and metrics of all tasks take beside the State."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import warp as wp

from s2a.sim.contacts import PartContacts
from s2a.tasks.state import columns

OPENED = ("maximum", "gained", "grasped", "both", "any", "off", "body", "stood", "pushed", "force", "closed")
"""Columns of `World.opened`: the maximum opening [m]; the opening gained [m], in all and while grasped, with both fingers on
the region, with one or both, with a finger on the part but none on the region, pushed by another link of the robot; whether the
part ever stood open as `open_75pct_static` demands; whether another link touched the part last; the maximum contact force [N];
whether the part was closed at any time."""
GRASPED = ("before", "opening", "maximum", "path")
"""Columns of `World.grasped`: the opening of the last physics step, and how much of it the part was grasped over, by how
firmly; the maximum opening so far, and how much of the path to it `grasped_path` rewards [m]."""
CARRIED = ("carried", "loose", "still", "drift", "disturbed", "touched", "grasped", "ride", "coordinate")
"""Columns of `World.carried`: the object's path while grasped and else [m]; control steps at rest at its place; displacement
since the last touch [m]; of other bodies [m]; whether the robot touched the object in this control step; whether it was ever
grasped; the container's path towards shut with the untouched object in it, and its coordinate a physics step ago [m or rad]."""
LIMITS = ("success", "open_30cm", "open_75pct_static", "open_95pct")
"""Columns of `World.limits`: openings from which an episode counts [m]."""
Opened, Grasped, Carried, Limit = (columns(names) for names in (OPENED, GRASPED, CARRIED, LIMITS))


@wp.struct
class TaskTarget:
    """What a world's robot is to move: a part on a joint, or a free object.

    Attributes:
        free: 1 for a free object, 0 for a part on a joint; the joint's numbers then mean nothing.
        grasp: grasp frame in the target's body; of a free object the body's own frame.
        base: world from the robot's base.
        lever_arm: opening per unit of the joint's coordinate [1 or m], positive opens.
        axis, origin: of the joint, world frame [1, m].
        slides: 1 for a slide, 0 for a hinge.
        coord, dof: index of the target's first coordinate and of its velocity within the world.
        travel: opening at the open limit [m].
        size: extents of the grasp region along the grasp frame's axes [m].
        pinchable: 1 where two fingers can hold the region: it is thinner than the gripper opens, or held from within.
    """

    free: int
    grasp: wp.transform
    base: wp.quat
    lever_arm: float
    axis: wp.vec3
    origin: wp.vec3
    slides: int
    coord: int
    dof: int
    travel: float
    size: wp.vec3
    pinchable: int


@wp.struct
class EstimatedPart:
    """What a policy observes of a part by an estimate (`s2a.tasks.mdp.seen`), the part at zero, world frame.

    Attributes:
        grasp: the grasp frame.
        axis: of the joint, positive opens.
        along: direction in which the grasp point moves first when the part opens.
        origin: of the joint [m].
        size: extents of the grasp region along the grasp frame's axes [m].
        slides: 1 for a slide, 0 for a hinge.
        lever_arm: of a hinge [m], 0 for a slide.
        travel: opening at the open limit [m].
    """

    grasp: wp.transform
    axis: wp.vec3
    along: wp.vec3
    origin: wp.vec3
    size: wp.vec3
    slides: int
    lever_arm: float
    travel: float


@wp.struct
class ObjectPlace:
    """Where an object is to be put.

    Attributes:
        goal: planned pose of the object; in the container's body frame where there is one, else in the world's.
        object: its hulls, a mesh in its body frame.
        container: index within a world of the body that contains the place, -1 where the place is on a fixed support.
        coord: the container's coordinate.
        hulls: the container's hulls, a mesh in its body frame.
        inside: pose of the middle of its inside, in its body frame.
        half: half the extents of the inside [m].
        shut: coordinate up to which the container is shut [m or rad].
        lever: path of its grasp point per unit of the coordinate.
        rest_steps, settle_steps: of the settings, in control steps.
    """

    goal: wp.transform
    object: wp.uint64
    container: int
    coord: int
    hulls: wp.uint64
    inside: wp.transform
    half: wp.vec3
    shut: float
    lever: float
    rest_steps: int
    settle_steps: int


@wp.struct
class Numbers:
    """Settings of tasks and metrics by their own names; those that a task has not are 0.

    Attributes:
        close_distance: -1 where a task has none.
        firm: cosine between the fingers' forces from which a grasp is rewarded in full.
        bonus: openings that give a bonus [m].
        counted_force: `contact_force` of the metrics: from which a contact counts in results [N].
        control_step: [s].
    """

    contact_force: float
    velocity_scale: float
    observation_limit: float
    close_distance: float
    gentle_force: float
    termination_opening: float
    firm: float
    bonus: wp.vec3
    position_tolerance: float
    angle_tolerance: float
    rest_shift: float
    rest_turn: float
    clear_distance: float
    counted_force: float
    static_speed: float
    grasp_fraction: float
    contact_fraction: float
    closed_opening: float
    carried_fraction: float
    max_drift: float
    max_disturbance: float
    min_ride: float
    control_step: float


@wp.struct
class World:
    """Robot, target, contacts, place and progress of all worlds. Arrays that a task does not use have no rows.

    Attributes:
        tool_link, left, right: indices of bodies within a world: the tool's link and the fingers.
        tool: the tool frame in its link.
        body: index of the target's body within a world.
        target: shape [world].
        contacts: of the robot with the target in the last physics step.
        region_force: max force of the left and right finger on the region in the control step [N], shape [world 2].
        resistance: of the part's joint: dry friction [N or N m], damping [N s/m or N m s/rad]; log of its mass, shape [world].
        scale: factor of all openings, below 1 where the part's travel is short, shape [world].
        limits: thresholds of the metrics, shape [world LIMITS].
        place: where an object is to be put.
        others: bodies that must not move, shape [other].
        seen: the grasp that is seen, in the grasp frame, shape [world].
        is_estimated: 1 where a policy observes an estimate of the part, not the truth.
        estimates: of each stage's frames, shape [stage frame]; those of a stage that has fewer are repeated.
        stage: index of each world's stage, shape [world].
        frame: which of them a policy observes in the running episode, shape [world].
        tracked: how far the part is open and how fast, by the robot's own motion [m, m/s]; shape [world].
        tool_before: position of the tool a control step ago [m], shape [world].
        opened: how a part was opened in the running episode, shape [world OPENED].
        grasped: how it was grasped, shape [world GRASPED].
        carried: how an object was carried in the running episode, shape [world CARRIED].
        last, released: the object's position where its path was last measured, and where the robot last touched it: in the
            world (0) and in the container (1) [m], shape [world 2].
        rested: the object's pose since which its steps at rest are counted, shape [world].
        origin: where the others were at the start [m], shape [world other].
        own: columns of one task alone, by its OWN, shape [world column].
        number: of the settings.
    """

    tool_link: int
    left: int
    right: int
    tool: wp.transform
    body: int
    target: wp.array(dtype=TaskTarget)
    contacts: PartContacts
    region_force: wp.array2d(dtype=float)
    resistance: wp.array(dtype=wp.vec3)
    scale: wp.array(dtype=float)
    limits: wp.array2d(dtype=float)
    place: ObjectPlace
    others: wp.array(dtype=int)
    seen: wp.array(dtype=wp.transform)
    is_estimated: int
    estimates: wp.array2d(dtype=EstimatedPart)
    stage: wp.array(dtype=int)
    frame: wp.array(dtype=int)
    tracked: wp.array(dtype=wp.vec2)
    tool_before: wp.array(dtype=wp.vec3)
    opened: wp.array2d(dtype=float)
    grasped: wp.array2d(dtype=float)
    carried: wp.array2d(dtype=float)
    last: wp.array2d(dtype=wp.vec3)
    released: wp.array2d(dtype=wp.vec3)
    rested: wp.array(dtype=wp.transform)
    origin: wp.array2d(dtype=wp.vec3)
    own: wp.array2d(dtype=float)
    number: Numbers


PERSISTENT = (
    "seen",
    "frame",
    "tracked",
    "tool_before",
    "opened",
    "grasped",
    "carried",
    "last",
    "released",
    "rested",
    "origin",
    "own",
)
"""Arrays that a later step reads before it writes them."""
