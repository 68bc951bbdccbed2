"""Evidence of the scanned surface in a sim.usd about its joints, grasps, colliders and base poses."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from s2a import robot
from s2a.core.bounds import Fraction, Positive
from s2a.core.check import Check, Status, Suite, at_most, no_problems
from s2a.robot.spec import RobotSpec
from s2a.scan.evidence import Bounds
from s2a.scan.evidence.annotation import moving_part, room_checks
from s2a.scan.evidence.front import Front, front
from s2a.scan.evidence.surface import HOLE_REACH, SIDES, FloorConfig, ScanSurface, floor_support
from s2a.scene.geometry.mesh_ops import centroids, keep, merge, normals, sample, sample_with_faces
from s2a.scene.geometry.mesh_query import RayMesh, first_hits, nearest_faces, ray_mesh
from s2a.scene.scene import Joint, Mesh, Part, Scene
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import PREPARE_AGAIN, Articulation, Base, Grasp, SimRoom, in_scene
from s2a.scene.usd.stage import ROOT

ROUND = 1.5  # A region whose extents differ by less than this factor can be held any way round
INWARD = -0.5  # Of `_facing`: 16 pockets in three virtual scans have -1.0 to -0.9, 36 handles before a front 0.07 to 1
SIDE = 0.5  # Of a normal, across the approach, from which on its face is a side of the region
ON_SURFACE = 0.005  # [m] A region lies no farther from its body's surface, of which it is a part


def grasp_frame(path: str, grasp: Grasp, surface: Mesh, max_distance: float, max_opening: float) -> list[Check]:
    """Return the checks of a grasp.

    Args:
        path: of the part's prim.
        grasp: of the part.
        surface: of its body, as scanned.
        max_distance: how far the grasp point may lie from the region [m]; a ring's middle is in the air.
        max_opening: of the gripper [m].
    """
    region = grasp.region
    tree = ray_mesh(region.vertices, region.faces)
    away = float(nearest_faces(tree, np.array([grasp.point]), 10.0)[1][0])
    gap = nearest_faces(ray_mesh(surface.vertices, surface.faces), region.vertices, 10.0)[1]
    apart = float(np.quantile(gap, 0.95, method="lower"))
    along = (sample(region, 5000, seed=0) - np.array(grasp.point)) @ Rotation.from_quat(grasp.orientation).as_matrix()
    low, high = np.quantile(along, [0.02, 0.98], axis=0)
    length, thickness, _ = high - low
    checks = []
    if grasp.internal:
        checks.append(
            at_most(
                "grasp_internal",
                _facing(grasp),
                INWARD,
                "",
                prim=f"{path}/grasp",
                message="how far the region's sides face away from each other; a pocket's face each other",
                remedy="hold a handle that stands out from outside; " + PREPARE_AGAIN,
            )
        )
    wide = not grasp.internal and max(thickness, length) > max_opening
    ratio = float(thickness / max(length, 1e-6)) if wide else 0.0
    return [
        *checks,
        at_most(
            "grasp_on_region", away, max_distance, "m", prim=f"{path}/grasp", message="from the grasp point to the region",
            remedy="annotate the side of the handle that is to be grasped: the middle of a ring is in the air",
        ),
        at_most(
            "region_on_part", apart, ON_SURFACE, "m", prim=f"{path}/region", message="from the region to its part's surface",
            remedy=PREPARE_AGAIN,
        ),
        at_most(
            "grasp_roll", ratio, ROUND, "", prim=f"{path}/grasp",
            message=f"thickness {1000 * thickness:.0f} mm by length {1000 * length:.0f} mm of the region",
            remedy="close the fingers across the thin side; " + PREPARE_AGAIN,
        ),
    ]  # fmt: skip


def _facing(grasp: Grasp) -> float:
    """Return whether a region's sides face away from its middle (1), as a bar's, or towards it (-1), as a pocket's."""
    across = Rotation.from_quat(grasp.orientation).as_matrix()[:, :2]
    middle, areas = centroids(grasp.region), grasp.region.face_areas
    away = (middle - np.average(middle, axis=0, weights=areas)) @ across
    sides = normals(grasp.region) @ across
    sides[np.linalg.norm(sides, axis=1) < SIDE] = 0.0  # floors and faces that look at the gripper
    moment = areas * np.einsum("ij,ij->i", sides, away)
    return float(moment.sum() / max(np.abs(moment).sum(), 1e-12))


RAYS = 32  # Directions around the base's axis in which what stands there is looked for


