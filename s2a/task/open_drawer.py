"""Opening an articulated part with a Franka: the decision process, as Warp kernels over worlds.

The formulas are those of IsaacLab 2.3's direct task "Isaac-Franka-Cabinet-Direct-v0" (the one the paper trains with). They
refer to two frames. The hand frame: origin `hand_point` on the arm's last link, z forward, y from the right finger to the
left. The grasp frame: at the mean of the part's grasp region, z into the furniture, y across the region's thin side (the
world's up for a horizontal bar), moving with the part.
"""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
from dataclasses import dataclass

import warp as wp

from s2a.sim.franka import ARM_JOINTS, JOINTS

OBSERVATIONS = 2 * JOINTS + 5
"""Joint positions (scaled to their range) and velocities, hand to grasp point (3, robot base frame), joint, its velocity."""
REWARD_TERMS = ("distance", "rotation", "opening", "finger", "bonus", "action", "grip", "held_opening")
"""Names of the unweighted reward terms, in the order of the kernel's columns. The first six are the reference's; "grip" is 1
while both fingers touch the grasp region, "held_opening" the opening while they do."""
TERMS = wp.constant(len(REWARD_TERMS))
COUNTS = ("episodes", "success", "final_success", "handle_success", "opening", "invalid")
"""What is added up over finished episodes: their number, those that reached the success opening at any time, at the end,
with both fingers on the grasp region; the sum of their largest openings [m]; episodes ended by a value that is not finite."""


@dataclass(frozen=True)
class OpenDrawerConfig:
    """The decision process in numbers; lengths hold for a part whose grasp point travels `full_travel` or more.

    Attributes:
        episode_steps: control steps after which an episode is cut.
        action_scale: speed of a joint target for an action of 1 [rad/s].
        finger_speed: share of it for the fingers.
        velocity_scale: factor of the joint velocities in the observation.
        observation_limit: observations are clamped to +- this.
        start_noise: half range of the uniform noise on the start position [rad, m].
        hand_point: origin of the hand frame in the frame of panda_link7 [m].
        close_distance: where the distance term doubles [m].
        bonus_openings: openings that give a bonus of 1 each [m].
        end_opening: opening that ends the episode [m]; infinite: never.
        success_opening: opening that counts as success [m].
        full_travel: shorter ways scale all openings down in proportion [m].
        touch_distance: how near a contact must be to the annotated region to count as on it [m].
        touch_force: normal force from which a contact counts [N].
    """

    episode_steps: int
    action_scale: float
    finger_speed: float
    velocity_scale: float
    observation_limit: float
    start_noise: float
    hand_point: tuple[float, float, float]
    close_distance: float
    bonus_openings: tuple[float, float, float]
    end_opening: float
    success_opening: float
    full_travel: float
    touch_distance: float
    touch_force: float


@wp.struct
class Constants:
    """What a kernel needs to know that never changes: indices within a world, frames, thresholds."""

    link7: int
    left: int
    right: int
    target: int
    hand: wp.transform  # hand frame in link 7
    grasp: wp.transform  # grasp frame in the target's body
    base: wp.quat  # world from robot base
    lever: float  # way of the grasp point for a unit of the joint's coordinate, signed: positive opens
    action_step: float
    finger_speed: float
    velocity_scale: float
    observation_limit: float
    start_noise: float
    close_distance: float
    bonus: wp.vec3
    end_opening: float
    success_opening: float
    episode_steps: int
    touch_distance: float
    touch_force: float


@wp.kernel
def seed_worlds(seed: int, rng: wp.array(dtype=wp.uint32)):
    """Give every world a random stream of its own."""
    world = wp.tid()
    rng[world] = wp.rand_init(seed, world)


