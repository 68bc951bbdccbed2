"""What a robot collides with: spheres around its links against surfaces (scanned, or of collision hulls) and each other."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np

from s2a.geometry.mesh_ops import merge
from s2a.geometry.mesh_query import RayMesh, nearest_faces, ray_mesh
from s2a.robot.kinematics import Kinematics, kinematics
from s2a.robot.spec import RobotSpec
from s2a.scene import Mesh

BULGE = 0.02
"""[m] How far the spheres may stand out of the links; between two links twice as much is no collision."""
SLACK = 0.005
"""[m] Accepted penetration of the spheres, which stand out of the links by more."""

Penetration = tuple[float, str]
"""Penetration depth [m] (0: no collision), and with what."""


class Surfaces:
    """Named triangle surfaces; solids are as good as their surfaces, for what moves in small steps."""

    def __init__(self, meshes: Mapping[str, Mesh]) -> None:
        """Build the search tree."""
        whole = merge(list(meshes.values()))
        self._names = list(meshes)
        self._owners = np.repeat(np.arange(len(meshes)), [len(mesh.faces) for mesh in meshes.values()])
        self._tree: RayMesh | None = ray_mesh(whole.vertices, whole.faces) if len(whole.faces) else None

    def penetration(self, centers: np.ndarray, radii: np.ndarray) -> Penetration:
        """Return how deep spheres [sphere 3] of radii [sphere] reach into a surface [m], and its name."""
        if self._tree is None or not len(centers):
            return 0.0, ""
        face, gap = nearest_faces(self._tree, centers, reach=float(radii.max()))
        depth = np.where(face >= 0, radii - gap, 0.0)
        k = int(np.argmax(depth))
        return (float(depth[k]), self._names[self._owners[face[k]]]) if depth[k] > 0.0 else (0.0, "")


class RobotShape:
    """Spheres that cover a robot's links, its fingers fully open; `tools/robot_spheres.py` made them.

    Attributes:
        kin: the robot's kinematics.
        radii: of all spheres [m], shape [sphere].
        moving: which spheres move apart from the base, shape [sphere]: what the first joint carries only turns in the
            column that the base fills.
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
        last = (self._group == self._group.max()) & ~held
        self.wrist, self.wrist_radii = in_tool[last], self.radii[last]
        self._pairs = self._checked_pairs(home)

    def centers(self, q: np.ndarray) -> np.ndarray:
        """Return the centers of all spheres in the base frame [m], shape [pose sphere 3], for arm joints [pose arm]."""
        poses = self.kin.frames(q)[:, self._link]
        return np.einsum("psij,sj->psi", poses[..., :3, :3], self._centers) + poses[..., :3, 3]

    def self_penetration(self, q: np.ndarray) -> Penetration:
        """Return how deep two links reach into each other [m] in any of the poses [pose arm], and which."""
        worst: Penetration = (0.0, "")
        centers = self.centers(q)
        for a, b in self._pairs:
            depth = _deepest(
                centers[:, self._group == a], centers[:, self._group == b], *(self._inner(i) for i in (a, b))
            )
            if depth > worst[0]:
                worst = (depth, f"itself ({self._name(a)} and {self._name(b)})")
        return worst

    @property
    def _group(self) -> np.ndarray:
        """How many arm joints carry each sphere: what no joint moves apart is one body."""
        return self.kin.arm_group[self._link]

    def _inner(self, group: int) -> np.ndarray:
        return np.maximum(self.radii[self._group == group] - BULGE, 0.0)

    def _name(self, group: int) -> str:
        return self.kin.links[int(np.flatnonzero(self.kin.arm_group == group)[0])]

    def _checked_pairs(self, home: np.ndarray) -> list[tuple[int, int]]:
        """Return the pairs of bodies that can collide: not neighbours, and apart in the home pose."""
        groups, centers = np.unique(self._group), self.centers(home)
        pairs = [(int(a), int(b)) for a in groups for b in groups if b > a + 1]
        return [
            (a, b)
            for a, b in pairs
            if _deepest(centers[:, self._group == a], centers[:, self._group == b], self._inner(a), self._inner(b))
            <= 0.0
        ]


@cache
def robot_shape(spec: RobotSpec) -> RobotShape:
    """Return a robot's spheres."""
    return RobotShape(spec)


def _deepest(a: np.ndarray, b: np.ndarray, radii_a: np.ndarray, radii_b: np.ndarray) -> float:
    """Return how deep spheres [pose sphere 3] reach into others in the worst pose [m]; 0 where they are apart."""
    worst = 0.0
    middle_a, middle_b = a.mean(axis=1, keepdims=True), b.mean(axis=1, keepdims=True)
    sizes = (
        np.linalg.norm(one - middle, axis=2) + radii
        for one, middle, radii in ((a, middle_a, radii_a), (b, middle_b, radii_b))
    )
    near = np.linalg.norm(middle_a - middle_b, axis=2)[:, 0] < sum(size.max(axis=1) for size in sizes)
    for one, other in zip(a[near], b[near], strict=True):
        gaps = np.linalg.norm(one[:, None] - other[None], axis=2) - radii_a[:, None] - radii_b[None]
        worst = max(worst, float(-gaps.min()))
    return worst
