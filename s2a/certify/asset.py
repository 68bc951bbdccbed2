"""Checks of a third-party asset, which need no scan: structure, masses, shapes, overlaps, limits, rest; in both engines."""

import contextlib
import copy
import dataclasses
import hashlib
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np

from s2a.certify.portability import opinions
from s2a.core.check import Check, Suite, ValidationReport, at_most, no_problems
from s2a.core.provenance import provenance
from s2a.scene.articulation import carried
from s2a.scene.geometry.convex import contains, hull, volume
from s2a.scene.geometry.mesh_ops import merge, sample
from s2a.scene.geometry.mesh_query import kept_ray_mesh, nearest_faces, winding
from s2a.scene.scene import Joint, Mesh
from s2a.sim.asset import DROP, PLANE, WORLD, Asset, AssetBody, AssetJoint, placed, read, rest_state
from s2a.sim.contacts import Engine, OverlapDepth, RestingRoom, mujoco_depths, newton_depths


@dataclass(frozen=True)
class AssetBounds:
    """Bounds of the checks of an asset."""

    size: tuple[float, float] = (0.005, 100.0)  # diagonal [m]: from a screw to a building; beyond, a unit is wrong
    # mass by the volume of the body's hulls [kg/m^3]: from a paper lamp to solid steel
    density: tuple[float, float] = (3.0, 8000.0)
    # largest moment by that of a solid box of this mass and size: mass in the corners gives 3, a motor in the middle of a
    # long link 0.02
    inertia: tuple[float, float] = (0.01, 3.3)
    centre: float = 0.1  # how far the centre of mass may lie outside of the bounding box, as a fraction of its diagonal
    apart: float = (
        0.01  # [m] or `fraction` of the body's diagonal, where that is more: a collider's distance from what is seen
    )
    fraction: float = 0.03
    air: float = 0.05  # fraction of the colliders' surface that may stand farther off what is seen
    rest: float = 1e-3  # [m] overlap at rest
    range: float = 2e-3  # [m] the same anywhere in a joint's range
    give: float = 0.01  # [m] or `fraction` of the travel: how far a stop may give way under the stated torque
    sink: float = 0.005  # [m] how deep what fell may lie in the ground
    speed: float = 0.02  # [m/s] of any body after SETTLE seconds
    slam: float = 2.0  # [m/s] of a hinge's edge at its stop: what falls from 0.2 m


BOUNDS = AssetBounds()
LOAD = 10.0  # [N] At the farthest point of what a joint moves, or its weight, where that is less: the stated torque
SAMPLES, SEED = 1500, 0  # Points of a body's colliders and of its visuals
SETTLE = 6.0  # [s] For how long it falls
HOLD = 1.0  # [s] For how long a stop is pushed
FALL = 3.0  # [s] For how long a hinge may fall
STIFF = 1e6  # [N s/m] or [N m s/rad] What holds all other joints meanwhile
STEP = 0.002  # [s]
ENGINES: tuple[tuple[str, Engine], ...] = (("MuJoCo", mujoco_depths), ("Newton", newton_depths))

ASSET: Suite["AssetSubject", AssetBounds] = Suite()  # In the order in which a report lists them


@dataclass(frozen=True)
class AssetSubject:
    """An asset, and what several checks measure of it."""

    asset: Asset
    overlaps: list["Meeting"] = field(default_factory=list, compare=False)  # measured by the checks of overlaps

    @cached_property
    def size(self) -> float:
        """Diagonal of the whole asset [m]."""
        points = [placed(mesh, body.pose).bounds for body in self.asset.bodies.values() for mesh in _surfaces(body)]
        return float(np.linalg.norm(np.max(points, axis=(0, 1)) - np.min(points, axis=(0, 1)))) if points else 0.0

    @cached_property
    def held(self) -> dict[str, mujoco.MjModel]:
        """Copies of the models in which no joint moves and nothing collides, by engine."""
        return {engine: _alone(model) for engine, model in self.asset.models.items()}

    def joints(self) -> Iterator[tuple[AssetJoint, str, mujoco.MjModel, int]]:
        """Yield each joint with each engine, its held copy, and the joint's number there."""
        for name, joint in self.asset.joints.items():
            for engine, model in self.held.items():
                names = [model.joint(i).name or f"joint_{i}" for i in range(model.njnt)]
                alike = [i for i, other in enumerate(names) if other == name] or [
                    i for i, other in enumerate(names) if other.endswith((f"/{name}", f"_{name}"))
                ]
                if len(alike) == 1:
                    yield joint, engine, model, alike[0]


