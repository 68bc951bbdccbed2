"""Acting, resetting and observing as Warp kernels, one thread a world; s2a.tasks.open_part.metrics has the reward."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import warp as wp

from s2a.robot.model import ARM_JOINTS, JOINTS


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
    wide_opening: float
    static_opening: float
    static_speed: float
    full_opening: float
    episode_steps: int
    touch_distance: float
    touch_force: float
    pyramidal: int  # whether a contact's rows are the edges of a friction pyramid


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
    elsewhere: wp.array2d(dtype=float),
):
    """Clamp the action [world 9], integrate it into the joint targets, forget the last step's contacts.

    One that is no number moves nothing and stays as it is, for the judge to end the episode: a clamp would make it -1.
    """
    world = wp.tid()
    for i in range(JOINTS):
        if not wp.isnan(action[world, i]):
            a = wp.clamp(action[world, i], -1.0, 1.0)
            action[world, i] = a
            speed = wp.where(i < ARM_JOINTS, 1.0, c.finger_speed)
            target_q[world, i] = wp.clamp(target_q[world, i] + speed * c.action_step * a, lower[i], upper[i])
    for finger in range(2):
        touch[world, finger] = 0.0
        elsewhere[world, finger] = 0.0


@wp.kernel
def reset(
    c: Constants,
    scanned: wp.array(dtype=float),
    start: wp.array(dtype=float),
    ahead: wp.array2d(dtype=float),
    ahead_share: float,
    lower: wp.array(dtype=float),
    upper: wp.array(dtype=float),
    done: wp.array(dtype=int),
    rng: wp.array(dtype=wp.uint32),
    joint_q: wp.array2d(dtype=float),
    joint_qd: wp.array2d(dtype=float),
    target_q: wp.array2d(dtype=float),
    step: wp.array(dtype=int),
    progress: wp.array2d(dtype=float),
    lead: wp.array2d(dtype=float),
    world_mask: wp.array(dtype=bool),
    articulation_mask: wp.array2d(dtype=bool),
):
    """Put the worlds whose episode ended back to the start, the robot with noise; mark them in both masks.

    The part and what lies free in the room take the coordinates that they were `scanned` with [coord].

    A share of them starts ahead: half of these on the straight way in joint space from `start` to the first of the joint
    targets `ahead` [step 9], the noise fading, a quarter at any of these targets, a quarter at the last, where the fingers
    close; they stand open at first.
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
            joint_q[world, i] = scanned[i]
        for i in range(joint_qd.shape[1]):
            joint_qd[world, i] = 0.0
        way = float(0.0)
        at = int(0)
        if ahead_share > 0.0:  # the stream of random numbers stays as it was where nothing starts ahead
            if wp.randf(state) < ahead_share:
                way = wp.min(2.0 * wp.randf(state), 1.0)
                at = wp.where(way < 1.0, 0, wp.min(wp.randi(state, 0, 2 * ahead.shape[0]), ahead.shape[0] - 1))
        for i in range(JOINTS):
            noise = (1.0 - way) * wp.randf(state, -c.start_noise, c.start_noise)
            target = wp.clamp(start[i] + way * (ahead[at, i] - start[i]) + noise, lower[i], upper[i])
            target_q[world, i] = target
            joint_q[world, i] = wp.where(way < 1.0 or i < ARM_JOINTS, target, upper[i])
        rng[world] = state
        step[world] = 0
        for i in range(progress.shape[1]):
            progress[world, i] = 0.0
        lead[world, 0] = 0.0
        lead[world, 1] = 0.0


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
