"""Kernels of every task: acting, weighted terms, observations, results, the end of an episode and its count."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
from collections.abc import Sequence

import warp as wp
from mujoco_warp import OverflowType

from s2a.tasks.state import Error, State, World, finger_position, sense

wp.set_module_options({"enable_backward": False})  # half the time to compile

ROW_BITS = wp.constant(int(OverflowType.NEFC | OverflowType.NJMAX_NNZ))
CONTACT_BITS = wp.constant(int(OverflowType.BROADPHASE | OverflowType.NARROWPHASE | OverflowType.CCD))


@wp.struct
class Motion:
    """How an action moves the joint targets, and where an episode starts."""

    step: float  # largest change of an arm joint's target in a control step [rad]
    finger_step: float  # that of a finger [m]
    limited: int  # 1 where the controller keeps to velocity and acceleration; then the first two are not used
    coupled: int  # 1 where one motor drives both fingers
    velocity: wp.array(dtype=float)  # velocity of each joint for an action of 1 [rad/s, m/s], shape [joint]
    acceleration: wp.array(dtype=float)  # largest change of it [rad/s^2, m/s^2], shape [joint]
    window: float  # distance of a target from its joint's position at which it stops [rad, m]
    dt: float  # physics time step [s]
    delay: wp.vec2i  # least and greatest number of control steps by which an action comes late
    continues: int  # 1 where an episode begins where the worlds are, and nothing is put back
    home: wp.array(dtype=float)  # joint positions at the start [rad, m], shape [joint]
    leader: wp.array(dtype=int)  # of each joint that mimics another, the index of that one, shape [follower]
    multiplier: wp.array(dtype=float)  # of each, shape [follower]
    noise: float  # half range of the uniform noise on it [rad, m]
    start: wp.array2d(dtype=float)  # coordinates of everything else at the start, shape [world coord]
    part_coord: wp.array(dtype=int)  # index of the part's coordinate, shape [world]
    stage: wp.array(dtype=int)  # index of each world's stage, shape [world]
    demo_targets: wp.array3d(dtype=float)  # joint targets of a demonstration, shape [stage step joint]
    # where the joints and, last, the part then are, shape [stage step joint + 1]
    demo_positions: wp.array3d(dtype=float)
    demo_grasped: wp.array(dtype=int)  # steps of each until the gripper has closed, shape [stage]
    demo_steps: wp.array(dtype=int)  # all its steps, shape [stage]
    demo_fraction: float  # fraction of the episodes that start on it
    moved_fraction: float  # of these, the fraction that starts where the part is already moved


@wp.kernel
def seed_envs(seed: int, rng: wp.array(dtype=wp.uint32)):
    """Give every world a random stream of its own."""
    world = wp.tid()
    rng[world] = wp.rand_init(seed, world)


@wp.func
def _acting(s: State, m: Motion, world: int, joint: int):
    """Return the action that acts now: the last one, or where actions come late an earlier one."""
    if m.delay[1] > 0:
        return s.past[world, s.delay[world], joint]
    return s.action[world, joint]


@wp.kernel
def act(s: State, m: Motion):
    """Clamp the action; move the joint targets by it, or keep the velocities that it asks for where the controller has limits.

    NaN moves nothing and stays as it is, for `finish` to end the episode: a clamp would make it -1. The gripper's motor drives
    both fingers: where the controller has limits, they follow the mean of their actions.
    """
    world = wp.tid()
    for i in range(s.joints):
        if not wp.isnan(s.action[world, i]):
            s.action[world, i] = wp.clamp(s.action[world, i], -1.0, 1.0)
    if m.delay[1] > 0:
        for k in range(m.delay[1], -1, -1):
            for i in range(s.joints):
                s.past[world, k, i] = s.action[world, i]
                if k > 0:
                    s.past[world, k, i] = s.past[world, k - 1, i]
    for i in range(s.joints):
        a = _acting(s, m, world, i)
        if m.limited == 1:
            if i >= s.arm:
                a = 0.5 * (_acting(s, m, world, s.arm) + _acting(s, m, world, s.arm + 1))
            s.requested_qd[world, i] = sense(s, world, i) * wp.where(wp.isnan(a), 0.0, a) * m.velocity[i]
        elif not wp.isnan(a):
            target = s.target_q[world, i] + wp.where(i < s.arm, m.step, m.finger_step) * sense(s, world, i) * a
            s.target_q[world, i] = wp.clamp(target, s.lower[i], s.upper[i])


@wp.kernel
def move_targets(s: State, m: Motion, joint_q: wp.array2d(dtype=float)):
    """Move the targets for a physics step: velocities change no faster than the limits, and vanish before the joint limits.

    A target also stops a window ahead of its joint, which something may hold, and returns where the joint is pushed back: never
    faster than the limits, so that it can be ahead by the braking distance more.

    `joint_q`: coordinates before the step, shape [world coord].
    """
    world = wp.tid()
    for i in range(s.joints):
        q, target, a = joint_q[world, i], s.target_q[world, i], m.acceleration[i]
        above = wp.min(s.upper[i], q + m.window) - target
        below = target - wp.max(s.lower[i], q - m.window)
        # From a velocity v the target stops within v^2 / 2a.
        fastest = wp.sign(above) * wp.sqrt(2.0 * a * wp.abs(above))
        slowest = -wp.sign(below) * wp.sqrt(2.0 * a * wp.abs(below))
        wanted = wp.clamp(wp.clamp(s.requested_qd[world, i], slowest, fastest), -m.velocity[i], m.velocity[i])
        now = s.target_qd[world, i]
        v = now + wp.clamp(wanted - now, -a * m.dt, a * m.dt)
        moved = wp.clamp(target + v * m.dt, s.lower[i], s.upper[i])
        s.target_qd[world, i] = (moved - target) / m.dt
        s.target_q[world, i] = moved


@wp.kernel
def accumulate_overflow(now: wp.array(dtype=int), s: State):
    """Add the overflow bits of a physics step to those of the control step."""
    world = wp.tid()
    s.overflow[world] = s.overflow[world] | now[world]


@wp.func
def is_finite(s: State, world: int):
    """Return whether the action and all coordinates and velocities of a world are finite."""
    finite = bool(True)
    for i in range(s.action.shape[1]):
        finite = finite and wp.isfinite(s.action[world, i])
    for i in range(s.joint_q.shape[1]):
        finite = finite and wp.isfinite(s.joint_q[world, i])
    for i in range(s.joint_qd.shape[1]):
        finite = finite and wp.isfinite(s.joint_qd[world, i])
    return finite


def reward_kernel(terms: Sequence[wp.Function]) -> wp.Kernel:
    """Return the kernel that writes each term and their weighted sum; all zero where the state is not finite.

    `terms`: functions (state, world struct, world) -> float, a column of `State.terms` each.
    """

    @wp.kernel(module="unique", module_options={"max_unroll": len(terms), "enable_backward": False})
    def compute_reward(s: State, w: World, weights: wp.array(dtype=float)):
        world = wp.tid()
        finite = is_finite(s, world)
        total = float(0.0)
        for i in range(wp.static(len(terms))):
            value = wp.static(terms[i])(s, w, world)
            s.terms[world, i] = wp.where(finite, value, 0.0)
            total += weights[i] * value
        s.reward[world] = wp.where(finite, total, 0.0)

    return compute_reward


def result_kernel(terms: Sequence[wp.Function]) -> wp.Kernel:
    """Return the kernel that writes each result of the worlds whose episode ended, a column of `State.result` each."""

    @wp.kernel(module="unique", module_options={"max_unroll": len(terms), "enable_backward": False})
    def write_result(s: State, w: World):
        world = wp.tid()
        if s.done[world] == 1:
            for i in range(wp.static(len(terms))):
                s.result[world, i] = wp.static(terms[i])(s, w, world)

    return write_result


def observation_kernel(
    numbers: Sequence[tuple[wp.Function, int]],
    vectors: Sequence[tuple[wp.Function, int]],
    of_joints: Sequence[tuple[wp.Function, int]],
) -> wp.Kernel:
    """Return the kernel (state, world struct, out, limit) that writes terms with their first columns into out [world column].

    Where the limit is positive, every number is clamped to +- it.

    Args:
        numbers: terms (state, world struct, world) -> float.
        vectors: terms that return a wp.vec3.
        of_joints: terms (state, world struct, world, joint) -> float, a column a joint.
    """
    most = max(1, len(numbers), len(vectors), len(of_joints))

    @wp.kernel(module="unique", module_options={"max_unroll": most, "enable_backward": False})
    def observe(s: State, w: World, out: wp.array2d(dtype=float), limit: float):
        world = wp.tid()
        for i in range(wp.static(len(of_joints))):
            for joint in range(s.joints):
                value = wp.static(of_joints[i][0])(s, w, world, joint)
                out[world, wp.static(of_joints[i][1]) + joint] = clamped(value, limit)
        for i in range(wp.static(len(vectors))):
            vector = wp.static(vectors[i][0])(s, w, world)
            out[world, wp.static(vectors[i][1])] = clamped(vector[0], limit)
            out[world, wp.static(vectors[i][1]) + 1] = clamped(vector[1], limit)
            out[world, wp.static(vectors[i][1]) + 2] = clamped(vector[2], limit)
        for i in range(wp.static(len(numbers))):
            number = wp.static(numbers[i][0])(s, w, world)
            out[world, wp.static(numbers[i][1])] = clamped(number, limit)

    return observe


@wp.func
def clamped(value: float, limit: float):
    """Return a value clamped to +- a limit; as it is where the limit is 0."""
    if limit > 0.0:
        return wp.clamp(value, -limit, limit)
    return value


@wp.kernel
def finish(s: State, episode_steps: int):
    """Count the step, and find the worlds whose episode ends: by the task, by its length, or because physics failed."""
    world = wp.tid()
    if (s.overflow[world] & ROW_BITS) != 0:
        s.dropped[world, 0] = 1
    if (s.overflow[world] & CONTACT_BITS) != 0:
        s.dropped[world, 1] = 1
    s.overflow[world] = 0
    s.step[world] += 1
    finite = is_finite(s, world)
    sound = finite and s.dropped[world, 0] == 0
    ended = (not sound) or s.terminated[world] == 1
    late = s.step[world] >= episode_steps - 1  # as in the reference: an episode lasts one step less than its length
    s.done[world] = wp.where(ended or late, 1, 0)
    s.time_out[world] = wp.where(late and not ended, 1, 0)
    s.result[world, s.errors + Error.invalid] = wp.where(finite, 0.0, 1.0)
    s.result[world, s.errors + Error.row_overflow] = float(s.dropped[world, 0])
    s.result[world, s.errors + Error.contact_overflow] = float(s.dropped[world, 1])


@wp.kernel
def count(s: State):
    """Add finished episodes to the counts; of an uncounted one nothing but the errors."""
    world = wp.tid()
    if s.done[world] == 1:
        counted = s.uncounted[world] == 0
        if counted:
            wp.atomic_add(s.counts, 0, 1.0)
        for i in range(s.result.shape[1]):
            if counted or i >= s.errors:
                wp.atomic_add(s.counts, i + 1, s.result[world, i])
        s.uncounted[world] = 0


@wp.kernel
def reset(s: State, m: Motion, world_mask: wp.array(dtype=bool), articulation_mask: wp.array2d(dtype=bool)):
    """Put the worlds whose episode ended back to the start, the robot with noise; mark them in both masks.

    Everything else takes the coordinates that the task starts with. A fraction of the worlds starts on a demonstration; of
    these moved_fraction where the part is already moved. Of the others half start on the straight path in joint space from home
    to its first targets, the noise fading, a quarter at any step until the grasp, a quarter at the last of them, where the
    fingers close. Targets start at the sampled positions. (The reference leaves them where the last episode ended, which pulls
    the arm away in the first step.)

    Where episodes continue, robot and room stay as they are.
    """
    world = wp.tid()
    ended = s.done[world] == 1
    world_mask[world] = ended
    for i in range(articulation_mask.shape[1]):
        articulation_mask[world, i] = ended
    if ended:
        rng = s.rng[world]
        if m.continues == 0:
            for i in range(s.joint_q.shape[1]):
                s.joint_q[world, i] = m.start[world, i]
            for i in range(s.joint_qd.shape[1]):
                s.joint_qd[world, i] = 0.0
        near = float(0.0)
        at, stage = int(0), m.stage[world]
        if m.demo_fraction > 0.0:  # the stream of random numbers stays as it is where nothing starts on a demonstration
            if wp.randf(rng) < m.demo_fraction:
                moved, grasped = bool(False), m.demo_grasped[stage]
                if m.moved_fraction > 0.0:
                    moved = wp.randf(rng) < m.moved_fraction
                if moved:
                    near, at = 1.0, wp.randi(rng, grasped, m.demo_steps[stage])
                    s.joint_q[world, m.part_coord[world]] = m.demo_positions[stage, at, s.joints]
                    s.uncounted[world] = 1
                else:
                    near = wp.min(2.0 * wp.randf(rng), 1.0)
                    at = wp.where(near < 1.0, 0, wp.min(wp.randi(rng, 0, 2 * grasped), grasped - 1))
        for i in range(wp.where(m.continues == 1, 0, s.joints)):
            noise = (1.0 - near) * wp.randf(rng, -m.noise, m.noise)
            led = m.demo_targets[stage, at, i]
            home = finger_position(s, world, i, m.home[i])
            target = wp.clamp(home + near * (led - home) + noise, s.lower[i], s.upper[i])
            if m.coupled == 1 and i > s.arm:  # the fingers stand alike
                target = s.target_q[world, s.arm]
            s.target_q[world, i] = target
            s.target_qd[world, i] = 0.0
            s.joint_q[world, i] = wp.where(near < 1.0 or i < s.arm, target, m.demo_positions[stage, at, i])
        for k in range(wp.where(m.continues == 1, 0, m.leader.shape[0])):
            s.joint_q[world, s.joints + k] = m.multiplier[k] * s.joint_q[world, m.leader[k]]
        if m.delay[1] > 0:
            s.delay[world] = wp.randi(rng, m.delay[0], m.delay[1] + 1)
            for k in range(s.past.shape[1]):
                for i in range(s.joints):
                    s.past[world, k, i] = 0.0
        s.rng[world] = rng
        s.step[world] = 0
        s.begun[world] = wp.where(near < 1.0, -1, at)
        s.terminated[world] = 0
        s.dropped[world, 0] = 0
        s.dropped[world, 1] = 0