@dataclass(frozen=True)
class Meeting:
    """Two groups of welded bodies that overlap."""

    one: str
    other: str
    joint: str  # in whose range
    engine: str
    depth: OverlapDepth


def certify_asset(path: Path) -> tuple[ValidationReport, AssetSubject]:
    """Ask everything of a URDF, MJCF or USD that needs no scan.

    Returns:
        Its report, and what was measured, which a repair uses.

    Raises:
        InputError: a file that neither MuJoCo nor Newton can read.
    """
    start = time.perf_counter()
    subject = AssetSubject(read(path))
    checks = (*ASSET.ask(subject, BOUNDS), *opinions(path, subject.asset.kind))
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    seconds = round(time.perf_counter() - start, 2)
    bounds = dataclasses.asdict(BOUNDS)
    return ValidationReport(str(path), digest, "", checks, None, bounds, seconds, provenance("cpu")), subject


def _surfaces(body: AssetBody) -> tuple[Mesh, ...]:
    """Return what is seen of a body, or what collides where nothing is."""
    return body.visuals or body.colliders


def bounding_box(bodies: Sequence[AssetBody]) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the bounds of bodies that are welded to each other, in the first one's frame [m]; None without a surface."""
    back = np.linalg.inv(bodies[0].pose)
    bounds = [placed(mesh, back @ b.pose).bounds for b in bodies for mesh in (*b.visuals, *b.colliders)]
    return (np.min(bounds, axis=0)[0], np.max(bounds, axis=0)[1]) if bounds else None


@ASSET.check()
def engines(subject: AssetSubject, bounds: AssetBounds) -> list[Check]:
    """MuJoCo and Newton read the file as it is, and read the same."""
    asset = subject.asset
    names = ("Newton",) if asset.kind == "USD" else ("MuJoCo", "Newton")
    checks = [
        no_problems(
            f"{engine.lower()}_import",
            [(asset.path.name, asset.problems[engine])] if engine in asset.problems else [],
            f"correct what {engine} names, or give repair=FOLDER",
            f"{engine} reads the {asset.kind}",
        )
        for engine in names
    ]
    if len(asset.models) < 2:
        return checks
    one, other = (asset.models[engine] for engine in ("MuJoCo", "Newton"))
    problems = []
    if one.nv != other.nv:
        problems.append(f"{one.nv} degrees of freedom in MuJoCo, {other.nv} in Newton")
    masses = one.body_mass[1:].sum(), other.body_mass[1:].sum()
    if abs(masses[0] - masses[1]) > 0.01 * max(masses):
        problems.append(f"{masses[0]:.4g} kg in MuJoCo, {masses[1]:.4g} in Newton")
    counts = [int(((m.geom_contype != 0) | (m.geom_conaffinity != 0)).sum()) for m in (one, other)]
    if min(counts) == 0 < max(counts):
        problems.append(f"{counts[0]} colliders in MuJoCo, {counts[1]} in Newton")
    rows = [(asset.path.name, problem) for problem in problems]
    same = no_problems("same_in_both", rows, "state masses and inertias of all bodies", "the same joints and masses")
    # an importer's reading is no fault of the file where its own format leaves it open
    return [*checks, replace(same, status="warn") if rows else same]


