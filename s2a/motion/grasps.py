"""Grasps of a free object by a parallel gripper: antipodal pairs of points on its collision hulls."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

from s2a.motion.gripper import AROUND, CLEARANCE, FIRM, Contact, gripper_spheres, inside_gripper, opening
from s2a.motion.search import NO_BASE, Misses, Unreachable
from s2a.robot.spec import GripperSpec, RobotSpec
from s2a.robot.tool_path import matrix
from s2a.scene.scene import Mesh
from s2a.scene.usd.sim_scene import SimBody, SimRoom

# Points on the surface that are tried as the first contact; the second number where the first leaves few grasps
SAMPLES = 250, 2000
ROLLS = 12  # Approach directions about each closing axis
# Cosine between closing axis and surface normal down to which a contact holds: 18 degrees,
# half the friction cone of mu 0.7
CONE = 0.95
# [m] How far the object's axis of contact lies behind the tool frame's origin, towards the gripper body
DEPTHS = (0.0, -0.006, 0.012)
# Fraction of the pads over which the surface is looked for; they touch what is flat there and as far as they are wide
PAD = 0.9
ROWS = 5  # Points of the pads in either direction
RIM = 0.002  # [m] Beyond the pads' edges, where nothing should stand out: the arm's error
NEAR = 0.005  # [m] Up to which the surface may lie off the pads to be between them at all
# [m] Of lever arm that weigh as much as a metre of width, and as contact of the whole pads, or a ledge at their edge
TURNING, FULL = 0.1, 0.15
SURFACE = 300  # Points on the surface that must stay out of the gripper


@dataclass(frozen=True)
class ObjectGrasps:
    """Grasps in the object's body frame, the best first."""

    tool: np.ndarray  # poses of the tool frame when the fingers close, shape [grasp 4 4]
    width: np.ndarray  # distance of the pads in the grasp [m], shape [grasp]
    opened: np.ndarray  # distance of the pads before and after [m], shape [grasp]
    score: np.ndarray  # lower is better; roughly metres of lever arm, shape [grasp]

    def __getitem__(self, chosen: Sequence[int] | np.ndarray) -> ObjectGrasps:
        return ObjectGrasps(*(each[chosen] for each in (self.tool, self.width, self.opened, self.score)))


def solids(hulls: Sequence[Mesh]) -> list[np.ndarray]:
    """Return the planes of convex hulls, inside where n.x + d <= 0, shape [plane 4] each."""
    planes = []
    for hull in hulls:
        mesh = trimesh.convex.convex_hull(np.asarray(hull.vertices, float))
        planes.append(np.c_[mesh.face_normals, -(mesh.face_normals * mesh.triangles[:, 0]).sum(axis=1)])
    return planes


