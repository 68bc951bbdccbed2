"""Contact, reward, success as Warp kernels; s2a.tasks.open_part.config says what the frames and terms are."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import warp as wp
from mujoco_warp import OverflowType

from s2a.robot.model import ARM_JOINTS, JOINTS
from s2a.tasks.open_part.config import RESULTS, REWARD_TERMS, TROUBLES
from s2a.tasks.open_part.kernels import Constants

TERMS = wp.constant(len(REWARD_TERMS))
OPENING = wp.constant(REWARD_TERMS.index("opening"))
GRIP = wp.constant(REWARD_TERMS.index("grip"))
COLUMNS = wp.constant(len(RESULTS))
TROUBLE = wp.constant(min(RESULTS.index(name) for name in TROUBLES))
PROGRESS = ("largest", "moved", "held", "touched", "beside", "stood", "rows", "contacts")
"""What is kept of a running episode: its largest opening [m]; steps in which that grew on the way from 10 % to 100 % of the
success opening, those of them with both fingers on the grasp region, with one or both, and with a finger on the part but none
on the region; whether the part ever stood open as "static" demands; whether constraint rows, contacts were dropped."""
LARGEST, MOVED, HELD, TOUCHED, BESIDE, STOOD, ROWS, CONTACTS = (wp.constant(i) for i in range(len(PROGRESS)))

ROW_BITS = wp.constant(int(OverflowType.NEFC | OverflowType.NJMAX_NNZ))
CONTACT_BITS = wp.constant(int(OverflowType.BROADPHASE | OverflowType.NARROWPHASE | OverflowType.CCD))


@wp.kernel
def keep_overflow(now: wp.array(dtype=int), kept: wp.array(dtype=int)):
    """Add the overflow bits of a physics step to those of the control step."""
    world = wp.tid()
    kept[world] = kept[world] | now[world]


@wp.kernel
def feel(
    c: Constants,
    region: wp.uint64,
    geom_kind: wp.array(dtype=int),
    contact_count: wp.array(dtype=int),
    contact_geom: wp.array(dtype=wp.vec2i),
    contact_world: wp.array(dtype=int),
    contact_pos: wp.array(dtype=wp.vec3),
    contact_row: wp.array2d(dtype=int),
    row_force: wp.array2d(dtype=float),
    body_q: wp.array2d(dtype=wp.transform),
    touch: wp.array2d(dtype=float),
    elsewhere: wp.array2d(dtype=float),
):
    """Keep each finger's largest normal force on the part in a physics step [N] (left, right), if none before was larger.

    touch [world 2] is that on the annotated grasp region, elsewhere [world 2] that on the rest of the part. One thread a
    contact. A contact counts where it lies, whatever collider carries it. `geom_kind` is 0 left finger, 1 right finger,
    2 target, -1 anything else. `body_q` is that before the step, where the contacts were found: at 1.5 m/s the part is 6 mm
    farther after it.
    """
    contact = wp.tid()
    if contact >= contact_count[0] or contact_row[contact, 0] < 0:
        return
    kinds = wp.vec2i(geom_kind[contact_geom[contact][0]], geom_kind[contact_geom[contact][1]])
    finger = wp.min(kinds[0], kinds[1])
    if wp.max(kinds[0], kinds[1]) != 2 or finger < 0 or finger > 1:
        return
    world = contact_world[contact]
    local = wp.transform_point(wp.transform_inverse(body_q[world, c.target]), contact_pos[contact])
    force = row_force[world, contact_row[contact, 0]]
    if c.pyramidal != 0:  # the edges' forces add up to the normal force
        for i in range(1, contact_row.shape[1]):
            if contact_row[contact, i] >= 0:
                force += row_force[world, contact_row[contact, i]]
    if wp.mesh_query_point_no_sign(region, local, c.touch_distance).result:
        wp.atomic_max(touch, world, finger, force)
    else:
        wp.atomic_max(elsewhere, world, finger, force)


@wp.func
def signed_square(x: float):
    """Return the square of x with x's sign."""
    return wp.sign(x) * x * x