@ASSET.check()
def units(subject: AssetSubject, bounds: AssetBounds) -> list[Check]:
    """Lengths are metres, angles radians, and what is seen is as large as what collides."""
    asset, problems = subject.asset, []
    low, high = bounds.size
    if not low <= subject.size <= high:
        problems.append((asset.path.name, f"is {subject.size:.4g} m large: a unit is wrong"))
    per, up = asset.units
    if asset.kind == "USD" and per is None:
        problems.append((asset.path.name, "states no metersPerUnit: importers take a centimetre or a metre"))
    elif per != 1.0:
        problems.append((asset.path.name, f"states metersPerUnit={per:g}, and Newton takes its numbers as metres"))
    if asset.kind == "USD" and up is None:
        problems.append((asset.path.name, "states no upAxis: importers take y or z"))
    for body in asset.bodies.values():
        sizes = [float(np.linalg.norm(np.ptp(merge(m).bounds, axis=0))) for m in (body.visuals, body.colliders) if m]
        if len(sizes) == 2 and not 1 / 20 < sizes[1] / max(sizes[0], 1e-9) < 20:
            problems.append((body.name, f"{body.name}: {sizes[0]:.3g} m are seen, {sizes[1]:.3g} m collide"))
    for name, joint in asset.joints.items():
        if joint.motion.kind == "revolute" and joint.limited and np.ptp(joint.motion.limits) > 8 * np.pi:
            problems.append(
                (name, f"{name} turns by {np.ptp(joint.motion.limits):.4g} rad; the limits may be in degrees")
            )
    return [no_problems("units", problems, "state metres, radians and kilograms", f"{subject.size:.3g} m large")]


@ASSET.check()
def structure(subject: AssetSubject, bounds: AssetBounds) -> list[Check]:
    """What moves collides; slides end; limits are in order; what the joints name is there."""
    asset, problems = (
        subject.asset,
        [(name, f"{name}: lower limit above the upper one") for name in subject.asset.swapped],
    )
    bare = [
        name
        for name, group in asset.moving.items()
        if name != WORLD and not any(body.colliders for body in group) and any(body.visuals for body in group)
    ]
    if not any(body.colliders for body in asset.bodies.values()):
        problems.append((asset.path.name, "nothing collides"))
        bare = []
    for name, joint in asset.joints.items():
        if joint.motion.kind == "prismatic" and not joint.limited:
            problems.append((name, f"{name} slides without end"))
        elif np.ptp(joint.motion.limits) < 1e-6:
            problems.append((name, f"{name} has no range"))
    remedy = "swap or state the limits, add colliders"
    ghosts = no_problems(
        "colliders", [(name, f"{name} has visuals and no collider") for name in bare],
        "add colliders (repair=FOLDER makes them of the visuals)", "all moving visuals have colliders",
    )  # fmt: skip
    return [no_problems("structure", problems, remedy, f"{len(asset.joints)} joints"), ghosts]


def faulty_masses(asset: Asset, bounds: AssetBounds = BOUNDS) -> dict[str, str]:
    """Return the groups of welded bodies whose mass, centre or inertia cannot be, with the reason."""
    faults = {}
    for name, group in asset.moving.items():
        box = bounding_box(group)
        if name == WORLD or box is None:
            continue
        mass, size, litres = (
            sum(body.mass for body in group),
            np.maximum(box[1] - box[0], 1e-3),
            1000 * solid_volume(group),
        )
        if not bounds.density[0] <= 1000 * mass / litres <= bounds.density[1]:
            faults[name] = f"{name}: {mass:.3g} kg in {litres:.3g} litres, {1000 * mass / litres:.3g} kg/m^3"
            continue
        center, inertia = _welded(group)
        margin = bounds.centre * np.linalg.norm(size)
        if (center < box[0] - margin).any() or (center > box[1] + margin).any():
            faults[name] = f"{name}: its centre of mass lies outside"
            continue
        moments = np.linalg.eigvalsh(inertia)
        if unsound := [body.name for body in group if body.name in asset.unsound]:
            faults[name] = f"{unsound[0]}: its moments of inertia are impossible"
            continue
        solid = mass * (np.sort(size)[1:] ** 2).sum() / 12.0
        if not bounds.inertia[0] <= moments[2] / solid <= bounds.inertia[1]:
            faults[name] = f"{name}: {moments[2]:.3g} kg m^2, {moments[2] / solid:.3g} times that of a solid box"
    return faults