@wp.kernel
def act(
    c: Constants,
    lower: wp.array(dtype=float),
    upper: wp.array(dtype=float),
    action: wp.array2d(dtype=float),
    target_q: wp.array2d(dtype=float),
    touch: wp.array2d(dtype=float),
):
    """Clamp the action [world 9], integrate it into the joint targets, forget the last step's contacts."""
    world = wp.tid()
    for i in range(JOINTS):
        a = wp.clamp(action[world, i], -1.0, 1.0)
        action[world, i] = a
        speed = wp.where(i < ARM_JOINTS, 1.0, c.finger_speed)
        target_q[world, i] = wp.clamp(target_q[world, i] + speed * c.action_step * a, lower[i], upper[i])
    touch[world, 0] = 0.0
    touch[world, 1] = 0.0


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
    1 right finger, 2 target, -1 anything else.
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
        wp.atomic_max(touch, world, finger, row_force[world, contact_row[contact, 0]])


@wp.func
def signed_square(x: float):
    """Return the square of x with x's sign."""
    return wp.sign(x) * x * x


@wp.kernel
def judge(
    c: Constants,
    weights: wp.array(dtype=float),
    joint_q: wp.array2d(dtype=float),
    joint_qd: wp.array2d(dtype=float),
    body_q: wp.array2d(dtype=wp.transform),
    action: wp.array2d(dtype=float),
    touch: wp.array2d(dtype=float),
    step: wp.array(dtype=int),
    progress: wp.array2d(dtype=float),
    terms: wp.array2d(dtype=float),
    reward: wp.array(dtype=float),
    done: wp.array(dtype=int),
    time_out: wp.array(dtype=int),
    result: wp.array2d(dtype=float),
    counts: wp.array(dtype=float),
):
    """Compute the reward's terms [world 8], the reward, whether the episode ends, and its tally.

    progress [world 3]: largest opening so far [m], steps in which it grew on the way from 10 % to 100 % of the success
    opening, those of them with both fingers on the grasp region. result [world 4]: of the last finished episode, whether
    it succeeded at any time, at the end, with the handle; largest opening [m].
    """
    world = wp.tid()
    hand = body_q[world, c.link7] * c.hand
    grasp = body_q[world, c.target] * c.grasp
    point = wp.transform_get_translation(grasp)
    left = wp.transform_get_translation(body_q[world, c.left]) - point
    right = wp.transform_get_translation(body_q[world, c.right]) - point
    up = wp.transform_vector(grasp, wp.vec3(0.0, 1.0, 0.0))
    forward = wp.dot(
        wp.transform_vector(hand, wp.vec3(0.0, 0.0, 1.0)), wp.transform_vector(grasp, wp.vec3(0.0, 0.0, 1.0))
    )
    upward = wp.dot(wp.transform_vector(hand, wp.vec3(0.0, 1.0, 0.0)), up)
    opening = joint_q[world, JOINTS] * c.lever
    d = wp.length(wp.transform_get_translation(hand) - point)
    near = 1.0 / (1.0 + d * d)
    terms[world, 0] = near * near * wp.where(d <= c.close_distance, 2.0, 1.0)
    terms[world, 1] = 0.5 * (signed_square(forward) + signed_square(upward))
    terms[world, 2] = opening
    terms[world, 3] = wp.min(wp.dot(left, up), 0.0) + wp.min(-wp.dot(right, up), 0.0)
    bonus = float(0.0)
    for i in range(3):
        bonus += wp.where(opening > c.bonus[i], 1.0, 0.0)
    terms[world, 4] = bonus
    effort = float(0.0)
    finite = wp.isfinite(joint_q[world, JOINTS]) and wp.isfinite(joint_qd[world, JOINTS])
    for i in range(JOINTS):
        effort += action[world, i] * action[world, i]
        finite = finite and wp.isfinite(joint_q[world, i]) and wp.isfinite(joint_qd[world, i])
    terms[world, 5] = effort
    grip = wp.where(wp.min(touch[world, 0], touch[world, 1]) >= c.touch_force, 1.0, 0.0)
    terms[world, 6] = grip
    terms[world, 7] = grip * opening
    total = float(0.0)
    for i in range(TERMS):
        if not finite:
            terms[world, i] = 0.0
        total += weights[i] * terms[world, i]
    reward[world] = total

    if opening > progress[world, 0]:
        if opening >= 0.1 * c.success_opening and progress[world, 0] < c.success_opening:
            progress[world, 1] += 1.0
            progress[world, 2] += grip
        progress[world, 0] = opening

    step[world] += 1
    ended = (not finite) or opening > c.end_opening
    late = step[world] >= c.episode_steps - 1
    done[world] = wp.where(ended or late, 1, 0)
    time_out[world] = wp.where(late and not ended, 1, 0)
    if ended or late:
        success = wp.where(progress[world, 0] >= c.success_opening, 1.0, 0.0)
        final = wp.where(opening >= c.success_opening, 1.0, 0.0)
        handle = success * wp.where(2.0 * progress[world, 2] >= wp.max(progress[world, 1], 1.0), 1.0, 0.0)
        result[world, 0] = success
        result[world, 1] = final
        result[world, 2] = handle
        result[world, 3] = progress[world, 0]
        wp.atomic_add(counts, 0, 1.0)
        wp.atomic_add(counts, 1, success)
        wp.atomic_add(counts, 2, final)
        wp.atomic_add(counts, 3, handle)
        wp.atomic_add(counts, 4, progress[world, 0])
        wp.atomic_add(counts, 5, wp.where(finite, 0.0, 1.0))