@wp.func
def is_finite(
    joint_q: wp.array2d(dtype=float), joint_qd: wp.array2d(dtype=float), action: wp.array2d(dtype=float), world: int
):
    """Return whether the coordinates and velocities of the robot and the part, and the action, are numbers."""
    finite = bool(True)
    for i in range(JOINTS):
        finite = finite and wp.isfinite(action[world, i])
    for i in range(JOINTS + 1):
        finite = finite and wp.isfinite(joint_q[world, i]) and wp.isfinite(joint_qd[world, i])
    return finite


@wp.kernel
def give_reward(
    c: Constants,
    weights: wp.array(dtype=float),
    upper: wp.array(dtype=float),
    joint_q: wp.array2d(dtype=float),
    joint_qd: wp.array2d(dtype=float),
    body_q: wp.array2d(dtype=wp.transform),
    action: wp.array2d(dtype=float),
    touch: wp.array2d(dtype=float),
    lead: wp.array2d(dtype=float),
    terms: wp.array2d(dtype=float),
    reward: wp.array(dtype=float),
):
    """Compute the reward's terms [world 9] and the reward; all zero where the state or the action is not finite.

    lead [world 2] is kept between steps: the opening, and how much of it both fingers led the part on the grasp region [m].
    """
    world = wp.tid()
    hand = body_q[world, c.link7] * c.hand
    grasp = body_q[world, c.target] * c.grasp
    point = wp.transform_get_translation(grasp)
    left = wp.transform_get_translation(body_q[world, c.left]) - point
    right = wp.transform_get_translation(body_q[world, c.right]) - point
    inwards = wp.transform_vector(grasp, wp.vec3(0.0, 0.0, 1.0))
    up = wp.transform_vector(grasp, wp.vec3(0.0, 1.0, 0.0))
    forward = wp.dot(wp.transform_vector(hand, wp.vec3(0.0, 0.0, 1.0)), inwards)
    upward = wp.dot(wp.transform_vector(hand, wp.vec3(0.0, 1.0, 0.0)), up)
    opening = joint_q[world, JOINTS] * c.lever
    d = wp.length(wp.transform_get_translation(hand) - point)
    near = 1.0 / (1.0 + d * d)
    bonus = float(0.0)
    for i in range(3):
        bonus += wp.where(opening > c.bonus[i], 1.0, 0.0)
    between = wp.dot(left, up) > 0.0 and wp.dot(right, up) < 0.0 and d <= c.close_distance
    closed = upper[ARM_JOINTS] - joint_q[world, ARM_JOINTS] + upper[ARM_JOINTS + 1] - joint_q[world, ARM_JOINTS + 1]
    effort = float(0.0)
    for i in range(JOINTS):
        effort += action[world, i] * action[world, i]
    grip = wp.where(wp.min(touch[world, 0], touch[world, 1]) >= c.touch_force, 1.0, 0.0)
    led = wp.clamp(lead[world, 1] + grip * wp.max(opening - lead[world, 0], 0.0), 0.0, wp.max(opening, 0.0))
    lead[world, 0] = opening
    lead[world, 1] = led
    # In the order of REWARD_TERMS.
    terms[world, 0] = near * near * wp.where(d <= c.close_distance, 2.0, 1.0)
    terms[world, 1] = 0.5 * (signed_square(forward) + signed_square(upward))
    terms[world, 2] = opening
    terms[world, 3] = wp.min(wp.dot(left, up), 0.0) + wp.min(-wp.dot(right, up), 0.0)
    terms[world, 4] = bonus
    terms[world, 5] = effort
    terms[world, 6] = grip
    terms[world, 7] = led
    terms[world, 8] = wp.where(between, closed, 0.0)
    finite = is_finite(joint_q, joint_qd, action, world)
    total = float(0.0)
    for i in range(TERMS):
        if not finite:
            terms[world, i] = 0.0
        total += weights[i] * terms[world, i]
    reward[world] = total


@wp.func
def flag(yes: bool):
    """Return 1 or 0."""
    return wp.where(yes, 1.0, 0.0)


@wp.func
def half_of_the_way(progress: wp.array2d(dtype=float), world: int, column: int):
    """Return 1 if what `column` of PROGRESS counts was so in half or more of the steps in which the part moved."""
    return flag(2.0 * progress[world, column] >= wp.max(progress[world, MOVED], 1.0))