def solid_volume(group: Sequence[AssetBody]) -> float:
    """Return the volume of the hulls of welded bodies, of what is seen where nothing collides [m^3]."""
    pieces = [mesh for body in group for mesh in body.colliders]
    pieces = pieces or [piece for body in group for mesh in body.visuals if (piece := hull(mesh.vertices)) is not None]
    return max(sum(map(volume, pieces)), 1e-9)


def _welded(group: Sequence[AssetBody]) -> tuple[np.ndarray, np.ndarray]:
    """Return the centre of mass [m] and the inertia about it [kg m^2] of welded bodies, in the first one's frame."""
    back = np.linalg.inv(group[0].pose)
    places = [back @ body.pose for body in group]
    centers = np.array([place[:3, :3] @ body.center + place[:3, 3] for place, body in zip(places, group, strict=True)])
    masses = np.array([body.mass for body in group])
    center = masses @ centers / max(masses.sum(), 1e-12)
    inertia = np.zeros((3, 3))
    for place, body, mass, at in zip(places, group, masses, centers - center, strict=True):
        inertia += place[:3, :3] @ body.inertia @ place[:3, :3].T + mass * (at @ at * np.eye(3) - np.outer(at, at))
    return center, inertia


@ASSET.check()
def inertia(subject: AssetSubject, bounds: AssetBounds) -> Check:
    """Masses and inertias are those of bodies of this size."""
    faults = list(faulty_masses(subject.asset, bounds).items())
    total = sum(body.mass for body in subject.asset.bodies.values() if body.rigid != WORLD)
    return no_problems("inertia", faults, "state mass and inertia of what is seen", f"{total:.3g} kg move")


def air_fraction(body: AssetBody, bounds: AssetBounds = BOUNDS) -> float:
    """Return the fraction of a body's colliders' surface that stands in the air, off what is seen of it.

    A filled opening has a lid: the hull's surface over it, away from the visual surface, outside of what is seen and of all
    other colliders.
    """
    seen = merge(body.visuals)
    if not len(seen.faces) or not body.colliders:
        return 0.0
    tolerance = max(bounds.apart, bounds.fraction * float(np.linalg.norm(np.ptp(seen.bounds, axis=0))))
    points = sample(merge(body.colliders), SAMPLES, SEED)
    near = nearest_faces(kept_ray_mesh(seen), points, tolerance)[0] >= 0
    free = points[~near]
    if not len(free):
        return 0.0
    inner = np.zeros(len(free), bool)
    for piece in body.colliders:
        inner |= contains(piece, free, -1e-4)
    inner |= np.abs(winding(seen, free)) > 0.5
    return float((~inner).sum()) / SAMPLES


@ASSET.check()
def filled_air(subject: AssetSubject, bounds: AssetBounds) -> Check:
    """Colliders follow what is seen: none fills an opening or stands off it."""
    fractions = {name: air_fraction(body, bounds) for name, body in subject.asset.bodies.items()}
    worst = max(fractions, key=lambda name: fractions[name], default="")
    some = [name for name, fraction in fractions.items() if fraction > bounds.air]
    message = "of the colliders' surface is in the air, away from the visuals"
    return at_most(
        "filled_air", fractions.get(worst, 0.0), bounds.air, "", prim=worst,
        message=f"{message}: {', '.join(some[:6])}" if some else message,
        remedy="decompose the shape into more hulls (repair=FOLDER does)",
    )  # fmt: skip


