"""A robot among obstacles: how deep its arm, its gripper and what it holds reach into them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import KDTree

from s2a.motion.floor import FreeFloor
from s2a.motion.gripper import gripper_spheres
from s2a.motion.obstacles import Obstacles
from s2a.robot.collision import SLACK, Penetration, RobotShape, robot_shape
from s2a.robot.kinematics import Kinematics
from s2a.robot.spec import RobotSpec
from s2a.robot.tool_path import straight
from s2a.scene.articulation import transform
from s2a.scene.scene import Joint

# Joints [pose arm] and by how much all is taken to be thicker [m] -> how deep it reaches into
# obstacles [m], shape [pose]
Depth = Callable[[np.ndarray, float], np.ndarray]
LIFTS = 4  # Positions of a lift that are tried
STARTS = 24  # Starts off home that must be free: a joint that is off by 0.125 rad moves the gripper by 10 cm
HELD_RADIUS = 0.005  # [m] Clearance of the held object's surface


@dataclass(frozen=True)
class Workcell:
    """A robot, wherever its base stands, among obstacles."""

    spec: RobotSpec  # the robot
    obstacles: Obstacles  # what stands around it
    floor: FreeFloor | None = None  # on which its base drives; None: it stands still

    @cached_property
    def shape(self) -> RobotShape:
        """Spheres that cover the robot."""
        return robot_shape(self.spec)

    @property
    def kin(self) -> Kinematics:
        """The arm's kinematics."""
        return self.shape.kin

    def arm_depth(
        self,
        q: np.ndarray,
        base: np.ndarray,
        *,
        fingers: bool = True,
        opened: float | None = None,
        clearance: float = 0.0,
    ) -> np.ndarray:
        """Return how deep the arm in joints [pose arm] reaches into the obstacles [m], shape [pose].

        Args:
            q: joints [pose arm].
            base: pose of the base, [4 4] or [pose 4 4].
            fingers: they count too.
            opened: distance of the pads [m]; None: fully open.
            clearance: by which the arm is taken to be thicker [m].
        """
        chosen, shape = self.shape.moving & ~self.shape.held, self.shape
        gripper = gripper_spheres(self.spec.gripper, fingers)
        pads = None if opened is None else np.full(len(q), opened)
        whole = np.concatenate([shape.centers(q)[:, chosen], gripper.placed(self.kin.tool(q), pads)], axis=1)
        centers = whole @ np.swapaxes(base[..., :3, :3], -1, -2) + base[..., None, :3, 3]
        radii = np.concatenate([shape.radii[chosen], gripper.radii])
        depth = self.obstacles.depth(centers, radii + clearance)
        return depth if self.floor is None else np.maximum(depth, self.floor.own_depth(centers, radii, base))

    def met(
        self, path: np.ndarray, base: np.ndarray, part: MovingPart | None = None, coordinates: np.ndarray | None = None
    ) -> Penetration:
        """Return how deep the arm, its fingers aside, reaches into something on a joint path [pose arm] [m], and into what.

        Args:
            path: joints [pose arm].
            base: pose of the base [4 4].
            part: that it moves; None: none.
            coordinates: of the part at each pose [m or rad], shape [pose].
        """
        depths = {"the room": float(self.arm_depth(path, base, fingers=False).max())}
        if part is not None and coordinates is not None:
            depths["the part that it moves"] = part.arm_depth(self.shape, path, coordinates, base)
        depths["itself"] = self.shape.self_penetration(path)[0]
        worst = max(depths, key=lambda name: depths[name])
        return depths[worst], worst

    def clear_stands(self, poses: np.ndarray, pedestals: np.ndarray) -> np.ndarray:
        """Return at which base poses [base 4 4] column, shoulder, however turned, and arm at home are clear, shape [base]."""
        if not len(poses):
            return np.zeros(0, bool)
        shape, near, body = self.shape, self.obstacles, self.spec.base
        feet = poses[:, 2, 3] - pedestals
        low, high = feet + 0.05 + body.radius, poses[:, 2, 3] + body.shoulder_height
        count = max(2, int(np.ceil(float((high - low).max()) / body.radius)) + 1)
        heights = np.linspace(low, high, count, axis=1)
        columns = np.concatenate([np.repeat(poses[:, None, :2, 3], count, axis=1), heights[..., None]], axis=2)
        free = near.depth(columns, np.full(count, body.radius)) <= 0.0
        around = shape.shoulder @ poses[free][:, :3, :3].transpose(0, 2, 1) + poses[free][:, None, :3, 3]
        free[free] = near.depth(around, shape.shoulder_radii) <= SLACK
        home = np.tile(np.array(self.spec.home), (int(free.sum()), 1))
        free[free] = self.arm_depth(home, poses[free]) <= SLACK
        if self.floor is not None and free.any():
            coordinates = [
                self.floor.stands(pose, height) for pose, height in zip(poses[free], pedestals[free], strict=True)
            ]
            free[free] = self.floor.reachable(np.array(coordinates))
        return free

    @property
    def heights(self) -> Sequence[float] | None:
        """Heights of the arm's root link above the floor that its lift offers [m]; None: it has none."""
        drive = self.floor.drive if self.floor else None
        return None if drive is None else tuple(drive.mount[2] + drive.lift * np.linspace(0.0, 1.0, LIFTS))

    def empty(self, base: np.ndarray, opened: float | None = None, body: np.ndarray | None = None) -> Depth:
        """Return the depth of an arm that holds nothing, also into a body of points [point 3] in the base frame."""
        points = None if body is None else KDTree(body)
        chosen = self.shape.moving

        def depth(q: np.ndarray, more: float) -> np.ndarray:
            into = self.arm_depth(q, base, opened=opened, clearance=more)
            if points is None:
                return into
            gaps, _ = points.query(self.shape.centers(q)[:, chosen])
            return np.maximum(into, (self.shape.radii[chosen] - gaps).max(axis=1))

        return depth

    def holding(self, base: np.ndarray, opened: float, held: np.ndarray, points: np.ndarray) -> Depth:
        """Return the depth of an arm, or of the body that it holds at `held` [4 4] in the tool frame, and HELD_RADIUS around it.

        The body's surface has these points [point 3] in its own frame.
        """

        def depth(q: np.ndarray, more: float) -> np.ndarray:
            into = self.arm_depth(q, base, opened=opened, clearance=more)
            carried = base @ self.kin.tool(q) @ held
            moved = points @ carried[:, :3, :3].transpose(0, 2, 1) + carried[:, None, :3, 3]
            radii = np.full(len(points), HELD_RADIUS + more)
            near = self.obstacles.depth(moved, radii)
            if self.floor is not None:
                near = np.maximum(near, self.floor.own_depth(moved, radii, base))
            return np.maximum(into, np.where(near > 0.0, near + SLACK, 0.0))

        return depth

    def is_free(self, depth: Depth, q: np.ndarray, clearance: float = 0.0) -> np.ndarray:
        """Return in which joints [pose arm] a depth, with `clearance` [m], is SLACK at most, and the arm meets not itself."""
        return self.shape.keeps_clear(depth(q, clearance), q)

    def all_free(self, depth: Depth, q: np.ndarray) -> bool:
        """Return whether all of many joints [pose arm] are free; faster than `is_free`."""
        return bool(depth(q, 0.0).max() <= SLACK) and self.shape.self_penetration(q)[0] <= SLACK