@dataclass(frozen=True)
class BaseCheckConfig:
    """Bounds on where a robot stands."""

    floor: FloorConfig = FloorConfig()  # when it stands on scanned floor
    max_turn: Positive = 1.2  # how far the base may look past the grasp point [rad]. The first joint does the rest
    height: Positive = 0.6  # of the column above the base that must be free [m]


def robot_base(
    path: str, base: Base, point: np.ndarray, surface: RayMesh, robot: RobotSpec, config: BaseCheckConfig
) -> list[Check]:
    """Return the checks of a base pose. `point`: grasp point [m], scene coordinates, shape [3]."""
    problems = []
    if not base.free:
        problems.append((path, f"no base pose is free; nearest one: {base.reason}"))
    place = np.array(base.position)
    ahead = Rotation.from_quat(base.orientation).apply([1.0, 0.0, 0.0])[:2]
    to = (point - place)[:2]
    turn = float(np.arccos(np.clip(ahead @ to / max(np.linalg.norm(ahead) * np.linalg.norm(to), 1e-9), -1.0, 1.0)))
    if turn > config.max_turn:
        problems.append((path, f"it looks {np.degrees(turn):.0f} degrees past the grasp point"))
    away = float(np.linalg.norm(point - place - [0.0, 0.0, robot.base.shoulder_height]))
    reach = robot.base.reach + robot.tool_offset[2]
    if away > reach:
        problems.append((path, f"the grasp point is {away:.2f} m from the shoulder, the arm reaches {reach:.2f} m"))
    hit = obstacle(place, base, surface, config)
    if np.isfinite(hit):
        problems.append(
            (path, f"a scanned surface lies {hit:.2f} m from the base's axis, within its radius of {base.radius:g} m")
        )
    return [
        no_problems("base_pose", problems, "let prepare search another place, or correct the joint", prim=path),
        _on_floor(path, base, surface, config.floor),
    ]


def _on_floor(path: str, base: Base, surface: RayMesh, config: FloorConfig) -> Check:
    """Ask for the floor below a base; where the scan has a mere hole it is a measurement without a bound."""
    floor = floor_support(np.array(base.position), base.pedestal, base.radius, surface, config)
    message = "of the footprint has no scanned floor below"
    if floor.assumed:
        message += (
            f"; it is assumed: floor at this height is seen on {floor.sides} of {SIDES} sides within {HOLE_REACH:g} m"
        )
        remedy = "make sure that no step and no stairs are there"
        return Check("base_on_floor", "info", 1.0 - floor.fraction, prim=path, message=message, remedy=remedy)
    remedy = "stand where the floor was scanned; " + PREPARE_AGAIN
    bound = 1.0 - config.min_fraction
    return at_most("base_on_floor", 1.0 - floor.fraction, bound, prim=path, message=message, remedy=remedy)


def obstacle(place: np.ndarray, base: Base, surface: RayMesh, config: BaseCheckConfig) -> float:
    """Return the distance of the nearest scanned surface from the axis of the base's column [m]; inf where it is free."""
    angle = np.arange(RAYS) * 2.0 * np.pi / RAYS
    level = np.linspace(0.1, config.height, 6)
    ways = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    starts = np.repeat(place + level[:, None] * [0.0, 0.0, 1.0], len(ways), axis=0)
    distance = float(first_hits(surface, starts, np.tile(ways, (len(level), 1))).min())
    return distance if distance < base.radius else np.inf


# Samples of a body's surface, and of the room's, of which only the nearest are asked
POINTS, ROOM_POINTS = 4000, 100_000
# Smallest fraction of a surface's area, by the squared cosine of its normals, that tells of a shift along a
# direction; of the small surface of a handle, whose ends are scanned
SEEN, SEEN_HANDLE = 0.15, 0.05
FACING = 0.8  # Cosine from which a hull's face stands for a scanned one: the other side of a thin sheet does not


@dataclass(frozen=True)
class FidelityConfig:
    """Bounds on the distance between colliders and scanned surface."""

    # a point of the surface is covered where a collider is this near [m]. Hulls of a scan miss it by 5 mm at
    # most, and a front is 20 mm thick
    cover: Positive = 0.02
    max_uncovered: Fraction = 0.1  # fraction of a body's surface that may be uncovered. Right stages: up to 0.04
    # the same for what is fixed around the part, whose colliders are cut for the gripper and the path. Corridors
    # of hand and path are cut: up to 0.21
    max_uncovered_room: Fraction = 0.4
    around: Positive = 0.8  # how far from the grasp point the room is asked [m]. What the arm can touch beside the part
    # how far a collider may reach from its body's surface [m]. Fronts are closed 20 mm behind their scanned side:
    # up to 0.061
    max_excess: Positive = 0.08
    # how far a body's colliders may be shifted against its surface [m]. Right stages: up to 0.004
    max_shift: Positive = 0.005


