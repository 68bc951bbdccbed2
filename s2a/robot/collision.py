"""The collision shape of a robot: spheres around its links, and how deep they reach into each other."""

import xml.etree.ElementTree as ElementTree
from functools import cache
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial import ConvexHull

from s2a.core.cache import recall
from s2a.robot import urdf
from s2a.robot.kinematics import Kinematics, kinematics
from s2a.robot.spec import DriveSpec, RobotSpec

BULGE = 0.02  # [m] How far the spheres may stand out of the links; between two links twice as much is no collision
SLACK = 0.005  # [m] Accepted penetration of the spheres, which stand out of the links by more

TURNS = 16  # Angles of the first joint at which what it carries must be clear

Penetration = tuple[float, str]  # Penetration depth [m] (0: no collision), and with what


class RobotShape:
    """Spheres that cover a robot's links, its fingers fully open.

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
        self.kin: Kinematics = kinematics(spec)
        links, self._centers, self.radii = spheres(spec)
        self._link = np.array([self.kin.links.index(link) for link in links])
        self.moving = self.kin.arm_group[self._link] > 1
        held = np.isin(links, list(urdf.below(urdf.arm(spec), spec.gripper.body)))
        self.held, self.fingers = held, held & (links != spec.gripper.body)
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


FINGER_BULGE = 0.01  # [m] How far the spheres may stand out of a finger, whose room is small
ROUND = 3  # Decimals of the spheres' centers and radii [m]


def spheres(spec: RobotSpec) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return spheres around a robot's links: link of each, shape [sphere], center in its frame [m], [sphere 3], radius [m].

    Those of a robot of this package are a file; others are made of its collision geometry once, and kept in the cache.
    """
    file = Path(__file__).parent / (spec.like or spec.name) / "spheres.csv"
    if file.is_file() and not Path(spec.model).is_absolute():
        table = np.genfromtxt(file, delimiter=",", dtype=str)[1:]
        return table[:, 0], table[:, 1:4].astype(float), table[:, 4].astype(float)
    robot = ElementTree.tostring(urdf.arm(spec), encoding="unicode")
    made = recall("spheres", [robot, *spec.gripper.links, spec.gripper.body], lambda: cover(spec))
    return made["link"], made["center"], made["radius"]


def cover(spec: RobotSpec) -> dict[str, np.ndarray]:
    """Return spheres around the convex hulls of a robot's collision geometry: link, center and radius of each.

    They stand out of the hulls by BULGE at most, out of those of the fingers by FINGER_BULGE.
    """
    fingers = urdf.below(urdf.arm(spec), spec.gripper.body) - {spec.gripper.body}
    links, balls = [], []
    for name, solids in hulls(spec).items():
        for solid in solids:
            around = covering(solid, FINGER_BULGE if name in fingers else BULGE)
            links += [name] * len(around)
            balls += around
    table = np.array(balls).round(ROUND)
    return {"link": np.array(links), "center": table[:, :3], "radius": table[:, 3]}


def hulls(spec: RobotSpec) -> dict[str, list[trimesh.Trimesh]]:
    """Return the convex hulls of every link's collision shapes in the link's frame, a finger's as one."""
    robot = urdf.arm(spec)
    fingers = urdf.below(robot, spec.gripper.body) - {spec.gripper.body}
    solids = {}
    for link in robot.findall("link"):
        name, shapes = str(link.get("name")), [urdf.solid(shape) for shape in link.findall("collision")]
        whole = [trimesh.util.concatenate(shapes)] if name in fingers and shapes else shapes
        solids[name] = [solid.convex_hull for solid in whole]
    return solids


def covering(solid: trimesh.Trimesh, bulge: float) -> list[tuple[float, ...]]:
    """Return few spheres (center and radius) that cover the surface of a convex solid and stand out of it by `bulge` [m] at most.

    Spheres around inner points, taken in turn, where they cover something that is still bare, until 1 % of it is.
    """
    surface = np.concatenate([solid.sample(4000, seed=0), solid.vertices])
    low, high = solid.bounds
    inner = np.random.default_rng(0).uniform(low, high, (20000, 3))
    planes = ConvexHull(solid.vertices).equations
    depth = -(inner @ planes[:, :3].T + planes[:, 3]).max(axis=1)
    middle = solid.vertices.mean(axis=0)
    # the last reach every point: in a slanted rod few others lie
    inner = np.concatenate([inner[depth > 0.0][:6000], middle + 0.98 * (surface - middle)])
    radius = -(inner @ planes[:, :3].T + planes[:, 3]).max(axis=1) + bulge
    bare, enough, balls = surface, 0.01 * len(surface), []
    for center, reach in zip(inner, radius, strict=True):
        if len(bare) <= enough:
            break
        near = np.linalg.norm(center - bare, axis=1) < reach
        if near.any():
            bare = bare[~near]
            balls.append((*map(float, center), float(reach)))
    return balls


@cache
def robot_shape(spec: RobotSpec) -> RobotShape:
    """Return a robot's spheres."""
    return RobotShape(spec)


FREE = 0.02  # [m] Between a base's box and the floor


def base_solids(drive: DriveSpec) -> tuple[trimesh.Trimesh, trimesh.Trimesh]:
    """Return the box of a base, in its own frame, and the column below the arm, in the frame of the arm's root link.

    The lift carries the column, which with the lift down reaches into the box.
    """
    length, width, tall = drive.chassis
    box = trimesh.creation.box((length, width, tall - FREE))
    box.apply_translation((0.0, 0.0, (tall + FREE) / 2))
    down = min(drive.mount[2] - FREE, drive.mount[2] - tall + drive.lift)
    column = trimesh.creation.box((2 * drive.column, 2 * drive.column, down))
    column.apply_translation((0.0, 0.0, -down / 2))
    return box, column


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
