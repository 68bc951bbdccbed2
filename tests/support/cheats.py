"""Scripted ways to open the hand-made cabinet's drawer: one grasp, and seven that are none."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import torch
from cabinet import HANDLE, box
from scipy.spatial.transform import Rotation

from s2a.robot.kinematics import kinematics
from s2a.robot.tool_path import follow, matrices
from s2a.sim.simulation import Simulation
from s2a.tasks.env import VecEnv

OPEN, REACH = 0.04, 100
"""Finger position, fully open [m]; control steps from home to the first target."""
PLATE = box((0.74, 0.45, 0.55), (0.006, 0.25, 0.3))
"""A plate that moves with the drawer and stands beside the robot, for links to push from behind."""


def tool_poses(sim: Simulation, offsets: Sequence[np.ndarray], turn: Rotation | None = None) -> np.ndarray:
    """Return tool poses [pose 4 4] at offsets from the grasp point in the grasp frame [m], turned in that frame."""
    frame = Rotation.from_quat(sim.stage.grasp[3:])
    points = HANDLE + frame.apply(np.array(offsets))
    quat = (frame * turn if turn else frame).as_quat()
    return matrices(np.concatenate([points, np.tile(quat, (len(points), 1))], axis=1))


def arm(sim: Simulation, poses: np.ndarray) -> np.ndarray:
    """Return arm joints [pose arm] along tool poses, the path that begins nearest to home."""
    kin = kinematics(sim.robot)
    (paths,) = follow(kin, poses, matrices(sim.stage.base[None]), ik_seeds=96)
    assert len(paths), "the arm cannot follow this script"
    return paths[np.argmin(np.abs(paths[:, 0] - np.array(sim.robot.home)).max(axis=1))]


def spread(path: np.ndarray, steps: int) -> np.ndarray:
    """Return a joint path [pose arm] in evenly many steps, without its first pose."""
    at = np.linspace(0, len(path) - 1, steps + 1)[1:]
    return np.stack([np.interp(at, np.arange(len(path)), column) for column in path.T], axis=1)


def script(joints: np.ndarray, fingers: np.ndarray | float) -> np.ndarray:
    """Return joint targets [step joint] from arm joints and finger positions (one for all steps, or [step])."""
    both = np.broadcast_to(np.asarray(fingers, float), (len(joints),))
    return np.column_stack([joints, both, both])


def line(start: Sequence[float], end: Sequence[float], count: int = 12) -> list[np.ndarray]:
    """Return offsets evenly along a straight line."""
    return list(np.linspace(start, end, count))


def hold_and_pull(sim: Simulation, opened: float, steps: int) -> np.ndarray:
    """Return targets that grasp the bar, close the fingers and pull."""
    poses = tool_poses(sim, [*line((0, 0, -0.1), (0, 0, 0), 8), *line((0, 0, 0), (0, 0, -opened), 20)[1:]])
    joints = arm(sim, poses)
    closing = script(np.tile(joints[7], (30, 1)), np.linspace(OPEN, 0.0, 30))
    return np.concatenate([script(spread(joints[:8], 50), OPEN), closing, script(spread(joints[7:], steps), 0.0)])


def grasp(sim: Simulation) -> np.ndarray:
    """Grasp and pull by 0.3 m."""
    return hold_and_pull(sim, 0.3, 150)


def fling(sim: Simulation) -> np.ndarray:
    """Grasp, creep for 60 mm, then yank and open the fingers."""
    slow = hold_and_pull(sim, 0.06, 130)
    poses = tool_poses(sim, line((0, 0, -0.06), (0, 0, -0.3), 20))
    kin = kinematics(sim.robot)
    q = slow[-1:, :7]
    base = np.linalg.inv(matrices(sim.stage.base[None])[0])
    for pose in poses:
        q, _ = kin.solve((base @ pose)[None], q, iterations=20, damping=1e-4)
    delta = 1.35 * (q[0] - slow[-1, :7])
    yank = slow[-1, :7] + np.linspace(0.0, 1.0, 8)[1:, None] * delta
    return np.concatenate([slow, script(yank, np.where(np.arange(7) < 4, 0.0, OPEN)), script(yank[-1:], OPEN)])


def hook(sim: Simulation, fingers: float, turn: Rotation, behind: float, below: float) -> np.ndarray:
    """Come down behind the bar with tilted fingers, and pull."""
    forward = turn.apply([0.0, 0.0, 1.0])
    at = np.array([0.0, below, behind])
    down, pull = line(at - 0.09 * forward, at), line(at, at + [0.0, 0.0, -0.3], 24)
    joints = arm(sim, tool_poses(sim, [*down, *pull[1:]], turn))
    return script(np.concatenate([spread(joints[:12], 70), spread(joints[11:], 150)]), fingers)


def one_finger(sim: Simulation) -> np.ndarray:
    """Hook the bar with one of the open fingers."""
    tilt = Rotation.from_euler("x", 45, degrees=True)
    normal, along = (
        np.array([0, np.cos(np.pi / 4), np.sin(np.pi / 4)]),
        np.array([0, -np.sin(np.pi / 4), np.cos(np.pi / 4)]),
    )
    corner = np.array([0, 0.010, 0.003])

    def at(distance: float) -> np.ndarray:
        return normal * (normal @ corner + 0.004 - OPEN) + along * (along @ corner + distance)

    path = [*line(at(-0.08), at(0.014)), *line(at(0.014), at(0.014) + [0, 0, -0.3], 24)[1:]]
    joints = arm(sim, tool_poses(sim, path, tilt))
    return script(np.concatenate([spread(joints[:12], 60), spread(joints[11:], 150)]), OPEN)


def two_fingers(sim: Simulation) -> np.ndarray:
    """Hook the bar with both closed fingers side by side."""
    turn = Rotation.from_euler("x", 50, degrees=True) * Rotation.from_euler("z", 90, degrees=True)
    return hook(sim, 0.004, turn, behind=0.0075 + 0.011, below=0.006)


def press(sim: Simulation) -> np.ndarray:
    """Press both tips on the bar's top and drag it by friction."""
    turn = Rotation.from_euler("x", 45, degrees=True) * Rotation.from_euler("z", 90, degrees=True)
    low = np.array([0.0, -0.010, -0.004])
    path = [*line((0, 0.08, -0.004), low), *line(low, low + [0, 0, -0.3], 24)[1:]]
    joints = arm(sim, tool_poses(sim, path, turn))
    return script(np.concatenate([spread(joints[:12], 80), spread(joints[11:], 150)]), 0.01)