@ASSET.check()
def cover(subject: AssetSubject, bounds: AssetBounds) -> Check:
    """What is seen collides: its surface has a collider near."""
    fractions = {}
    for name, body in subject.asset.bodies.items():
        seen = merge(body.visuals)
        if not body.colliders or not len(seen.faces):
            continue
        tolerance = max(bounds.apart, bounds.fraction * float(np.linalg.norm(np.ptp(seen.bounds, axis=0))))
        points = sample(seen, SAMPLES, SEED)
        inner = np.zeros(len(points), bool)
        for piece in body.colliders:
            inner |= contains(piece, points, tolerance)
        fractions[name] = 1.0 - float(inner.mean())
    worst = max(fractions, key=lambda name: fractions[name], default="")
    message = "of the visuals' surface has no collider near" + (f": {worst}" if worst else "")
    # few colliders are a choice, as of a robot's feet alone
    return at_most("cover", fractions.get(worst, 0.0), 0.5, "", otherwise="warn", prim=worst, message=message,
                   remedy="add colliders")  # fmt: skip


def meetings(asset: Asset) -> Iterator[Meeting]:
    """Yield groups of bodies that overlap, no pair filtered but neighbours on a joint of which both move.

    Every engine filters those; MuJoCo does not where one of them is fixed to the world. What a motor moves is asked at rest
    alone: a controller has to keep it from what its range reaches.
    """
    bodies, parents = asset.sim_bodies(), asset.parents
    static = bodies.pop(WORLD).colliders if WORLD in bodies else ()
    free = [name for name in parents if parents[name] == WORLD]
    for name, joint in asset.joints.items():
        part = asset.bodies[joint.body].rigid
        if part == WORLD:
            continue
        motion = replace(joint.motion, limits=(0.0, 0.0)) if joint.driven else joint.motion
        around = RestingRoom(bodies, {part: motion}, parents, static)
        beside = () if parents[part] == WORLD else (parents[part],)
        for engine, method in ENGINES:
            for (one, other), depth in around.pairs(part, method, beside).items():
                yield Meeting(one, other, name, engine, depth)
    still = Joint("prismatic", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0))
    for name in set(free) - {asset.bodies[joint.body].rigid for joint in asset.joints.values()}:
        for engine, method in ENGINES:  # what no hinge or slide holds
            for (one, other), depth in RestingRoom(bodies, {name: still}, parents, static).pairs(name, method).items():
                yield Meeting(one, other, "", engine, depth)


@ASSET.check()
def overlaps(subject: AssetSubject, bounds: AssetBounds) -> list[Check]:
    """No two bodies overlap at rest, or anywhere in the range of a joint, whatever a file hides by filters."""
    subject.overlaps[:] = meetings(subject.asset)
    hidden = f"; {subject.asset.hidden} pairs are excluded, which other importers may not read"
    hidden, checks = hidden if subject.asset.hidden else "", []
    for name, bound, key in (("rest_overlap", bounds.rest, "rest"), ("range_overlap", bounds.range, "travel")):
        worst = max(subject.overlaps, key=lambda each: getattr(each.depth, key), default=None)
        if worst is None:
            checks.append(Check(name, "pass", 0.0, bound, "m", "", f"nothing overlaps{hidden}"))
            continue
        depths = {(each.one, each.other): getattr(each.depth, key) for each in subject.overlaps}
        count = sum(depth > bound for depth in depths.values())
        at = "" if key == "rest" else f" at {worst.depth.q:.3g} of {worst.joint}"
        message = f"{worst.one} in {worst.other}{at}, by {worst.engine} without filters; {count} pairs{hidden}"
        depth, remedy = getattr(worst.depth, key), "trim the colliders apart (repair=FOLDER does)"
        checks.append(at_most(name, depth, bound, "m", prim=worst.one, message=message, remedy=remedy))
    return checks