@wp.func
def follow(
    c: Constants,
    terms: wp.array2d(dtype=float),
    speed: float,
    touch: wp.array2d(dtype=float),
    elsewhere: wp.array2d(dtype=float),
    overflow: wp.array(dtype=int),
    world: int,
    progress: wp.array2d(dtype=float),
):
    """Keep PROGRESS of the running episode."""
    opening = terms[world, OPENING]
    if (overflow[world] & ROW_BITS) != 0:
        progress[world, ROWS] = 1.0
    if (overflow[world] & CONTACT_BITS) != 0:
        progress[world, CONTACTS] = 1.0
    overflow[world] = 0
    if opening >= c.static_opening and wp.abs(speed) <= c.static_speed:
        progress[world, STOOD] = 1.0
    if opening > progress[world, LARGEST]:
        if opening >= 0.1 * c.success_opening and progress[world, LARGEST] < c.success_opening:
            progress[world, MOVED] += 1.0
            progress[world, HELD] += terms[world, GRIP]
            on = wp.max(touch[world, 0], touch[world, 1]) >= c.touch_force
            off = wp.max(elsewhere[world, 0], elsewhere[world, 1]) >= c.touch_force
            progress[world, TOUCHED] += flag(on)
            progress[world, BESIDE] += flag(off and not on)
        progress[world, LARGEST] = opening


@wp.kernel
def tally(
    c: Constants,
    joint_q: wp.array2d(dtype=float),
    joint_qd: wp.array2d(dtype=float),
    action: wp.array2d(dtype=float),
    terms: wp.array2d(dtype=float),
    touch: wp.array2d(dtype=float),
    elsewhere: wp.array2d(dtype=float),
    overflow: wp.array(dtype=int),
    step: wp.array(dtype=int),
    midway: wp.array(dtype=int),
    progress: wp.array2d(dtype=float),
    done: wp.array(dtype=int),
    time_out: wp.array(dtype=int),
    result: wp.array2d(dtype=float),
    counts: wp.array(dtype=float),
):
    """Say which episodes end, and how they went.

    overflow [world] has mujoco_warp's bits since it was last set to zero, which this does.
    progress [world 8] is in the order of PROGRESS, result [world 15] in that of RESULTS, counts in that of COUNTS. What went
    wrong in physics ends the episode, which then is no success. Of one that began `midway` nothing else is counted.
    """
    world = wp.tid()
    opening = terms[world, OPENING]
    speed = joint_qd[world, JOINTS] * c.lever
    follow(c, terms, speed, touch, elsewhere, overflow, world, progress)
    step[world] += 1
    finite = is_finite(joint_q, joint_qd, action, world)
    sound = finite and progress[world, ROWS] == 0.0
    ended = (not sound) or opening > c.end_opening
    late = step[world] >= c.episode_steps - 1  # as in the reference: an episode lasts one step less than its length
    done[world] = wp.where(ended or late, 1, 0)
    time_out[world] = wp.where(late and not ended, 1, 0)
    if ended or late:
        largest = progress[world, LARGEST]
        valid = flag(sound)
        success = valid * flag(largest >= c.success_opening)
        held = half_of_the_way(progress, world, HELD)
        # In the order of RESULTS.
        result[world, 0] = success
        result[world, 1] = valid * flag(opening >= c.success_opening)
        result[world, 2] = success * held
        result[world, 3] = success * (1.0 - held) * half_of_the_way(progress, world, TOUCHED)
        result[world, 4] = success * half_of_the_way(progress, world, BESIDE)
        result[world, 5] = valid * flag(largest >= c.wide_opening)
        result[world, 6] = valid * flag(opening >= c.wide_opening)
        result[world, 7] = valid * progress[world, STOOD]
        result[world, 8] = valid * flag(opening >= c.static_opening and wp.abs(speed) <= c.static_speed)
        result[world, 9] = valid * flag(largest >= c.full_opening)
        result[world, 10] = valid * flag(opening >= c.full_opening)
        result[world, 11] = largest
        result[world, 12] = flag(not finite)
        result[world, 13] = progress[world, ROWS]
        result[world, 14] = progress[world, CONTACTS]
        if midway[world] == 0:
            wp.atomic_add(counts, 0, 1.0)
        for i in range(COLUMNS):
            if midway[world] == 0 or i >= TROUBLE:
                wp.atomic_add(counts, i + 1, result[world, i])
        midway[world] = 0