def knuckle(sim: Simulation) -> np.ndarray:
    """Press a closed, level fist on the bar from above and drag it by friction."""
    low = np.array([0.0, 0.010, 0.005])
    path = [*line((0, 0.09, -0.095), (0, 0.09, 0.005), 6), *line((0, 0.09, 0.005), low)[1:]]
    joints = arm(sim, tool_poses(sim, [*path, *line(low, low + [0, 0, -0.3], 24)[1:]]))
    return script(np.concatenate([spread(joints[:17], 80), spread(joints[16:], 150)]), 0.0)


def palm(sim: Simulation) -> np.ndarray:
    """Push the plate from behind with the side of the gripper's body."""
    # Forward is +y of the world, the wide side of the gripper lies along x: it reaches 0.1 m ahead of the fingers.
    frame = Rotation.from_quat(sim.stage.grasp[3:])
    turn = frame.inv() * Rotation.from_matrix(np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]], float))
    start = frame.inv().apply(np.array([0.58, 0.30, 0.55]) - HANDLE)
    away = frame.inv().apply([-0.06, -0.16, 0.0])
    path = [*line(start + away, start), *line(start, start + [0, 0, -0.36], 24)[1:]]
    joints = arm(sim, tool_poses(sim, path, turn))
    return script(np.concatenate([spread(joints[:12], 60), spread(joints[11:], 150)]), 0.0)


def elbow(sim: Simulation) -> np.ndarray:
    """Push the plate from behind with the elbow, the forearm folded back."""
    folded = np.array([0.0, 0.9, 0.0, -2.7, 0.0, 1.5, 0.8])
    sweep = np.repeat(folded[None], 2, axis=0)
    sweep[:, 0] = -np.radians([35, 125])
    return script(np.concatenate([sweep[:1], spread(sweep, 240)]), 0.0)


SCRIPTS: dict[str, Callable[[Simulation], np.ndarray]] = {
    "grasp": grasp, "fling": fling, "one_finger": one_finger, "two_fingers": two_fingers, "press": press, "knuckle": knuckle,
}  # fmt: skip
"""Scripts at the handle."""
PUSHES: dict[str, Callable[[Simulation], np.ndarray]] = {"palm": palm, "elbow": elbow}
"""Scripts at the plate."""


def play(env: VecEnv, targets: Sequence[np.ndarray]) -> dict[str, torch.Tensor]:
    """Let each world follow its targets [step joint]; return the results of its one episode by column."""
    length = max(map(len, targets))
    path = torch.tensor(
        np.array([np.concatenate([t, np.repeat(t[-1:], length - len(t), 0)]) for t in targets]), dtype=torch.float32
    )
    env.reset_all()
    for step in range(env.max_episode_length - 1):
        now = env.sim.joint_target_q[:, : env.num_actions]
        goal = now + (path[:, 0] - now) / (REACH - step) if step < REACH else path[:, min(step - REACH, length - 1)]
        env.step((goal - now) / env.action_step)
    return dict(zip(env.columns, env.result.unbind(1), strict=True))