def scanned(room: SimRoom, body: str) -> Mesh:
    """Return the surface of a body as it was scanned, without what was added to it, in scene coordinates."""
    visual, added = room.bodies[body].visual, room.bodies[body].completed
    return keep(visual, np.arange(len(visual.faces) - added))


def collider_fidelity(room: SimRoom, part: str, config: FidelityConfig) -> list[Check]:
    """Return the checks of a part's colliders, of what carries it, and of the room around it. `room`: with visuals."""
    checks = []
    for body in (part, *room.carriers(part)):
        surface = scanned(room, body)
        hulls = [collider.mesh for collider in room.bodies[body].colliders]
        path = f"/scene/{body}"
        if surface.face_areas.sum() <= 1e-4:
            if body == part:
                message = "nothing of it was scanned: its joint and colliders cannot be checked"
                checks.append(Check("cover_part", "fail", prim=path, message=message, remedy=PREPARE_AGAIN))
            continue  # an anchor, which nobody can see
        bound = config.max_uncovered if body == part else config.max_uncovered_room
        checks.append(_cover(f"cover_{'part' if body == part else 'cabinet'}", path, surface, hulls, bound, config))
        if body == part:  # what carries it has walls that nobody sees
            checks.append(_excess(path, room.bodies[body].visual, hulls, config))
            checks.append(_shifted("collider_shift", path, shift(surface, hulls), config))
            moved = shift(room.articulations[part].grasp.region, hulls, SEEN_HANDLE)
            checks.append(_shifted("handle_shift", f"{path}/region", moved, config))
    return [*checks, _room(room, part, config)]


def uncovered(points: np.ndarray, hulls: Sequence[Mesh], cover: float) -> float:
    """Return the fraction of points [point 3] that are farther than `cover` [m] from every hull and inside of none."""
    if not hulls:
        return 1.0
    whole = merge(list(hulls))
    near = nearest_faces(ray_mesh(whole.vertices, whole.faces), points, cover)[0] >= 0
    left = points[~near]
    inside = np.zeros(len(left), bool)
    for hull in hulls:
        low, high = hull.bounds
        box = ((left > low) & (left < high)).all(axis=1)
        if box.any():
            normal, corner = normals(hull), hull.vertices[hull.faces[:, 0]].astype(float)
            inside[box] |= ((left[box] @ normal.T - np.einsum("ij,ij->i", normal, corner)) < 0.0).all(axis=1)
    return float((~inside).sum() / len(points))


def excess(surface: Mesh, hulls: Sequence[Mesh]) -> tuple[float, int]:
    """Return how far the corners of hulls reach from a surface at most [m], and the index of that hull."""
    tree = ray_mesh(surface.vertices, surface.faces)
    far = [float(nearest_faces(tree, hull.vertices, 10.0)[1].max()) for hull in hulls]
    return (max(far), int(np.argmax(far))) if far else (0.0, 0)


def shift(surface: Mesh, hulls: Sequence[Mesh], seen: float = SEEN, reach: float = 0.03) -> float:
    """Return how far hulls are shifted against a surface [m], least squares over its normals.

    Point-to-plane alignment (Chen and Medioni 1992) by one translation; directions that fewer than `seen` of the surface tell of
    count as not shifted.

    `reach`: points farther from every hull tell nothing [m].
    """
    if not hulls:
        return 0.0
    whole = merge(list(hulls))
    points, faces = sample_with_faces(surface, POINTS, seed=0)
    face, _ = nearest_faces(ray_mesh(whole.vertices, whole.faces), points, reach)
    near = face >= 0
    normal = normals(whole)[face[near]]
    cosine = np.einsum("ij,ij->i", normal, normals(surface)[faces[near]])
    same, opposite = cosine > FACING, cosine < -FACING
    facing = same if same.sum() >= opposite.sum() else opposite  # some scans have their faces the wrong way round
    normal, points = normal[facing], points[near][facing]
    corner = whole.vertices[whole.faces[face[near][facing], 0]].astype(float)
    along = np.einsum("ij,ij->i", corner - points, normal)
    if len(along) < POINTS // 20:
        return 0.0
    values, axes = np.linalg.eigh(normal.T @ normal / len(normal))
    determined = values > seen
    moved = (axes[:, determined].T @ (normal.T @ along / len(normal))) / values[determined]
    return float(np.linalg.norm(moved))