def _alone(model: mujoco.MjModel) -> mujoco.MjModel:
    """Return a copy in which nothing collides, no motor turns, and all joints are held."""
    held = copy.deepcopy(model)
    held.dof_damping[:] = STIFF
    held.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_ACTUATION
    held.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EQUALITY
    held.opt.integrator, held.opt.timestep = mujoco.mjtIntegrator.mjINT_IMPLICITFAST, STEP
    return held


@contextlib.contextmanager
def _released(model: mujoco.MjModel, dof: int, damping: float) -> Iterator[None]:
    """Let one joint of a held model move meanwhile."""
    model.dof_damping[dof] = damping
    try:
        yield
    finally:
        model.dof_damping[dof] = STIFF


def lever(asset: Asset, joint: AssetJoint) -> tuple[float, float]:
    """Return the farthest distance of what a joint moves from its axis [m], 1 for a slide, and its weight [N]."""
    group = carried(asset.bodies[joint.body].rigid, asset.parents)
    members = [body for name in group for body in asset.moving.get(name, [])]
    points = [placed(mesh, body.pose).vertices for body in members for mesh in _surfaces(body)]
    weight = 9.81 * sum(body.mass for body in members)
    if joint.motion.kind == "prismatic" or not points:
        return 1.0, weight
    axis, origin = np.array(joint.motion.axis), np.array(joint.motion.origin)
    away = np.concatenate(points) - origin
    return float(np.linalg.norm(np.cross(axis, away), axis=1).max(initial=1e-3)), weight


def give(asset: Asset, model: mujoco.MjModel, joint: AssetJoint, index: int) -> float:
    """Return how far a joint of a held copy goes beyond its limits at the farthest point under the stated torque [m]."""
    arm, weight = lever(asset, joint)
    at, dof, worst = model.jnt_qposadr[index], model.jnt_dofadr[index], 0.0
    limits, gravity = np.array(joint.motion.limits) + joint.rest, model.opt.gravity.copy()
    model.opt.gravity[:] = 0.0
    with _released(model, dof, joint.damping):
        for side, sign in enumerate((-1.0, 1.0)):
            data = rest_state(model)
            data.qpos[at] = limits[side]
            data.qfrc_applied[dof] = sign * min(LOAD, weight) * arm
            mujoco.mj_step(model, data, round(HOLD / STEP))
            beyond = sign * (data.qpos[at] - limits[side]) * arm
            worst = max(worst, float(beyond)) if np.isfinite(beyond) else np.inf
    model.opt.gravity[:] = gravity
    return worst


@ASSET.check()
def limits(subject: AssetSubject, bounds: AssetBounds) -> Check:
    """Limits hold under the stated torque."""
    worst, where, count = 0.0, "", 0
    for joint, engine, model, index in subject.joints():
        if joint.limited and (travel := float(np.ptp(joint.motion.limits)) * lever(subject.asset, joint)[0]) > 1e-6:
            beyond = give(subject.asset, model, joint, index) / max(bounds.give, bounds.fraction * travel)
            count += beyond > 1.0
            if beyond > worst:
                worst, where = beyond, f"{joint.name} in {engine}"
    message = f"of the deflection that a stop may have under {LOAD:g} N, or the weight, at the farthest point"
    message += f": {where}; {count} too far" if where else ""
    return at_most(
        "limits", worst, 1.0, "", prim=where.split(" ")[0], message=message,
        remedy="stiffen the limits (solreflimit of MJCF, newton:limit of USD)",
    )  # fmt: skip


@ASSET.check()
def slam(subject: AssetSubject, bounds: AssetBounds) -> Check:
    """A hinge that nobody holds closes slowly enough."""
    worst, where = 0.0, ""
    for joint, engine, model, index in subject.joints():
        if not joint.driven and joint.limited and joint.motion.kind == "revolute":
            speed = slam_speed(subject.asset, model, joint, index)
            worst, where = max((worst, where), (speed, f"{joint.name} in {engine}"))
    message = "of the edge of a part that falls shut or open" + (f": {where}" if worst else "; no hinge falls")
    return at_most(
        "slam", worst, bounds.slam, "m/s", prim=where.split(" ")[0], message=message,
        remedy="give the hinge damping (repair=FOLDER does)",
    )  # fmt: skip


