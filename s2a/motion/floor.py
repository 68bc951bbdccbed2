"""Free floor of a room for a base that drives: a costmap of its place and heading, and collision-free paths on it."""

from __future__ import annotations

import copy
import math
from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from s2a.core.errors import InputError
from s2a.robot.collision import robot_shape
from s2a.robot.kinematics import base_coordinates
from s2a.robot.spec import DriveSpec, RobotSpec
from s2a.robot.tool_path import free_motion
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.occupancy import Grid, occupied_layers
from s2a.scene.scene import Mesh
from s2a.scene.usd.sim_scene import SimRoom, in_scene

CELL, LAYER = 0.025, 0.05  # [m] Widths and heights of the cells of the costmap
TOP = 2.0  # [m] Above the floor up to which the room is looked at
STEP = 0.02  # [m] Above the floor: what is lower is driven over
# [m] Of the robot from all else, beside what the cells round up: the first with which it is free where it stands, as what it has
# moved may be nearer
CLEARANCES = 0.02, 0.0, -0.02, -0.03
COARSE, HEADINGS = 3, 24  # Cells and headings between poses whose connection is computed
HOLE = 0.2  # [m] Holes of the scanned floor no wider are floor
LEVEL = 0.1  # [m] Thickness of the layer in which the floor is looked for
BLOCK = 2000  # Poses that are looked at together
HELD = 0.01  # [m] Around the points of what it carries
CHECKS = 40000  # Poses that a search for a path may ask about: they cost a hundredth of an arm's