@wp.kernel
def reset(
    c: Constants,
    start: wp.array(dtype=float),
    lower: wp.array(dtype=float),
    upper: wp.array(dtype=float),
    done: wp.array(dtype=int),
    rng: wp.array(dtype=wp.uint32),
    joint_q: wp.array2d(dtype=float),
    joint_qd: wp.array2d(dtype=float),
    target_q: wp.array2d(dtype=float),
    step: wp.array(dtype=int),
    progress: wp.array2d(dtype=float),
    world_mask: wp.array(dtype=bool),
    articulation_mask: wp.array2d(dtype=bool),
):
    """Put the worlds whose episode ended back to the start, with noise; mark them in both masks.

    Targets start at the sampled positions. (The reference leaves them where the last episode ended, which pulls the arm
    away in the first step.)
    """
    world = wp.tid()
    ended = done[world] == 1
    world_mask[world] = ended
    for i in range(articulation_mask.shape[1]):
        articulation_mask[world, i] = ended
    if ended:
        state = rng[world]
        for i in range(joint_q.shape[1]):
            joint_q[world, i] = 0.0
            joint_qd[world, i] = 0.0
        for i in range(JOINTS):
            q = start[i] + wp.randf(state, -c.start_noise, c.start_noise)
            joint_q[world, i] = wp.clamp(q, lower[i], upper[i])
            target_q[world, i] = joint_q[world, i]
        rng[world] = state
        step[world] = 0
        for i in range(3):
            progress[world, i] = 0.0


@wp.kernel
def observe(
    c: Constants,
    lower: wp.array(dtype=float),
    upper: wp.array(dtype=float),
    joint_q: wp.array2d(dtype=float),
    joint_qd: wp.array2d(dtype=float),
    body_q: wp.array2d(dtype=wp.transform),
    observation: wp.array2d(dtype=float),
):
    """Write the observation [world 23], see OBSERVATIONS."""
    world = wp.tid()
    limit = c.observation_limit
    for i in range(JOINTS):
        scaled = 2.0 * (joint_q[world, i] - lower[i]) / (upper[i] - lower[i]) - 1.0
        observation[world, i] = wp.clamp(scaled, -limit, limit)
        observation[world, JOINTS + i] = wp.clamp(c.velocity_scale * joint_qd[world, i], -limit, limit)
    hand = wp.transform_get_translation(body_q[world, c.link7] * c.hand)
    grasp = wp.transform_get_translation(body_q[world, c.target] * c.grasp)
    way = wp.quat_rotate_inv(c.base, grasp - hand)
    for i in range(3):
        observation[world, 2 * JOINTS + i] = wp.clamp(way[i], -limit, limit)
    observation[world, 2 * JOINTS + 3] = wp.clamp(joint_q[world, JOINTS], -limit, limit)
    observation[world, 2 * JOINTS + 4] = wp.clamp(joint_qd[world, JOINTS], -limit, limit)
