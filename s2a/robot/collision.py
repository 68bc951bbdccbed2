"""The collision shape of a robot: spheres around its links, and how deep they reach into each other."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from s2a.robot.kinematics import Kinematics, kinematics
from s2a.robot.spec import RobotSpec

BULGE = 0.02
"""[m] How far the spheres may stand out of the links; between two links twice as much is no collision."""
SLACK = 0.005
"""[m] Accepted penetration of the spheres, which stand out of the links by more."""

TURNS = 16
"""Angles of the first joint at which what it carries must be clear."""

Penetration = tuple[float, str]
"""Penetration depth [m] (0: no collision), and with what."""


class RobotShape:
    """Spheres that cover a robot's links, its fingers fully open; `tools/robot_spheres.py` made them.

    Attributes:
        kin: the robot's kinematics.
        radii: of all spheres [m], shape [sphere].
        moving: which spheres move apart from the base, shape [sphere]: what the first joint carries only turns about its axis.
        shoulder: centers of the spheres that the first joint carries, at TURNS of its angles, in the base frame [m], shape
            [sphere 3]: a motor at its side stands out of the column above the base.
        shoulder_radii: their radii [m], shape [sphere].
        fingers: which belong to the fingers, shape [sphere].
        held: which belong to the fingers or the gripper body, shape [sphere].
        gripper: centers of the spheres of gripper body and fingers in the tool frame [m], shape [sphere 3].
        gripper_radii: their radii [m], shape [sphere].
        wrist: centers of the other spheres that the last joint carries in the tool frame [m], shape [sphere 3].
        wrist_radii: their radii [m], shape [sphere].
    """

    def __init__(self, spec: RobotSpec) -> None:
        """Read the robot's spheres; `robot_shape` keeps one instance per robot."""
        table = np.genfromtxt(Path(__file__).parent / spec.name / "spheres.csv", delimiter=",", dtype=str)[1:]
        self.kin: Kinematics = kinematics(spec)
        self._link = np.array([self.kin.links.index(link) for link in table[:, 0]])
        self._centers, self.radii = table[:, 1:4].astype(float), table[:, 4].astype(float)
        self.moving = self.kin.arm_group[self._link] > 1
        self.fingers = np.isin(table[:, 0], spec.gripper.links)
        self.held = held = self.fingers | (table[:, 0] == spec.gripper.body)
        home = np.array([spec.home])
        in_tool = (self.centers(home)[0] - self.kin.tool(home)[0, :3, 3]) @ self.kin.tool(home)[0, :3, :3]
        self.gripper, self.gripper_radii = in_tool[held], self.radii[held]
        turned = np.repeat(home, TURNS, axis=0)
        turned[:, 0] = np.linspace(self.kin.lower[0], self.kin.upper[0], TURNS)
        first = self._group == 1
        self.shoulder = self.centers(turned)[:, first].reshape(-1, 3)
        self.shoulder_radii = np.tile(self.radii[first], TURNS)
        last = (self._group == self._group.max()) & ~held
        self.wrist, self.wrist_radii = in_tool[last], self.radii[last]
        inner = np.maximum(self.radii - BULGE, 0.0)
        members = {int(k): np.flatnonzero(self._group == k) for k in np.unique(self._group)}
        self._bodies = {k: (chosen, inner[chosen]) for k, chosen in members.items()}
        self._pairs = self._checked_pairs(home)

    def centers(self, q: np.ndarray) -> np.ndarray:
        """Return the centers of all spheres in the base frame [m], shape [pose sphere 3], for arm joints [pose arm]."""
        poses = self.kin.frames(q)[:, self._link]
        return np.einsum("psij,sj->psi", poses[..., :3, :3], self._centers) + poses[..., :3, 3]

    def keeps_clear(self, depth: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Return in which of the poses [pose arm] a depth into other things [m], and that into itself, is no more than SLACK."""
        ok = depth <= SLACK
        ok[ok] = (self._pair_depths(self.centers(q[ok])) <= SLACK).all(axis=0)
        return ok

    def self_penetration(self, q: np.ndarray) -> Penetration:
        """Return how deep two links reach into each other [m] in any of the poses [pose arm], and which."""
        deepest = self._pair_depths(self.centers(q)).max(axis=1)
        a, b = self._pairs[int(deepest.argmax())]
        worst = float(deepest.max())
        return (worst, f"itself ({self._name(a)} and {self._name(b)})") if worst > 0.0 else (0.0, "")

    def _pair_depths(self, centers: np.ndarray) -> np.ndarray:
        """Return how deep the bodies that can collide reach into each other [m], shape [pair pose]."""
        return np.stack([self._depth(centers, *pair) for pair in self._pairs])

    def _depth(self, centers: np.ndarray, a: int, b: int) -> np.ndarray:
        """Return how deep two bodies reach into each other [m], shape [pose]."""
        (one, inner), (other, outer) = self._bodies[a], self._bodies[b]
        return _depth(centers[:, one], centers[:, other], inner, outer)

    @property
    def _group(self) -> np.ndarray:
        """How many arm joints carry each sphere: what no joint moves apart is one body."""
        return self.kin.arm_group[self._link]

    def _name(self, group: int) -> str:
        return self.kin.links[int(np.flatnonzero(self.kin.arm_group == group)[0])]

    def _checked_pairs(self, home: np.ndarray) -> list[tuple[int, int]]:
        """Return the pairs of bodies that can collide: not neighbours, and apart in the home pose."""
        centers = self.centers(home)
        pairs = [(a, b) for a in self._bodies for b in self._bodies if b > a + 1]
        return [pair for pair in pairs if self._depth(centers, *pair)[0] <= 0.0]


@cache
def robot_shape(spec: RobotSpec) -> RobotShape:
    """Return a robot's spheres."""
    return RobotShape(spec)


def _depth(a: np.ndarray, b: np.ndarray, radii_a: np.ndarray, radii_b: np.ndarray) -> np.ndarray:
    """Return how deep spheres [pose sphere 3] reach into others [m], shape [pose]; 0 where they are apart."""
    middle_a, middle_b = a.mean(axis=1, keepdims=True), b.mean(axis=1, keepdims=True)
    sizes = (
        np.linalg.norm(one - middle, axis=2) + radii
        for one, middle, radii in ((a, middle_a, radii_a), (b, middle_b, radii_b))
    )
    near = np.linalg.norm(middle_a - middle_b, axis=2)[:, 0] < sum(size.max(axis=1) for size in sizes)
    a, b = a[near] - middle_a[near], b[near] - middle_a[near]
    # As |a|^2 + |b|^2 - 2 a b, which is a product of matrices: five times as fast as the differences.
    squared = (a**2).sum(axis=2)[:, :, None] + (b**2).sum(axis=2)[:, None] - 2.0 * a @ b.transpose(0, 2, 1)
    depth = np.zeros(len(near))
    depth[near] = (radii_a[:, None] + radii_b - np.sqrt(np.maximum(squared, 0.0))).max(axis=(1, 2), initial=0.0)
    return depth
