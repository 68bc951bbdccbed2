"""Contact, reward, success as Warp kernels; s2a.task.open_drawer says what the frames and terms are."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import warp as wp

from s2a.sim.franka import JOINTS
from s2a.task.kernels import Constants
from s2a.task.open_drawer import REWARD_TERMS

TERMS = wp.constant(len(REWARD_TERMS))
OPENING = wp.constant(REWARD_TERMS.index("opening"))
GRIP = wp.constant(REWARD_TERMS.index("grip"))


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
):
    """Keep each finger's largest normal force on the annotated grasp region [N], touch [world 2] (left, right).

    One thread a contact. A contact counts where it lies, whatever collider carries it. `geom_kind` is 0 left finger,
    1 right finger, 2 target, -1 anything else. Contacts are those of the last physics step, found where it began.
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
    if wp.mesh_query_point_no_sign(region, local, c.touch_distance).result:
        force = row_force[world, contact_row[contact, 0]]
        if c.pyramidal != 0:  # the edges' forces add up to the normal force
            for i in range(1, contact_row.shape[1]):
                if contact_row[contact, i] >= 0:
                    force += row_force[world, contact_row[contact, i]]
        wp.atomic_max(touch, world, finger, force)


@wp.func
def signed_square(x: float):
    """Return the square of x with x's sign."""
    return wp.sign(x) * x * x


@wp.func
def state_is_finite(joint_q: wp.array2d(dtype=float), joint_qd: wp.array2d(dtype=float), world: int):
    """Return whether the coordinates and velocities of the robot and the part are numbers."""
    finite = bool(True)
    for i in range(JOINTS + 1):
        finite = finite and wp.isfinite(joint_q[world, i]) and wp.isfinite(joint_qd[world, i])
    return finite


@wp.kernel
def give_reward(
    c: Constants,
    weights: wp.array(dtype=float),
    joint_q: wp.array2d(dtype=float),
    joint_qd: wp.array2d(dtype=float),
    body_q: wp.array2d(dtype=wp.transform),
    action: wp.array2d(dtype=float),
    touch: wp.array2d(dtype=float),
    lead: wp.array2d(dtype=float),
    terms: wp.array2d(dtype=float),
    reward: wp.array(dtype=float),
):
    """Compute the reward's terms [world 8] and the reward; all zero where the state is not finite.

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
    finite = state_is_finite(joint_q, joint_qd, world)
    total = float(0.0)
    for i in range(TERMS):
        if not finite:
            terms[world, i] = 0.0
        total += weights[i] * terms[world, i]
    reward[world] = total


@wp.kernel
def tally(
    c: Constants,
    joint_q: wp.array2d(dtype=float),
    joint_qd: wp.array2d(dtype=float),
    terms: wp.array2d(dtype=float),
    step: wp.array(dtype=int),
    progress: wp.array2d(dtype=float),
    done: wp.array(dtype=int),
    time_out: wp.array(dtype=int),
    result: wp.array2d(dtype=float),
    counts: wp.array(dtype=float),
):
    """Say which episodes end, and how they went.

    progress [world 3]: largest opening so far [m], steps in which it grew on the way from 10 % to 100 % of the success
    opening, those of them with both fingers on the grasp region. result [world 5]: of the last finished episode, whether
    it succeeded at any time, at the end, with the handle; largest opening [m]; whether it ended in a state not finite.
    """
    world = wp.tid()
    opening, grip = terms[world, OPENING], terms[world, GRIP]
    if opening > progress[world, 0]:
        if opening >= 0.1 * c.success_opening and progress[world, 0] < c.success_opening:
            progress[world, 1] += 1.0
            progress[world, 2] += grip
        progress[world, 0] = opening

    step[world] += 1
    finite = state_is_finite(joint_q, joint_qd, world)
    ended = (not finite) or opening > c.end_opening
    late = step[world] >= c.episode_steps - 1  # as in the reference: an episode lasts one step less than its length
    done[world] = wp.where(ended or late, 1, 0)
    time_out[world] = wp.where(late and not ended, 1, 0)
    if ended or late:
        success = wp.where(progress[world, 0] >= c.success_opening, 1.0, 0.0)
        result[world, 0] = success
        result[world, 1] = wp.where(opening >= c.success_opening, 1.0, 0.0)
        result[world, 2] = success * wp.where(2.0 * progress[world, 2] >= wp.max(progress[world, 1], 1.0), 1.0, 0.0)
        result[world, 3] = progress[world, 0]
        result[world, 4] = wp.where(finite, 0.0, 1.0)
        wp.atomic_add(counts, 0, 1.0)
        for i in range(5):
            wp.atomic_add(counts, i + 1, result[world, i])