@dataclass(frozen=True)
class MovingPart:
    """The part that a robot moves."""

    joint: Joint  # of the part
    hulls: Obstacles  # of the part alone, at joint zero

    def depth(self, centers: np.ndarray, radii: np.ndarray, coordinates: np.ndarray) -> np.ndarray:
        """Return how deep spheres [pose sphere 3] of radii [sphere] reach into the part at coordinates [pose] [m], [pose]."""
        back = np.stack([np.linalg.inv(transform(self.joint, q)) for q in coordinates])
        return self.hulls.depth(centers @ np.swapaxes(back[:, :3, :3], 1, 2) + back[:, None, :3, 3], radii)

    def arm_depth(self, shape: RobotShape, path: np.ndarray, coordinates: np.ndarray, base: np.ndarray) -> float:
        """Return how deep an arm without its gripper reaches on a path [pose arm] into the part, at coordinates [pose] [m]."""
        chosen = shape.moving & ~shape.held
        back = np.stack([np.linalg.inv(transform(self.joint, q)) @ base for q in coordinates])
        centers = shape.centers(path)[:, chosen] @ np.swapaxes(back[:, :3, :3], 1, 2) + back[:, None, :3, 3]
        return float(self.hulls.depth(centers, shape.radii[chosen]).max())


def noisy_starts(spec: RobotSpec, noise: float, seed: int) -> np.ndarray:
    """Return joints [start arm] at which an episode may begin: home, and up to `noise` [rad] off it."""
    home = np.array(spec.home)
    off = np.random.default_rng(seed).uniform(-noise, noise, (STARTS, len(home)))
    return np.concatenate([home[None], home + off])


def lines(starts: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return joints [pose arm] on the straight lines from starts [start arm] to an end [arm]."""
    return np.concatenate([np.concatenate([start[None], straight(start, end)]) for start in starts])