def _cover(name: str, path: str, surface: Mesh, hulls: Sequence[Mesh], bound: float, config: FidelityConfig) -> Check:
    value = uncovered(sample(surface, POINTS, seed=0), hulls, config.cover)
    message = f"of the scanned surface is farther than {1000 * config.cover:.0f} mm from any of {len(hulls)} colliders"
    return at_most(
        name, value, bound, "", prim=path, message=message, remedy="add the missing colliders; " + PREPARE_AGAIN
    )


def _excess(path: str, surface: Mesh, hulls: Sequence[Mesh], config: FidelityConfig) -> Check:
    value, which = excess(surface, hulls)
    prim = f"{path}/colliders/hull_{which:02d}" if hulls else path
    message = "from a collider's corner to the nearest scanned surface"
    remedy = "a collider is where no surface was scanned; " + PREPARE_AGAIN
    return at_most("collider_excess", value, config.max_excess, "m", prim=prim, message=message, remedy=remedy)


def _shifted(name: str, path: str, value: float, config: FidelityConfig) -> Check:
    message = "between the colliders and the scanned surface"
    remedy = "put the colliders where the surface is; " + PREPARE_AGAIN
    return at_most(name, value, config.max_shift, "m", prim=path, message=message, remedy=remedy)


def _room(room: SimRoom, part: str, config: FidelityConfig) -> Check:
    """Ask whether what is fixed around a part has colliders."""
    visual, point = room.static_visual, np.array(room.articulations[part].grasp.point)
    points = sample(visual, ROOM_POINTS, seed=0) if visual.face_areas.sum() > 1e-4 else np.zeros((0, 3))
    near = points[np.linalg.norm(points - point, axis=1) < config.around]
    hulls = [c.mesh for c in room.static_colliders]
    hulls = [
        h for h in hulls if (h.bounds[0] < point + config.around).all() and (h.bounds[1] > point - config.around).all()
    ]
    value = uncovered(near, hulls, config.cover) if len(near) else 0.0
    message = f"of the room within {config.around:g} m is farther than {1000 * config.cover:.0f} mm from any collider"
    return at_most(
        "cover_room", value, config.max_uncovered_room, "", prim="/scene/static", message=message,
        remedy="add the missing colliders; " + PREPARE_AGAIN,
    )  # fmt: skip


# A doubt that is no failure by itself: why a part cannot be held. Every other doubt about a part is one: it would
# move as no such part does, or through what was scanned. None is raised by a right annotation of
# the virtual rooms (experiments/wrong_annotations.py)
REASON = "handle_relief"
OWN = "grasp_on_region"  # Asked of the grasp point that the file names (`grasp_frame`), not of the region's mean


@dataclass(frozen=True)
class EvidenceConfig:
    """What is asked of the scanned surface."""

    joints: Bounds = Bounds()  # bounds of what it may say about an annotation, those of `s2a check`
    fidelity: FidelityConfig = FidelityConfig()  # bounds on the distance between colliders and surface
    base: BaseCheckConfig = BaseCheckConfig()  # bounds on where a robot stands


class Evidence:
    """The scanned surface of a sim.usd, read once for all its parts."""

    def __init__(self, path: Path) -> None:
        """Read a stage whose structure is sound, with its visuals; InputError for any other."""
        self.room = sim_stage.read(path)
        self.surface = ScanSurface(as_scene(self.room))
        self._whole: dict[Bounds, list[Check]] = {}

    def checks(self, part: str, config: EvidenceConfig, only: str | None = None) -> list[Check]:
        """Return all checks of an articulated part against the scanned surface; `only` names the one robot that is asked for."""
        return EVIDENCE.ask(PartEvidence(self, part, only), config)

    @cached_property
    def fronts(self) -> dict[str, Front | None]:
        """The fronts of all articulated parts by id."""
        return {part: front(self.surface, part) for part in self.room.articulations}

    def of_room(self, bounds: Bounds) -> list[Check]:
        """Return what the surface says about the whole room, asked once for all its parts."""
        if bounds not in self._whole:
            self._whole[bounds] = room_checks(self.surface, self.fronts, bounds)
        return self._whole[bounds]


@dataclass(frozen=True)
class PartEvidence:
    """The scanned surface about one articulated part."""

    whole: Evidence  # of the room
    part: str  # id of the part
    # name of the one robot that is asked for, if the part was prepared for it; None: all of them
    only: str | None = None

    @property
    def path(self) -> str:
        """Path of the part's prim."""
        return f"{ROOT}/{self.part}"

    @property
    def articulation(self) -> Articulation:
        """How the part moves and is grasped."""
        return self.whole.room.articulations[self.part]

    @property
    def robots(self) -> list[str]:
        """Names of the robots that are asked for."""
        bases = self.articulation.bases
        return [self.only] if self.only in bases else sorted(bases)


