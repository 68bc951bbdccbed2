"""The part as a policy sees it: the truth, the truth with an error of the grasp, or an estimate that its own motion tracks."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
from dataclasses import dataclass

import numpy as np
import warp as wp

from s2a.robot.tool_path import matrices
from s2a.scene.articulation import opening_direction, opening_sign
from s2a.sim.world import SimStage
from s2a.tasks.mdp.grasp import frames, opening_of
from s2a.tasks.state import EstimatedPart, State, World, finger_position, sense

NUMBERS = 21  # Length of a description as a vector
DIRECTIONS = (3, 6, 9, 12)  # Where in it across, inwards, axis and along begin
# Of the two directions across a handle, which differ by half a turn of the gripper,
# the one that points this way is taken
SIDEWAYS = np.array([0.0, 0.3, 1.0])


@dataclass(frozen=True)
class Description:
    """A part at its scanned pose, in the robot's base frame."""

    point: np.ndarray  # the grasp point [m], shape [3]
    across: np.ndarray  # the grasp frame's y, along which the fingers close, shape [3]
    inwards: np.ndarray  # its z, into the furniture, shape [3]
    axis: np.ndarray  # of the joint, positive opens, shape [3]
    along: np.ndarray  # the direction in which the grasp point moves first when the part opens, shape [3]
    size: np.ndarray  # extents of the grasp region along the grasp frame's axes [m], shape [3]
    slides: float  # 1 for a slide, 0 for a hinge; of an estimate anything between
    lever_arm: float  # of a hinge [m], 0 for a slide
    travel: float  # path of the grasp point to the open limit [m]

    def vector(self) -> np.ndarray:
        """Return the numbers in the order of the attributes, shape [NUMBERS], float32."""
        vectors = (self.point, self.across, self.inwards, self.axis, self.along, self.size)
        return np.concatenate([*vectors, [self.slides, self.lever_arm, self.travel]]).astype(np.float32)


def of_vector(numbers: np.ndarray) -> Description:
    """Return the description that `Description.vector` gave."""
    point, across, inwards, axis, along, size = numbers[:18].astype(float).reshape(6, 3)
    slides, lever_arm, travel = map(float, numbers[18:NUMBERS])
    return Description(point, across, inwards, axis, along, size, slides, lever_arm, travel)


def truth(stage: SimStage) -> Description:
    """Return the description of a stage's part."""
    to_base = np.linalg.inv(matrices(stage.base[None])[0])
    grasp = to_base @ matrices(stage.grasp[None])[0]
    across = grasp[:3, 1] * (1.0 if grasp[:3, 1] @ SIDEWAYS >= 0.0 else -1.0)
    turn, slides = to_base[:3, :3], stage.joint.kind == "prismatic"
    return Description(
        point=grasp[:3, 3],
        across=across,
        inwards=grasp[:3, 2],
        axis=turn @ (opening_sign(stage.joint) * np.array(stage.joint.axis)),
        along=turn @ opening_direction(stage.joint, stage.grasp[:3]),
        size=np.array(stage.grasp_size),
        slides=float(slides),
        lever_arm=0.0 if slides else stage.lever_arm,
        travel=stage.travel,
    )


wp.set_module_options({"enable_backward": False})  # half the time to compile

# [m] From the observed grasp, up to which the tool is at it; the reference's tool frame is 6 cm from the fingertips
HOLD_DISTANCE = wp.constant(0.1)
# [m] By which a finger's target is closed further than the finger, and by which fingers are open that hold something
HOLD_GAP = wp.constant(0.002)
HOLD_SPEED = wp.constant(0.01)  # [m/s] Below it a finger stands still


@wp.struct
class SeenPart:
    """What a policy sees of a part: the seen grasp, world frame; axis to travel as of EstimatedPart, where the part now is."""

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
def estimate_of(w: World, world: int):
    """Return the estimate of a world's part that a policy observes."""
    return w.estimates[w.stage[world], w.frame[world]]