def slam_speed(asset: Asset, model: mujoco.MjModel, joint: AssetJoint, index: int) -> float:
    """Return the largest speed of a hinge's edge at a stop when it falls from either one, or from the middle [m/s]."""
    arm, fastest = lever(asset, joint)[0], 0.0
    at, dof = model.jnt_qposadr[index], model.jnt_dofadr[index]
    low, high = np.array(joint.motion.limits) + joint.rest
    with _released(model, dof, joint.damping):
        for start in (low + 0.02 * (high - low), (low + high) / 2, high - 0.02 * (high - low)):
            data = rest_state(model)
            data.qpos[at] = start
            for _ in range(round(FALL / STEP)):
                before = float(data.qvel[dof])
                mujoco.mj_step(model, data)
                if not low + 1e-3 < data.qpos[at] < high - 1e-3:
                    fastest = max(fastest, abs(before) * arm) if np.isfinite(before) else np.inf
                    break
    return fastest


@ASSET.check()
def drop(subject: AssetSubject, bounds: AssetBounds) -> list[Check]:
    """What is free falls onto the ground and comes to rest on it; what is fixed comes to rest."""
    asset = subject.asset
    sunk, speed, names = 0.0, 0.0, ["", ""]
    for engine, model in asset.grounds.items():
        depth, fast, body = fall(model)
        if not sunk >= depth:
            sunk, names[0] = depth, engine
        if not speed >= fast:
            speed, names[1] = fast, f"{body} in {engine}"
    checks = []
    if asset.free:
        checks.append(
            at_most(
                "drop",
                sunk,
                bounds.sink,
                "m",
                message=f"into the ground after a drop of {DROP:g} m, {names[0]}",
                remedy="add colliders where it stands, correct its masses",
            )  # fmt: skip
        )
    checks.append(
        at_most(
            "settles",
            speed,
            bounds.speed,
            "m/s",
            prim=names[1].split(" ")[0],
            message=f"of the fastest body after {SETTLE:g} s: {names[1] or 'nothing moves'}",
            remedy="give its joints damping, correct overlaps and masses (repair=FOLDER does)",
        )  # fmt: skip
    )
    return checks


def fall(model: mujoco.MjModel) -> tuple[float, float, str]:
    """Return how deep an asset lies in the ground after its fall [m], its fastest point's speed then [m/s], and that body.

    Motors hold the rest pose where they hold positions.
    """
    data, planes = rest_state(model), model.geom_type == PLANE
    for i in range(model.nu):
        if not model.nkey and model.actuator_biastype[i] == int(mujoco.mjtBias.mjBIAS_AFFINE):
            data.ctrl[i] = data.actuator_length[i]
    mujoco.mj_step(model, data, round(SETTLE / model.opt.timestep))
    if not np.isfinite(data.qpos).all() or data.warning[int(mujoco.mjtWarning.mjWARN_BADQACC)].number:
        return np.inf, np.inf, "all"
    speeds, six, reach = np.zeros(model.nbody), np.zeros(6), np.zeros(model.nbody)
    np.maximum.at(reach, model.geom_bodyid, model.geom_rbound)
    for body in range(1, model.nbody):
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, body, six, 0)
        speeds[body] = np.linalg.norm(six[3:]) + reach[body] * np.linalg.norm(six[:3])
    worst = int(np.argmax(speeds))
    deep = max((-float(c.dist) for c in data.contact if planes[c.geom1] or planes[c.geom2]), default=0.0)
    return deep, float(speeds[worst]), model.body(worst).name.split("/")[-1] or f"body_{worst}"