def object_grasps(
    hulls: Sequence[Mesh],
    center: np.ndarray,
    gripper: GripperSpec,
    seed: int = 0,
    samples: int = SAMPLES[0],
    contact: Contact = FIRM,
    up: np.ndarray | None = None,
) -> ObjectGrasps:
    """Return the grasps at which both pads meet the surface squarely and the gripper, open as by `opening`, keeps clear.

    Args:
        hulls: the object's collision hulls, in its body frame.
        center: of mass, shape [3], in that frame.
        gripper: which grasps; widths up to its opening less clearance.
        seed: of the points that are sampled.
        samples: how many.
        contact: what the pads must find.
        up: unit vector, shape [3], for closing axes that are level, and the lever arm; None: neither of them.
    """
    planes = solids(hulls)
    mesh = trimesh.util.concatenate([trimesh.convex.convex_hull(np.asarray(h.vertices, float)) for h in hulls])
    points, face = trimesh.sample.sample_surface(mesh, samples, seed=seed)
    normals = mesh.face_normals[face]
    first, axis, width = _pinches(np.asarray(points), normals, planes, gripper.max_opening - 2 * CLEARANCE, up)
    tool = _poses(first + 0.5 * width[:, None] * axis, axis)
    width = np.repeat(width, ROLLS * len(DEPTHS))
    surface = np.asarray(trimesh.sample.sample_surface(mesh, SURFACE, seed=seed)[0])
    free = ~inside_gripper(tool, opening(width, gripper), surface, gripper)
    tool, width = tool[free], width[free]
    held, off, stops = _held(tool, width, planes, gripper, contact.flat)
    good = (held >= contact.held) & (off <= contact.centered)
    if up is not None:
        weight = np.cross(center - tool[:, :3, 3], up)
        good &= np.abs(np.einsum("gi,gi->g", weight, tool[:, :3, 1])) <= contact.lever
    good[good] = ~_in_solid(tool[good], opening(width[good], gripper), planes, gripper, contact.body_gap)
    tool, width, held = tool[good], width[good], held[good]
    ledges = _ledges(tool, width, stops[:, good], planes, gripper, contact.flat)
    # A long lever arm lets the object turn between the pads; wide grasps leave no room for the arm's error.
    away = np.linalg.norm(tool[:, :3, 3] - center, axis=1)
    score = away + TURNING * width + FULL * (1.0 - held + ledges)
    order = np.argsort(score, kind="stable")
    return ObjectGrasps(tool, width, opening(width, gripper), score)[order]