EVIDENCE: Suite[PartEvidence, EvidenceConfig] = Suite()  # Checks of a part against the scanned surface


@EVIDENCE.check()
def annotation(scanned_part: PartEvidence, config: EvidenceConfig) -> list[Check]:
    """Return what the surface says about the room's frame and about the joint: the checks of `s2a check`."""
    whole, part = scanned_part.whole, scanned_part.part
    checks = [*whole.of_room(config.joints), *moving_part(whole.surface, part, whole.fronts[part], config.joints)]
    return [_of_stage(check) for check in checks if check.status != "skipped" and check.name != OWN]


@EVIDENCE.check()
def colliders(scanned_part: PartEvidence, config: EvidenceConfig) -> list[Check]:
    """Return the checks of colliders against the surface."""
    return collider_fidelity(scanned_part.whole.room, scanned_part.part, config.fidelity)


@EVIDENCE.check()
def grasp(scanned_part: PartEvidence, config: EvidenceConfig) -> list[Check]:
    """Return the checks of the grasp against the surface."""
    surface = scanned(scanned_part.whole.room, scanned_part.part)
    widest = max(robot.load(name).gripper.max_opening for name in scanned_part.robots)
    return grasp_frame(scanned_part.path, scanned_part.articulation.grasp, surface, config.joints.grasp_gap, widest)


@EVIDENCE.check()
def bases(scanned_part: PartEvidence, config: EvidenceConfig) -> list[Check]:
    """Return the checks of where robots stand."""
    point, tree = np.array(scanned_part.articulation.grasp.point), scanned_part.whole.surface.tree
    checks = []
    for name in scanned_part.robots:
        base, spec = scanned_part.articulation.bases[name], robot.load(name)
        checks += robot_base(f"{scanned_part.path}/bases/{name}", base, point, tree, spec, config.base)
    return checks


def as_scene(room: SimRoom) -> Scene:
    """Return the scanned surfaces of a simulation-ready room as a scene, without what was added, nothing cut away."""
    parts: dict[str, Part] = {}
    for index, part in enumerate(room.static_parts):
        if room.static_face_part is not None:
            parts[part] = _part(part, keep(room.static_visual, room.static_face_part == index))
    if not room.static_parts:
        parts["static"] = _part("static", room.static_visual)
    for body in room.bodies:
        parts |= _body(room, body)
    for free in room.free.values():
        parts[free.id] = _part(free.id, Mesh(in_scene(free, free.visual), free.visual.faces))
    return Scene(room.name, parts)


def _body(room: SimRoom, body: str) -> dict[str, Part]:
    """Return a body and, as a part of its own, the region where it is grasped."""
    surface = scanned(room, body)
    articulation = room.articulations.get(body)
    if articulation is None:
        return {body: _part(body, surface)}
    region = articulation.grasp.region
    rest = without(surface, region)
    if not rest.face_areas.sum() > 0:
        return {body: _part(body, surface, articulation.parent, articulation.joint, graspable=True)}
    handle = f"handle_of_{body}"
    return {
        body: _part(body, rest, articulation.parent, articulation.joint),
        handle: Part("handle", region, body, "fixed", True),
    }


def without(surface: Mesh, region: Mesh) -> Mesh:
    """Return the faces of a surface that are not a region's, whose vertices are the same bit for bit."""
    own = {bytes(vertex) for vertex in region.vertices}
    shared = np.array([bytes(vertex) in own for vertex in surface.vertices], bool)
    return keep(surface, ~shared[surface.faces].all(axis=1))


def _part(
    name: str, mesh: Mesh, parent: str | None = None, motion: Joint | None = None, *, graspable: bool = False
) -> Part:
    label = re.sub(r"_\d+$", "", name).replace("_", " ")
    return Part(label, Mesh(mesh.vertices, mesh.faces), parent, motion or "fixed", graspable)


def _of_stage(check: Check) -> Check:
    """Return a check of an annotation as one of the stage: a warning about a joint is a failure, as a robot would act on it."""
    severe = check.status == "fail" or (check.status == "warn" and bool(check.part) and check.name != REASON)
    status: Status = "fail" if severe else "info" if check.status == "warn" else "pass"
    prim = f"{ROOT}/joints/{check.part}" if check.part else ROOT
    message = "" if status == "pass" else check.message
    return replace(check, status=status, prim=prim, message=message, remedy=check.remedy if severe else "")


def doubts(checks: Sequence[Check], names: Sequence[str]) -> list[str]:
    """Return the messages of those checks that did not pass."""
    return [check.message for check in checks if check.name in names and check.status in ("fail", "info")]