class FreeFloor:
    """Where on the floor of a room a base can be, and how it gets there.

    Attributes:
        drive: the base.
        height: of the floor [m].
        now: coordinates of the base (x, y, yaw, lift), shape [4].
    """

    def __init__(self, room: SimRoom, spec: RobotSpec, now: np.ndarray | None = None) -> None:
        """Compute the costmap.

        Args:
            room: as it stands now.
            spec: a robot whose base drives, its arm at home.
            now: coordinates of its base; None: where most room is around it.

        Raises:
            InputError: no robot that drives, or no free floor.
        """
        if spec.drive is None:
            raise InputError(f"robot {spec.name!r} has no base that drives")
        self.drive: DriveSpec = spec.drive
        self.height = floor_height(room)
        self._spec = spec
        self._circles, self._spheres = _circles(self.drive), _spheres(spec, np.array(spec.home), np.zeros((0, 3)))
        meshes = _meshes(room)
        low, high = np.min([m.bounds[0] for m in meshes], axis=0), np.max([m.bounds[1] for m in meshes], axis=0)
        shape = tuple(int(n) for n in np.ceil((high - low)[:2] / CELL) + 1)
        self._origin = np.array([*low[:2], self.height])
        grid = Grid(np.eye(3), self._origin, CELL, (shape[0], shape[1]), 0.0, TOP, round(TOP / LAYER))
        ground = replace(grid, bottom=-LEVEL, top=STEP, layers=1)
        floor = ndimage.binary_closing(occupied_layers(meshes, ground)[0][0], iterations=round(HOLE / CELL / 2))
        solid, _ = occupied_layers([_above(mesh, self.height + STEP) for mesh in meshes], grid)
        solid[0] |= ~floor
        # Distance from the centre of each cell to the nearest occupied cell's border in each layer
        self._gaps = np.stack([ndimage.distance_transform_edt(~layer) for layer in solid]) * CELL - 0.5 * CELL
        self._low = self._gaps[: round(self.drive.chassis[2] / LAYER + 0.5)].min(axis=0)
        self._clearance = CLEARANCES[0]
        self.now = np.zeros(4) if now is None else np.asarray(now, float)
        if now is None:
            self.now = self._middle()
        for self._clearance in CLEARANCES:
            if self.free(self.now[None])[0]:
                break

    def loaded(self, now: np.ndarray, arm: np.ndarray, held: np.ndarray) -> FreeFloor:
        """Return the same with the base elsewhere [4], the arm in other joints [arm], and points [point 3] that it carries.

        The points are in the frame of the arm's root link. What is connected, a coarse rejection, stays that of the arm at home:
        it costs seconds, and `path` looks at the route itself.
        """
        _ = self._connected
        other = copy.copy(self)
        other.now, other._spheres = np.asarray(now, float), _spheres(self._spec, arm, held)
        return other

    def free(self, q: np.ndarray) -> np.ndarray:
        """Return at which coordinates (x, y, yaw, lift) [pose 4] the robot, its arm at home, is clear of all, shape [pose]."""
        blocks = np.array_split(q, max(1, math.ceil(len(q) / BLOCK)))
        return np.concatenate([self._free(each) for each in blocks])

    def _free(self, q: np.ndarray) -> np.ndarray:
        """Return what `free` does, of a block: the base first, then what it carries where that is free."""
        centers, radii = self._circles
        i, j, inside = self._cells(q, centers)
        free = (inside & (self._low[i, j] >= radii + self._clearance)).all(axis=1)
        left = np.flatnonzero(free)
        centers, radii = self._spheres
        i, j, ok = self._cells(q[left], centers)
        z, first = centers[:, 2] + q[left, 3:], np.floor((centers[:, 2] + q[left, 3:] - radii) / LAYER).astype(int)
        for step in range(
            int(np.ceil(2.0 * radii.max() / LAYER)) + 1
        ):  # the layers that a sphere passes, how wide in each
            layer = first + step
            off = np.maximum(np.abs((layer + 0.5) * LAYER - z) - 0.5 * LAYER, 0.0)
            wide = np.sqrt(np.maximum(radii**2 - off**2, 0.0))
            there = (off < radii) & (layer >= 0) & (layer < len(self._gaps))
            gap = self._gaps[np.clip(layer, 0, len(self._gaps) - 1), i, j]
            ok &= ~there | (gap >= wide + self._clearance)
        free[left] = ok.all(axis=1)
        return free

    def _cells(self, q: np.ndarray, centers: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return cells of points [point 3] of the base at coordinates [pose 4], and which the costmap has, [pose point] each."""
        cos, sin = np.cos(q[:, 2:3]), np.sin(q[:, 2:3])
        x = q[:, 0:1] + cos * centers[:, 0] - sin * centers[:, 1] - self._origin[0]
        y = q[:, 1:2] + sin * centers[:, 0] + cos * centers[:, 1] - self._origin[1]
        i, j = np.floor(x / CELL).astype(int), np.floor(y / CELL).astype(int)
        rows, columns = self._low.shape
        inside = (i >= 0) & (j >= 0) & (i < rows) & (j < columns)
        return np.clip(i, 0, rows - 1), np.clip(j, 0, columns - 1), inside

    def reachable(self, q: np.ndarray) -> np.ndarray:
        """Return which coordinates [pose 4] are free and connected with where the base is, shape [pose]."""
        ok = self.free(q)
        if ok.any():
            ok[ok] = np.isin(
                self._component(q[ok]), self._component(self.now[None])[self._component(self.now[None]) > 0]
            )
        return ok

    def stands(self, base: np.ndarray, height: float) -> np.ndarray:
        """Return the base's coordinates [4] with the arm's root link at a pose [4 4], so high above the floor [m]."""
        return base_coordinates(self.drive, base, height)

    def path(self, goal: np.ndarray, seed: int = 0) -> np.ndarray | None:
        """Return coordinates [pose 4] from where the base is to a goal [4], clear of all; None: none was found.

        It drives, then lifts the arm; where it is not free to do so, it lifts first.
        """
        if not self.reachable(goal[None])[0]:
            return None
        turn = self.now[2] + (goal[2] - self.now[2] + np.pi) % (2 * np.pi) - np.pi
        goal = np.array([goal[0], goal[1], turn, goal[3]])
        low, high = self._origin[:2], self._origin[:2] + CELL * np.array(self._gaps.shape[1:])
        lower, upper = np.array([*low, self.now[2] - 4 * np.pi]), np.array([*high, self.now[2] + 4 * np.pi])
        for lift in (self.now[3], goal[3]):

            def free(q: np.ndarray, lift: float = lift) -> np.ndarray:
                return self.free(np.c_[q, np.full(len(q), lift)])

            lifts = self._lifted(self.now[:3], self.now[3], lift), self._lifted(goal[:3], lift, goal[3])
            if not all(self.free(each).all() for each in lifts):
                continue
            route = free_motion(self.now[:3], goal[:3], lower, upper, free, seed, CHECKS)
            if route is not None:
                first, last = lifts
                return np.concatenate([first[:-1], np.c_[route, np.full(len(route), lift)], last[1:]])
        return None

    def own_depth(self, centers: np.ndarray, radii: np.ndarray, base: np.ndarray) -> np.ndarray:
        """Return how deep spheres [pose sphere 3] of radii [sphere], scene frame, reach into the robot's own base [m], [pose].

        `base`: pose of the arm's root link, [4 4] or [pose 4 4].
        """
        local = (centers - base[..., None, :3, 3]) @ base[..., :3, :3]
        length, width, tall = self.drive.chassis
        deck = self.height + tall - base[..., None, 2, 3]
        off = np.abs(local[..., :2] + np.array(self.drive.mount[:2])) - np.array([length, width]) / 2
        chassis = np.concatenate([off, (local[..., 2] - deck)[..., None]], axis=-1)
        column = np.concatenate([np.abs(local[..., :2]) - self.drive.column, local[..., 2:]], axis=-1)
        gap = np.minimum(*(_outside(each) for each in (chassis, column)))
        return np.clip(radii - gap, 0.0, None).max(axis=-1, initial=0.0)

    def body(self, base: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return spheres in the box of a base whose arm has its root link at a pose [4 4]: centers [sphere 3], radii [sphere]."""
        circles, radii = self._circles
        heights, flat = np.arange(radii[0], self.drive.chassis[2], LAYER), circles[:, :2] - self.drive.mount[:2]
        centers = np.concatenate([np.c_[flat, np.full(len(flat), height)] for height in heights])
        placed = centers @ base[:3, :3].T + [*base[:2, 3], self.height]
        return placed, np.full(len(placed), radii[0])

    def _lifted(self, place: np.ndarray, start: float, end: float) -> np.ndarray:
        count = 2 + int(abs(end - start) / LAYER)
        return np.c_[np.tile(place, (count, 1)), np.linspace(start, end, count)]

    @cached_property
    def _connected(self) -> np.ndarray:
        """Number of the connected piece of free poses that each coarse pose is in, 0 for one that is not free, [x y heading]."""
        steps = np.ceil(np.array(self._gaps.shape[1:]) / COARSE).astype(int)
        axes = [self._origin[k] + (np.arange(steps[k]) + 0.5) * COARSE * CELL for k in range(2)]
        turns = 2 * np.pi * np.arange(HEADINGS) / HEADINGS
        poses = np.stack(np.meshgrid(*axes, turns, indexing="ij"), axis=-1).reshape(-1, 3)
        return connected(self.free(np.c_[poses, np.full(len(poses), self.now[3])]).reshape(*steps, HEADINGS))

    def _component(self, q: np.ndarray) -> np.ndarray:
        """Return the connected piece that coordinates [pose 4] are in, by the nearest coarse poses; 0: in none, shape [pose]."""
        pieces = self._connected
        at = (q[:, :2] - self._origin[:2]) / (COARSE * CELL) - 0.5
        turn = np.round(q[:, 2] / (2 * np.pi / HEADINGS)).astype(int)
        best = np.zeros(len(q), int)
        for k, (i, j) in enumerate(np.round(at).astype(int)):
            near = pieces[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2][
                ..., np.arange(turn[k] - 1, turn[k] + 2) % HEADINGS
            ]
            some = near[near > 0]
            best[k] = np.bincount(some).argmax() if len(some) else 0
        return best

    def _middle(self) -> np.ndarray:
        """Return the free pose in the largest connected piece that is farthest from all else, the lift down."""
        pieces = self._connected
        counts = np.bincount(pieces.ravel())[1:]
        if not len(counts):
            raise InputError("no floor of the room is free for the robot's base")
        own = np.argwhere(pieces == 1 + int(counts.argmax()))
        gap = self._gaps[: round(1.0 / LAYER), COARSE * own[:, 0], COARSE * own[:, 1]].min(axis=0)
        i, j, turn = own[int(gap.argmax())]
        place = self._origin[:2] + (np.array([i, j]) + 0.5) * COARSE * CELL
        return np.array([*place, 2 * np.pi * turn / HEADINGS, 0.0])


def connected(free: np.ndarray) -> np.ndarray:
    """Return the number of the connected piece of each free pose, 0 for others, shape [x y heading]; headings go around."""
    pieces, count = ndimage.label(np.concatenate([free, free[..., :1]], axis=2))
    first, last = pieces[..., 0].ravel(), pieces[..., -1].ravel()
    same = coo_array((np.ones(len(first)), (first, last)), (count + 1, count + 1))
    numbers: np.ndarray = connected_components(same, directed=False)[1]  # that of 0, the first, is 0
    return numbers[pieces[..., :-1]]


def _outside(off: np.ndarray) -> np.ndarray:
    """Return the distance of points from a box [m], below 0 within it, of how far they are beyond its faces [... 3]."""
    return np.linalg.norm(np.maximum(off, 0.0), axis=-1) + np.minimum(off.max(axis=-1), 0.0)


def floor_height(room: SimRoom) -> float:
    """Return the height of the floor [m]: that below the prepared base poses, else of the level hulls of the structure."""
    prepared = [b.position[2] - b.pedestal for each in room.articulations.values() for b in each.bases.values()]
    if prepared:
        return float(np.quantile(prepared, 0.5, method="lower"))  # of one floor, where there are two
    level = []
    for collider in room.static_colliders:
        size = np.ptp(collider.mesh.vertices, axis=0)
        if collider.structure and size[2] < 0.3 * size[:2].min():
            level.append((float(collider.mesh.vertices[:, 2].max()), float(size[0] * size[1])))
    if not level:
        raise InputError(f"room {room.name!r} has no floor to drive on")
    lowest = min(height for height, _ in level)
    heights, areas = np.array([each for each in level if each[0] < lowest + 0.3]).T
    return float(np.average(heights, weights=areas))


def _meshes(room: SimRoom) -> list[Mesh]:
    """Return all hulls of a room, one mesh a body, scene frame."""
    solids = [Mesh(np.asarray(c.mesh.vertices, np.float32), c.mesh.faces) for c in room.static_colliders]
    for body in (*room.bodies.values(), *room.free.values()):
        solids += [Mesh(in_scene(body, c.mesh).astype(np.float32), c.mesh.faces) for c in body.colliders]
    return [merge(solids[k : k + 64]) for k in range(0, len(solids), 64)]


def _above(mesh: Mesh, height: float) -> Mesh:
    """Return a mesh without the faces that lie below a height [m] whole."""
    return replace(mesh, faces=mesh.faces[mesh.vertices[mesh.faces, 2].max(axis=1) > height])


def _circles(drive: DriveSpec) -> tuple[np.ndarray, np.ndarray]:
    """Return circles that cover a base's box: centers in its frame [circle 3], and radii [m], [circle]."""
    count = np.array([7, 6])
    cell = np.array(drive.chassis[:2]) / count
    flat = (np.stack(np.meshgrid(*map(np.arange, count), indexing="ij"), axis=-1).reshape(-1, 2) + 0.5) * cell
    centers = np.c_[flat - np.array(drive.chassis[:2]) / 2, np.zeros(len(flat))]
    return centers, np.full(len(flat), float(np.linalg.norm(cell) / 2))


def _spheres(spec: RobotSpec, arm: np.ndarray, held: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return spheres that cover what the lift carries, the arm in joints [arm], and points [point 3] that it holds.

    Their centers are in the base's frame, the lift down [sphere 3]; radii [m], [sphere].
    """
    assert spec.drive is not None
    shape, mount, column = robot_shape(spec), np.array(spec.drive.mount), spec.drive.column
    # All of it that can stand above the base; with the lift down, some is within the base.
    down = np.arange(0.0, mount[2] - spec.drive.chassis[2] + spec.drive.lift, column)
    under = np.c_[np.zeros((len(down), 2)), -down]
    centers = np.concatenate([shape.centers(arm[None])[0], under, held]) + mount
    return centers, np.concatenate([shape.radii, np.full(len(down), 2**0.5 * column), np.full(len(held), HELD)])