def _pinches(
    points: np.ndarray, normals: np.ndarray, planes: Sequence[np.ndarray], widest: float, up: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return first contacts, closing axes and widths as `_antipodal` does, for several axes at each point [point 3].

    Against the normal there; between that and the normal opposite, as what tapers needs it; and level, since what lies is low,
    and a finger below an inclined axis meets the support.
    """
    own = _antipodal(points, normals, -normals, planes, widest)
    opposite = _normals_at(own[0] + own[2][:, None] * own[1], own[1], planes)
    between = own[1] + opposite
    between /= np.linalg.norm(between, axis=1, keepdims=True)
    pairs = [own, _antipodal(own[0], -own[1], between, planes, widest)]
    if up is not None:
        for at, normal, axis in ((points, normals, -normals), (own[0], -own[1], between)):
            level = axis - (axis @ up)[:, None] * up
            length = np.linalg.norm(level, axis=1)
            flat = length >= CONE
            pairs.append(_antipodal(at[flat], normal[flat], level[flat] / length[flat, None], planes, widest))
    return tuple(np.concatenate(each) for each in zip(*pairs, strict=True))  # type: ignore[return-value]


def _normals_at(points: np.ndarray, axis: np.ndarray, planes: Sequence[np.ndarray]) -> np.ndarray:
    """Return the normals of the hulls' faces nearest to points [point 3], of those that axes [point 3] leave, shape [point 3]."""
    every = np.concatenate([*planes])
    off = np.abs(points @ every[:, :3].T + every[:, 3]) + 1e-3 * (1.0 - axis @ every[:, :3].T)
    return every[off.argmin(axis=1), :3]


def _antipodal(
    points: np.ndarray, normals: np.ndarray, axis: np.ndarray, planes: Sequence[np.ndarray], widest: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return first contacts [pair 3], closing axes into the object [pair 3] and widths [pair] of what can be pinched.

    Each line into the surface at a point ends where the union of the hulls around it does; both normals must face it.
    """
    start, end, back = _chords(points, axis, planes)
    leave = np.zeros(len(points))
    facing = np.zeros(len(points))
    for _ in planes:  # intervals that begin before the current end extend it, one hull further each time
        open_end = (start <= leave[:, None] + 1e-4) & (end > leave[:, None])
        best = np.where(open_end, end, -np.inf).argmax(axis=1)
        grows = open_end.any(axis=1)
        leave[grows] = end[grows, best[grows]]
        facing[grows] = back[grows, best[grows]]
    covered = ((start < -1e-3) & (end > -1e-4)).any(axis=1)  # another hull begins before: no outer surface
    here = -np.einsum("pi,pi->p", axis, normals)
    good = ~covered & (facing >= CONE) & (here >= CONE) & (leave > 1e-3) & (leave <= widest)
    return points[good], axis[good], leave[good]


def _chords(
    points: np.ndarray, axis: np.ndarray, planes: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return where lines enter and leave each hull, and the cosine of line and normal where they leave, [line hull] each."""
    start, end, back = (np.zeros((len(points), len(planes))) for _ in range(3))
    for k, plane in enumerate(planes):
        slope = axis @ plane[:, :3].T
        value = points @ plane[:, :3].T + plane[:, 3]
        with np.errstate(divide="ignore", invalid="ignore"):
            at = -value / slope
        enter = np.where(slope < -1e-9, at, -np.inf).max(axis=1)
        leaves = np.where(slope > 1e-9, at, np.inf)
        exits = leaves.argmin(axis=1)
        out = np.take_along_axis(leaves, exits[:, None], axis=1)[:, 0]
        missed = (enter > out) | ((np.abs(slope) <= 1e-9) & (value > 1e-6)).any(axis=1)
        start[:, k] = np.where(missed, np.inf, enter)
        end[:, k] = np.where(missed, -np.inf, out)
        back[:, k] = np.take_along_axis(slope, exits[:, None], axis=1)[:, 0]
    return start, end, back


def _held(
    tool: np.ndarray, width: np.ndarray, planes: Sequence[np.ndarray], gripper: GripperSpec, flat: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the fraction of the pads' points at which both hold, and how far their middle is from that of the surface there [m].

    The surface may end within the pads, where they hold by what there is of it; where it recedes from them, they do not.

    Args:
        tool: poses of the tool frame [grasp 4 4].
        width: distance of the pads [m], shape [grasp].
        planes: of the hulls.
        flat: up to which the surface may lie off the pads [m].
        gripper: whose pads; they end as far behind the tool frame's origin as its fingertips' boxes do.

    Returns:
        Besides, how far from where they were taken to be the pads stop [m], shape [pad grasp].
    """
    x, _, z = gripper.finger_box
    offsets = [
        (across, along)
        for across in PAD * x / 2 * np.linspace(-1.0, 1.0, ROWS)
        for along in gripper.tip_ahead - z / 2 + PAD * z / 2 * np.linspace(-1.0, 1.0, ROWS)
    ]
    before, behind = _gaps(tool, width, planes, offsets)
    there = (before <= NEAR) & (behind <= NEAR)
    # The pads stop at what stands out most, on either side.
    stops = np.stack([np.where(there, off, np.inf).min(axis=1, initial=NEAR) for off in (before, behind)])
    rest = [off - stop[:, None] for off, stop in zip((before, behind), stops, strict=True)]
    holds = there & (rest[0] <= flat) & (rest[1] <= flat)
    at = np.array(offsets)
    middle, whole = (mask @ at / np.maximum(mask.sum(axis=1), 1)[:, None] for mask in (holds, there))
    return holds.mean(axis=1), np.linalg.norm(middle - whole, axis=1), stops


def _in_solid(
    tool: np.ndarray, opened: np.ndarray, planes: Sequence[np.ndarray], gripper: GripperSpec, body_gap: float
) -> np.ndarray:
    """Return at which tool poses [grasp 4 4] a gripper with its pads `opened` apart [m] reaches into hulls, shape [grasp].

    Or its body comes nearer to them than `body_gap` [m], where that is not 0. Where hulls meet, a finger can lie within one of
    them, none of whose surface is in the finger.
    """
    spheres, inside = gripper_spheres(gripper), np.zeros(len(tool), bool)
    least = np.where((spheres.side == 0) & (body_gap > 0.0), spheres.radii + body_gap, 0.5 * spheres.radii)
    for k in range(0, len(tool), 256):
        centers = spheres.placed(tool[k : k + 256], opened[k : k + 256])
        for plane in planes:
            off = (centers @ plane[:, :3].T + plane[:, 3]).max(axis=2)
            inside[k : k + 256] |= (off < least).any(axis=1)
    return inside


def _ledges(
    tool: np.ndarray,
    width: np.ndarray,
    stops: np.ndarray,
    planes: Sequence[np.ndarray],
    gripper: GripperSpec,
    flat: float,
) -> np.ndarray:
    """Return at which grasps something just beyond the pads' edges stands out over where they stop, shape [grasp], bool.

    A pad that is a little off, or slips, then presses on a ledge from below or from the side, which wedges the object out.
    """
    x, _, z = gripper.finger_box
    sides, middle = (x / 2 + RIM) * np.array([-1.0, 1.0]), gripper.tip_ahead - z / 2
    ends = middle + (z / 2 + RIM) * np.array([-1.0, 1.0])
    offsets = [(across, end) for across in x / 2 * np.linspace(-1.0, 1.0, ROWS) for end in ends]
    offsets += [(side, middle + along) for side in sides for along in z / 2 * np.linspace(-1.0, 1.0, ROWS)]
    gaps = _gaps(tool, width, planes, offsets)
    return np.any([gap.min(axis=1) < stop - flat for gap, stop in zip(gaps, stops, strict=True)], axis=0)


def _gaps(
    tool: np.ndarray, width: np.ndarray, planes: Sequence[np.ndarray], offsets: Sequence[tuple[float, float]]
) -> np.ndarray:
    """Return how far the surface lies off both pads [m], below 0 where it stands out, shape [pad grasp point].

    Args:
        tool: poses of the tool frame [grasp 4 4].
        width: distance of the pads [m], shape [grasp].
        planes: of the hulls.
        offsets: points of the pads along the tool frame's x and z axes [m].
    """
    y, far = tool[:, :3, 1], 1.0
    gaps = np.zeros((2, len(tool), len(offsets)))
    for k, (across, along) in enumerate(offsets):
        points = tool[:, :3, 3] + across * tool[:, :3, 0] + along * tool[:, :3, 2] - far * y
        start, end, _ = _chords(points, y, planes)
        gaps[0, :, k], gaps[1, :, k] = start.min(axis=1) - far + width / 2, far + width / 2 - end.max(axis=1)
    return gaps


def _poses(middle: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Return tool poses [pair * roll * depth, 4 4] that close along axes [pair 3] about their middles [pair 3]."""
    helper = np.where(np.abs(axis[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    side = np.cross(axis, helper)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    angle = 2 * np.pi * np.arange(ROLLS) / ROLLS
    forward = np.cos(angle)[:, None] * side[:, None] + np.sin(angle)[:, None] * np.cross(axis, side)[:, None]
    y = np.broadcast_to(axis[:, None], forward.shape)
    rotation = np.stack([np.cross(y, forward), y, forward], axis=-1)
    poses = np.tile(np.eye(4), (len(axis), ROLLS, len(DEPTHS), 1, 1))
    poses[..., :3, :3] = rotation[:, :, None]
    poses[..., :3, 3] = middle[:, None, None] + np.array(DEPTHS)[:, None] * forward[:, :, None]
    return poses.reshape(-1, 4, 4)


# Spheres compared with the room, and what takes as long, after which no plan for an object is looked for any more: below 30 s,
# the same on every machine; where there is a plan, most take a tenth to a half. And [s] that pass at most
WORK, PATIENCE = 7_000_000, 300.0
DRIVEN = 3 * WORK  # Where the robot drives, with an object from one base to another
# Comparisons of a sphere that take as long as a point that grasps are looked for at, and as a grasp that is found
SAMPLED, FOUND = 500, 60
TILTED = 0.05  # [rad] Steps of the direction that is up in an object, which leans a little on what is not level


class GraspCache:
    """Grasps of one free object by one gripper, computed once for each way up, number of points and contact."""

    def __init__(self, body: SimBody, gripper: GripperSpec, seed: int = 0, work: int | None = None) -> None:
        """Take the object, the gripper, the seed of the points, and the work that plans may take (WORK); the time begins."""
        self._hulls, self._center = [c.mesh for c in body.colliders], np.array(body.mass.center)
        self._gripper, self._seed = gripper, seed
        self._grasps: dict[tuple[object, ...], ObjectGrasps] = {}
        self._work, self._limit, self._begun, self.ended = 0, WORK if work is None else work, time.monotonic(), ""

    def spend(self, work: int = 0) -> bool:
        """Add some work to that for plans with this object; return whether that, or the time, is used up, `ended` says which."""
        self._work += work
        passed = time.monotonic() - self._begun
        if self.ended:
            return True
        if self._work > self._limit:
            checks = f"{self._limit / 1e6:.0f} million collision checks"
            self.ended = f"the search ended after {checks}; give another task.start or task.place"
        elif passed > PATIENCE:
            self.ended = f"the search ended after {PATIENCE:.0f} s on a slow or busy machine; try again"
        return bool(self.ended)

    def __call__(self, samples: int, contact: Contact, up: np.ndarray) -> ObjectGrasps:
        """Return what `object_grasps` does, for `up` to within TILTED; it is a unit vector in the body's frame, shape [3]."""
        key = (samples, contact, *(up / TILTED).round())
        if key not in self._grasps:
            self._grasps[key] = object_grasps(
                self._hulls, self._center, self._gripper, self._seed, samples, contact, up
            )
            self._work += SAMPLED * samples + FOUND * len(self._grasps[key].tool)
        return self._grasps[key]


class Ungraspable(Unreachable):
    """The gripper fits nowhere on the object."""


def refuse_ungraspable(room: SimRoom, target: str, spec: RobotSpec, contact: Contact = FIRM) -> None:
    """Raise Ungraspable where no grasp of a free object with a contact fits a robot's gripper."""
    body = room.free[target]
    up = matrix(np.array([*body.position, *body.orientation]))[2, :3]
    hulls = [c.mesh for c in body.colliders]
    grasps = object_grasps(hulls, np.array(body.mass.center), spec.gripper, 0, SAMPLES[-1], contact, up)
    if not len(grasps.tool):
        points = np.concatenate([hull.vertices for hull in hulls])
        raise ungraspable(target, float(np.ptp(points, axis=0).min()), spec)


def ungraspable(target: str, size: float, spec: RobotSpec) -> Ungraspable:
    """Return what says that a gripper holds an object of this thinnest extent [m] nowhere."""
    return Ungraspable(
        f"{target!r}: grasp: no two opposite faces as wide as the pads fit between the fingers, which open "
        f"{1000 * spec.gripper.max_opening:.0f} mm; the object's thinnest extent is {1000 * size:.0f} mm; choose "
        "a smaller object or another robot="
    )


def failure(target: str, nearest: float, size: float, misses: Misses, spec: RobotSpec, ended: str) -> Unreachable:
    """Return why there is no plan for an object.

    Args:
        target: id of the object.
        nearest: least penetration depth of a grasp [m], inf where there is none.
        size: its thinnest extent [m].
        misses: of what was tried with the grasps that are clear.
        spec: the robot.
        ended: why the search ended before all was tried; empty where it did not.
    """
    if ended and not 0.0 < nearest < math.inf and misses.nearest is NO_BASE:  # few points, or no base, were looked at
        return Unreachable(f"{target!r}: {ended}")
    ended = ended and f" ({ended})"
    if math.isinf(nearest):
        return ungraspable(target, size, spec)
    if nearest > 0.0:
        inside = f"reaches about {max(1000 * nearest, 1):.0f} mm into what is around the object or its place"
        return Unreachable(
            f"{target!r}: grasp: at a clearance of {1000 * AROUND:.0f} mm the gripper {inside}; "
            f"choose a place with more room around it{ended}"
        )
    return Unreachable(f"{target!r} cannot be picked and placed so: {misses.nearest}{ended}")