@wp.func
def grasp_at(e: EstimatedPart, opening: float):
    """Return the estimated grasp frame, the part opened so far [m]."""
    point, turn = wp.transform_get_translation(e.grasp), wp.transform_get_rotation(e.grasp)
    if e.slides == 1:
        return wp.transform(point + opening * e.along, turn)
    by = wp.quat_from_axis_angle(e.axis, opening / e.lever_arm)
    return wp.transform(e.origin + wp.quat_rotate(by, point - e.origin), by * turn)


@wp.func
def along_at(e: EstimatedPart, opening: float):
    """Return the direction in which the estimated grasp moves, the part opened so far [m]."""
    if e.slides == 1:
        return e.along
    return wp.quat_rotate(wp.quat_from_axis_angle(e.axis, opening / e.lever_arm), e.along)


@wp.func
def seen_part(s: State, w: World, world: int):
    """Return what a policy sees of a world's part: the truth but for the error of the grasp, or the estimate."""
    d, t = SeenPart(), w.target[world]
    if w.is_estimated == 1:
        e, track = estimate_of(w, world), w.tracked[world]
        unit = wp.where(e.slides == 1, 1.0, wp.max(e.lever_arm, 1.0e-6))
        d.grasp = grasp_at(e, track[0])
        d.opening = track[0]
        d.axis = e.axis
        d.along = along_at(e, track[0])
        d.size = e.size
        d.slides = float(e.slides)
        d.lever_arm = e.lever_arm
        d.travel = e.travel
        d.coordinate = track[0] / unit
        d.velocity = track[1] / unit
        return d
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


@wp.kernel
def choose_frame(s: State, w: World):
    """Where an episode begins, draw one of the stage's estimates; the opening that it begins with is known to the policy."""
    world = wp.tid()
    if s.done[world] == 0:
        return
    rng, stage = s.rng[world], w.stage[world]
    w.frame[world] = wp.randi(rng, 0, w.estimates.shape[1])
    w.seen[world] = wp.transform_inverse(w.target[world].grasp) * w.estimates[stage, w.frame[world]].grasp
    w.tracked[world] = wp.vec2(wp.max(opening_of(s, w, world), 0.0), 0.0)
    w.tool_before[world] = wp.vec3(wp.inf, 0.0, 0.0)
    s.rng[world] = rng


@wp.kernel
def track(s: State, w: World):
    """Add to the tracked opening how far the tool moved along the estimated path in a control step, while the gripper holds.

    It holds something where its fingers' targets are closed further, they stand still, are not closed, and the tool is near the
    grasp.
    """
    world = wp.tid()
    e, now = estimate_of(w, world), frames(s, w, world)
    tool = wp.transform_get_translation(now.tool)
    opening = w.tracked[world][0]
    holds = wp.length(tool - wp.transform_get_translation(grasp_at(e, opening))) < HOLD_DISTANCE
    width = float(0.0)
    for i in range(s.arm, s.joints):
        width += finger_position(s, world, i, s.joint_q[world, i])
        closes = sense(s, world, i) * (s.joint_q[world, i] - s.target_q[world, i]) > HOLD_GAP
        holds = holds and closes and wp.abs(s.joint_qd[world, i]) < HOLD_SPEED
    gained = float(0.0)
    if holds and width > HOLD_GAP and wp.isfinite(w.tool_before[world][0]):
        step = tool - w.tool_before[world]
        if e.slides == 1:
            gained = wp.dot(step, e.along)
        else:
            out = tool - e.origin
            out -= wp.dot(out, e.axis) * e.axis
            gained = e.lever_arm * wp.dot(step, wp.cross(e.axis, out)) / wp.max(wp.dot(out, out), 1.0e-4)
    w.tracked[world] = wp.vec2(wp.max(opening + gained, 0.0), gained / w.number.control_step)
    w.tool_before[world] = tool
