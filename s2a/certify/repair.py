"""Repair of a third-party asset: safe changes with which it passes, written to a copy; its visuals stay.

Colliders, masses, damping and limits change; surfaces, frames and axes do not. The written file names the meshes of the
original, which stays as it is.
"""

import contextlib
import itertools
import os
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import mujoco
import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics
from scipy.spatial.transform import Rotation

from s2a.certify import asset as checks
from s2a.certify.asset import BOUNDS, AssetSubject
from s2a.certify.links import write_hull
from s2a.core.check import Check, ValidationReport
from s2a.core.errors import InputError
from s2a.scene.geometry.convex import overlap, vhacd
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Joint, Mesh
from s2a.scene.usd.sim_scene import SimBody
from s2a.sim.asset import WORLD, Asset, AssetBody, AssetJoint, mesh_file, placed, xml
from s2a.sim.contacts import RestingRoom

HULLS = (4, 8, 16, 32, 64)  # Of a body, tried one after the other until none fills an opening
RESOLUTION, VERTICES = 100_000, 32  # Voxels of a decomposition, vertices of a hull at most
DENSITY = 600.0  # [kg/m^3] Of its hulls, as wood has, where a mass cannot be
SMALL = (1e-3, 1e-6)  # [kg], [kg m^2] Of a moving body that has no surface
RATIO = 0.7  # Of critical damping, with which a joint comes to rest
QUICK = 0.3  # [s] In which a slide without a spring comes to rest
STOP = (0.004, 1.0), (0.95, 0.99, 0.001, 0.5, 2.0)  # MuJoCo's solref and solimp of limits that hold
RANGE = 0.5  # Fraction of a joint's range that has to be left where it is cut to what is free
HULL_FOLDER = "hulls"  # Beside the repaired file
STEPS = 7  # Halvings that find it

# Bodies by id, joints, parents, handles, frozen parts -> bodies whose colliders are apart
Trim = Callable[[Mapping[str, SimBody], Mapping[str, Joint], Mapping[str, str]], Mapping[str, SimBody]]
Split = Callable[[Mesh, Mesh], tuple[Mesh | None, Mesh | None]]  # Two hulls -> the same, apart


@dataclass
class Edits:
    """What a repair changes, by names of bodies and joints."""

    masses: dict[str, tuple[float, np.ndarray, np.ndarray]] = field(default_factory=dict)  # kg, centre, inertia [3 3]
    colliders: dict[str, list[Mesh]] = field(default_factory=dict)  # all of a body, in its frame
    damping: dict[str, float] = field(default_factory=dict)  # [N s/m] or [N m s/rad]
    limits: dict[str, tuple[float, float]] = field(default_factory=dict)  # as the file counts [m] or [rad]
    endless: set[str] = field(default_factory=set)  # hinges of a URDF that turn without limits
    stiff: set[str] = field(default_factory=set)  # joints whose limits have to hold more
    notes: list[str] = field(default_factory=list)

    def __bool__(self) -> bool:
        return bool(self.notes)


def plan(subject: AssetSubject, report: ValidationReport, trim: Trim, split: Split) -> Edits:
    """Return what would make the failed checks of an asset pass.

    Args:
        subject: the asset, and what was measured of it.
        report: its checks.
        trim: parts the colliders of what moves without a motor from all others.
        split: parts two hulls of other bodies.
    """
    asset, edits, names = subject.asset, Edits(), {check.name for check in report.failed}
    if names & {"inertia", "mujoco_import", "newton_import"}:
        _correct_masses(asset, edits)
    if names & {"filled_air", "colliders"}:
        _decompose(asset, edits)
    if names & {"rest_overlap", "range_overlap", "filled_air"}:
        _part(asset, subject, edits, trim, split)
    if "structure" in names:
        for joint in (asset.joints[name] for name in asset.swapped if name in asset.joints):
            name = joint.name
            edits.limits[name] = tuple(q + joint.rest for q in joint.motion.limits)  # type: ignore[assignment]
            edits.notes.append(f"{name}: limits swapped")
    if asset.kind == "URDF" and "newton_import" in names:  # Newton takes no limits for a range of 0
        hinges = [joint for joint in xml(asset.path).findall("joint") if joint.get("type") == "revolute"]
        edits.endless = {str(joint.get("name")) for joint in hinges if joint.find("limit") is None}
        edits.notes += [f"{name}: made continuous: it has no limits" for name in sorted(edits.endless)]
    if asset.kind == "USD" and None in asset.units:
        edits.notes.append(f"metersPerUnit={asset.units[0] or 1:g} and upAxis stated, as Newton reads it")
    if "limits" in names and asset.kind != "URDF":
        edits.stiff = {name for name, joint in asset.joints.items() if joint.limited}
        edits.notes.append(f"limits of {len(edits.stiff)} joints stiffened")
    if names & {"settles", "slam"}:
        _damp(asset, edits, "settles" in names)
    return edits


def _correct_masses(asset: Asset, edits: Edits) -> None:
    """Give groups of bodies with an impossible mass or inertia those of solid boxes."""
    faults = checks.faulty_masses(asset)
    for name, group in asset.moving.items():
        boxes = {body.name: box for body in group if (box := checks.bounding_box([body])) is not None}
        if name == WORLD:
            continue
        if not boxes:
            if group[0].mass < SMALL[0] / 10 or np.linalg.eigvalsh(group[0].inertia)[0] < SMALL[1] / 1e3:
                edits.masses[name] = (SMALL[0], np.zeros(3), SMALL[1] * np.eye(3))
                edits.notes.append(f"{name}: {SMALL[0]:g} kg: it has no surface")
            continue
        if name not in faults:
            continue
        sizes = {i: np.maximum(high - low, 1e-3) for i, (low, high) in boxes.items()}
        boxes_volume = sum(float(np.prod(size)) for size in sizes.values())
        mass, volume = sum(body.mass for body in group), checks.solid_volume(group)
        if not BOUNDS.density[0] <= mass / volume <= BOUNDS.density[1]:
            mass = DENSITY * volume
        for body in group:
            if body.name not in boxes:  # its mass is with those that have a surface
                edits.masses[body.name] = (SMALL[0], np.zeros(3), SMALL[1] * np.eye(3))
                continue
            size = sizes[body.name]
            own = max(mass * float(np.prod(size)) / boxes_volume, SMALL[0])
            squares = size**2
            inertia = own * np.diag(squares.sum() - squares) / 12.0
            edits.masses[body.name] = (own, np.mean(boxes[body.name], axis=0), inertia)
        edits.notes.append(f"{name}: {mass:.3g} kg as solid boxes ({faults[name].partition(': ')[2]})")


def _decompose(asset: Asset, edits: Edits) -> None:
    """Make hulls of what is seen where colliders fill openings or are missing, as few as keep openings open."""
    for name, body in asset.bodies.items():
        ghost = not body.colliders and body.rigid != WORLD and not any(b.colliders for b in asset.moving[body.rigid])
        if not body.visuals or not (ghost or checks.air_fraction(body) > BOUNDS.air):
            continue
        seen, best = merge(body.visuals), (np.inf, list[Mesh]())
        for count in HULLS:
            pieces = vhacd(seen, count, RESOLUTION, VERTICES)
            fraction = checks.air_fraction(replace(body, colliders=tuple(pieces)))
            best = min(best, (fraction, pieces), key=lambda each: each[0])
            if fraction <= BOUNDS.air:
                break
        if best[1] and (ghost or best[0] < checks.air_fraction(body)):
            edits.colliders[name] = best[1]
            edits.notes.append(f"{name}: {len(best[1])} hulls of its visuals")


def _edited(asset: Asset, edits: Edits) -> Asset:
    """Return an asset with the colliders and masses of edits."""
    bodies = {
        name: replace(
            body,
            colliders=tuple(edits.colliders.get(name, body.colliders)),
            mass=edits.masses[name][0] if name in edits.masses else body.mass,
        )
        for name, body in asset.bodies.items()
    }
    return replace(asset, bodies=bodies)


def _part(asset: Asset, subject: AssetSubject, edits: Edits, trim: Trim, split: Split) -> None:
    """Trim overlapping colliders apart; where that would take too much, cut the joint's range to its free part."""
    now = _edited(asset, edits)
    meetings = list(checks.meetings(now)) if edits.colliders else subject.overlaps
    if all(m.depth.rest <= BOUNDS.rest and m.depth.travel <= BOUNDS.range for m in meetings):
        return
    bodies = now.sim_bodies()
    passive = {now.bodies[j.body].rigid: j.motion for j in now.joints.values() if not j.driven}
    passive.pop(WORLD, None)
    before = {i: list(body.colliders) for i, body in bodies.items()}
    if passive:
        bodies = dict(trim(bodies, passive, now.parents))
    for one, other in sorted({(m.one, m.other) for m in meetings if m.depth.rest > BOUNDS.rest}):
        other = WORLD if other == "static" else other
        bodies |= _apart(bodies, one, other, split)
    changed = {i for i, body in bodies.items() if list(body.colliders) != before[i]}
    owners = {c.part for i in changed for c in (*before[i], *bodies[i].colliders)}
    for name in sorted(owners):
        body = now.bodies[name]
        back, rigid = np.linalg.inv(body.pose), body.rigid
        pieces = [placed(c.mesh, back) for c in bodies[rigid].colliders if c.part == name]
        if [c for c in bodies[rigid].colliders if c.part == name] != [c for c in before[rigid] if c.part == name]:
            edits.colliders[name] = pieces
            edits.notes.append(f"{name}: {len(body.colliders)} colliders trimmed to {len(pieces)}")
    after = _edited(asset, edits)
    for name, joint in after.joints.items():
        # of a hinge without limits, as a knob's, the file says that it turns on
        if not joint.driven and joint.limited and (limits := _free_range(after, joint)) is not None:
            edits.limits[name] = (limits[0] + joint.rest, limits[1] + joint.rest)
            edits.notes.append(f"{name}: range cut to {edits.limits[name][0]:.4g} to {edits.limits[name][1]:.4g}")


def _apart(bodies: Mapping[str, SimBody], one: str, other: str, split: Split) -> dict[str, SimBody]:
    """Return two bodies whose hulls are cut apart at rest by planes."""
    first, second = list(bodies[one].colliders), list(bodies[other].colliders)
    for i in range(len(first)):
        for j in range(len(second)):
            if overlap(first[i].mesh, second[j].mesh) > BOUNDS.rest / 4:
                a, b = split(first[i].mesh, second[j].mesh)
                if a is not None and b is not None:
                    first[i], second[j] = replace(first[i], mesh=a), replace(second[j], mesh=b)
    return {
        one: replace(bodies[one], colliders=tuple(first)),
        other: replace(bodies[other], colliders=tuple(second)),
    }


def _free_range(asset: Asset, joint: AssetJoint) -> tuple[float, float] | None:
    """Return the part of a joint's range, relative to rest, in which it overlaps nothing; None: all, or less than RANGE of it."""
    low, high = joint.motion.limits
    if _deepest(asset, joint, (low, high)) <= BOUNDS.range or _deepest(asset, joint, (0.0, 0.0)) > BOUNDS.range:
        return None
    ends = []
    for end in (low, high):
        free, blocked = 0.0, 1.0
        if _deepest(asset, joint, (min(end, 0.0), max(end, 0.0))) <= BOUNDS.range:
            free = 1.0
        for _ in range(STEPS if free == 0.0 else 0):
            middle = (free + blocked) / 2
            fits = _deepest(asset, joint, (min(middle * end, 0.0), max(middle * end, 0.0))) <= BOUNDS.range
            free, blocked = (middle, blocked) if fits else (free, middle)
        ends.append(free * end)
    return (ends[0], ends[1]) if ends[1] - ends[0] >= RANGE * (high - low) else None


def _deepest(asset: Asset, joint: AssetJoint, limits: tuple[float, float]) -> float:
    bodies, parents, part = asset.sim_bodies(), asset.parents, asset.bodies[joint.body].rigid
    static = bodies.pop(WORLD).colliders if WORLD in bodies else ()
    around = RestingRoom(bodies, {part: replace(joint.motion, limits=limits)}, parents, static)
    beside = () if parents[part] == WORLD else (parents[part],)
    return max((depth.travel for depth in around.pairs(part, None, beside).values()), default=0.0)


def _damp(asset: Asset, edits: Edits, everything: bool) -> None:
    """Give joints the damping with which they come to rest, and with which nothing slams."""
    heavy = _edited(asset, edits)
    for name, joint in asset.joints.items():
        arm, weight = checks.lever(heavy, joint)
        weight = max(weight, 0.01)
        if joint.motion.kind == "prismatic":
            damping = weight / 9.81 / QUICK
        else:
            # a rod of this weight and length as a pendulum, and as what falls
            damping = 2 * RATIO * np.sqrt(weight * arm / 2 * weight / 9.81 * arm**2 / 3)
            if not joint.driven:
                damping = max(damping, weight * arm / 2 * arm / (BOUNDS.slam / 2))
        if damping > joint.damping and (everything or not joint.driven):
            edits.damping[name] = float(f"{damping:.3g}")
    if edits.damping:
        edits.notes.append(f"damping of {len(edits.damping)} joints, {max(edits.damping.values()):.3g} at most")


def write(asset: Asset, edits: Edits, folder: Path, home: Path) -> None:
    """Write the repaired asset under its own name into an empty folder, its hulls beside it.

    Args:
        asset: the original.
        edits: what changes.
        folder: the folder.
        home: where the folder will be: from there the file names the original's meshes.

    Raises:
        InputError: an MJCF that MuJoCo cannot read, a package of USD, or a USD in other units than metres.
    """
    if asset.path.suffix.lower() == ".usdz":
        raise InputError(f"{asset.path}: a .usdz cannot be written; unpack it, and give the .usd or .usda in it")
    if asset.units[0] not in (None, 1.0):  # all masses and sizes would be of another size
        raise InputError(
            f"{asset.path}: states metersPerUnit={asset.units[0]:g}; convert it to metres before its repair"
        )
    if asset.kind == "MJCF" and "MuJoCo" not in asset.models:
        raise InputError(f"{asset.path}: cannot be repaired before MuJoCo reads it: {asset.problems['MuJoCo']}")
    (folder / HULL_FOLDER).mkdir()
    {"URDF": _write_urdf, "MJCF": _write_mjcf, "USD": _write_usd}[asset.kind](asset, edits, folder, home.resolve())


def _hull_file(folder: Path, body: str, number: int, mesh: Mesh) -> str:
    """Write a hull; return its path from the repaired file."""
    name = "".join(c if c.isalnum() or c in "-_" else "_" for c in body)
    while (file := folder / HULL_FOLDER / f"{name}_{number}.obj").exists():  # of a body with almost the same name
        name += "_"
    write_hull(file, mesh)
    return f"{HULL_FOLDER}/{file.name}"


def _free_names(prefix: str, taken: Iterable[str]) -> Iterator[str]:
    """Yield names that begin with a prefix and are none of those taken, as by an earlier repair."""
    names = set(taken)
    return (name for k in itertools.count() if (name := f"{prefix}{k}") not in names)


def _words(values: Sequence[float] | np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)


def _write_urdf(asset: Asset, edits: Edits, folder: Path, home: Path) -> None:
    robot = xml(asset.path)
    for shape in robot.iter("mesh"):
        file = mesh_file(asset.path.parent, str(shape.get("filename")))
        shape.set("filename", os.path.relpath(file.resolve(), home))
    for texture in robot.iter("texture"):
        with contextlib.suppress(InputError):  # one that is missing stays so
            file = mesh_file(asset.path.parent, str(texture.get("filename")))
            texture.set("filename", os.path.relpath(file.resolve(), home))
    for link in robot.findall("link"):
        name = str(link.get("name"))
        if name in edits.masses:
            for old in link.findall("inertial"):
                link.remove(old)
            mass, center, inertia = edits.masses[name]
            inertial = ElementTree.SubElement(link, "inertial")
            ElementTree.SubElement(inertial, "origin", xyz=_words(center), rpy="0 0 0")
            ElementTree.SubElement(inertial, "mass", value=repr(float(mass)))
            keys = {"ixx": (0, 0), "iyy": (1, 1), "izz": (2, 2), "ixy": (0, 1), "ixz": (0, 2), "iyz": (1, 2)}
            ElementTree.SubElement(inertial, "inertia", {key: repr(float(inertia[at])) for key, at in keys.items()})
        if name in edits.colliders:
            for old in link.findall("collision"):
                link.remove(old)
            for k, mesh in enumerate(edits.colliders[name]):
                collision = ElementTree.SubElement(link, "collision", name=f"{name}_{k}")
                geometry = ElementTree.SubElement(collision, "geometry")
                ElementTree.SubElement(geometry, "mesh", filename=_hull_file(folder, name, k, mesh))
    for joint in robot.findall("joint"):
        name = str(joint.get("name"))
        if name in edits.endless:
            joint.set("type", "continuous")
        if name in edits.damping:
            dynamics = joint.find("dynamics")
            dynamics = ElementTree.SubElement(joint, "dynamics") if dynamics is None else dynamics
            dynamics.set("damping", repr(edits.damping[name]))
        if name in edits.limits and (limit := joint.find("limit")) is not None:
            limit.attrib |= dict(zip(("lower", "upper"), map(repr, map(float, edits.limits[name])), strict=True))
    ElementTree.indent(robot)
    ElementTree.ElementTree(robot).write(folder / asset.path.name, encoding="utf-8", xml_declaration=True)


def _write_mjcf(asset: Asset, edits: Edits, folder: Path, home: Path) -> None:
    spec, original = mujoco.MjSpec.from_file(str(asset.path)), asset.path.parent.resolve()

    def absolute(folder: str, file: str) -> str:
        return file and str(original / folder / (Path(file).name if spec.strippath else file))

    # absolute until it is compiled, without which MuJoCo writes nothing
    for each in (*spec.meshes, *spec.hfields):
        each.file = absolute(spec.meshdir, each.file)
    for each in spec.textures:
        each.file = absolute(spec.texturedir, each.file)
        each.cubefiles = [absolute(spec.texturedir, file) for file in each.cubefiles]
    spec.meshdir, spec.texturedir, spec.strippath = "", "", False
    if spec.compiler.inertiafromgeom == int(
        mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    ):  # of all, whatever is stated
        spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
        for body in spec.bodies[1:]:
            body.explicitinertial = False
    names = [WORLD, *(body.name or f"body_{k}" for k, body in enumerate(spec.bodies[1:], 1))]
    for name, body in zip(names, spec.bodies, strict=True):
        if name in edits.colliders or name in edits.masses:
            old = asset.bodies[name]
            mass, center, inertia = edits.masses.get(name, (old.mass, old.center, old.inertia))
            if name != WORLD:
                body.explicitinertial, body.mass, body.ipos = True, mass, center
                body.inertia, body.iquat = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
                at = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
                body.fullinertia = np.array([inertia[i] for i in at])
        if name in edits.colliders:
            _replace_geoms(spec, body, edits.colliders[name], bool(asset.bodies[name].visuals), folder, name)
    for name, joint in zip(_joint_names(spec), spec.joints, strict=True):
        if name in edits.damping:
            joint.damping = _like(joint.damping, edits.damping[name])
        if name in edits.limits:
            joint.range = list(edits.limits[name]) if not spec.compiler.degree else list(np.degrees(edits.limits[name]))
        if name in edits.stiff:
            joint.solref_limit, joint.solimp_limit = STOP
    try:
        spec.compile()
    except ValueError as error:
        reason = " ".join(str(error).split())[:200]
        raise InputError(
            f"{asset.path}: its repair does not compile ({reason}); remove elements that refer to its colliders"
        ) from error
    root = ElementTree.fromstring(spec.to_xml())
    for tag in root.iter():
        for key in [key for key in tag.keys() if key.startswith("file")]:
            file = Path(str(tag.get(key)))
            inner = file.is_relative_to(folder.absolute())
            tag.set(key, str(file.relative_to(folder.absolute())) if inner else os.path.relpath(file, home))
    ElementTree.indent(root)
    ElementTree.ElementTree(root).write(folder / asset.path.name, encoding="utf-8")


def _like(old: float | np.ndarray, value: float) -> float | list[float]:
    """Return a number in the form in which MuJoCo has it: of some versions the first of a polynomial's coefficients."""
    return value if np.ndim(old) == 0 else [value, *np.zeros(np.size(old) - 1)]


def _joint_names(spec: mujoco.MjSpec) -> list[str]:
    return [joint.name or f"joint_{k}" for k, joint in enumerate(spec.joints)]


def _replace_geoms(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, pieces: Sequence[Mesh], has_visuals: bool, folder: Path, name: str
) -> None:
    """Give a body of an MJCF other colliders; the old ones stay to be seen where nothing else is."""
    friction = None
    for geom in list(body.geoms):
        if (geom.contype or geom.conaffinity) and geom.type not in (
            mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD,
        ):  # fmt: skip
            friction = list(geom.friction) if friction is None else friction
            if has_visuals:
                spec.delete(geom)
            else:
                geom.contype = geom.conaffinity = 0
    names = _free_names(f"{name}_hull_", [mesh.name for mesh in spec.meshes])
    for k, mesh in enumerate(pieces):
        asset = spec.add_mesh(name=next(names))
        asset.scale = [1.0, 1.0, 1.0]  # not that of the file's default class
        asset.file = str(folder.absolute() / _hull_file(folder, name, k, mesh))
        geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=asset.name, group=3, mass=0.0)
        geom.contype = geom.conaffinity = 1
        if friction is not None:
            geom.friction = friction


def _write_usd(asset: Asset, edits: Edits, folder: Path, home: Path) -> None:
    """Write a layer over the original, which stays as it is."""
    original = Usd.Stage.Open(str(asset.path))
    layer = Sdf.Layer.CreateNew(str(folder / asset.path.name))
    layer.subLayerPaths.append(str(asset.path.resolve()))
    if original.GetDefaultPrim():
        layer.defaultPrim = original.GetDefaultPrim().GetName()
    _override(Usd.Stage.Open(layer), asset, edits)
    layer.subLayerPaths[0] = os.path.relpath(asset.path.resolve(), home)
    layer.Save()


def _override(stage: Usd.Stage, asset: Asset, edits: Edits) -> None:
    """Write edits over the prims of a stage."""
    UsdGeom.SetStageMetersPerUnit(stage, asset.units[0] or 1.0)
    UsdGeom.SetStageUpAxis(stage, asset.units[1] or UsdGeom.GetFallbackUpAxis())
    prims = {str(prim.GetPath()).replace("/", "_"): prim for prim in stage.Traverse()}
    for name, (mass, center, inertia) in edits.masses.items():
        api = UsdPhysics.MassAPI.Apply(prims[name])
        moments, axes = np.linalg.eigh(inertia)
        axes[:, 2] *= np.linalg.det(axes)
        x, y, z, w = map(float, Rotation.from_matrix(axes).as_quat())
        api.CreateMassAttr(float(mass))
        api.CreateCenterOfMassAttr(Gf.Vec3f(*map(float, center)))
        api.CreateDiagonalInertiaAttr(Gf.Vec3f(*map(float, moments)))
        api.CreatePrincipalAxesAttr(Gf.Quatf(w, x, y, z))
    for name, pieces in edits.colliders.items():
        owner = prims[name] if name != WORLD else stage.GetDefaultPrim() or stage.GetPseudoRoot().GetChildren()[0]
        for prim in Usd.PrimRange(owner) if name != WORLD else stage.Traverse():
            if prim.HasAPI(UsdPhysics.CollisionAPI) and _body_of(prim) == (owner if name != WORLD else None):
                if not prim.IsA(UsdGeom.Plane):
                    UsdPhysics.CollisionAPI(prim).CreateCollisionEnabledAttr(False)
        names = _free_names("hull_", owner.GetAllChildrenNames())
        for mesh in pieces:
            hull = UsdGeom.Mesh.Define(stage, owner.GetPath().AppendChild(next(names)))
            hull.CreatePointsAttr(_local(owner, mesh.vertices, name == WORLD))
            hull.CreateFaceVertexCountsAttr([3] * len(mesh.faces))
            hull.CreateFaceVertexIndicesAttr(mesh.faces.ravel().tolist())
            hull.CreatePurposeAttr(UsdGeom.Tokens.guide)
            hull.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
            UsdPhysics.CollisionAPI.Apply(hull.GetPrim())
            UsdPhysics.MeshCollisionAPI.Apply(hull.GetPrim()).CreateApproximationAttr(UsdPhysics.Tokens.convexHull)
    for name, value in edits.damping.items():
        # of a hinge [N m s/degree], as USD counts angles
        scale = np.pi / 180.0 if prims[name].IsA(UsdPhysics.RevoluteJoint) else 1.0
        prims[name].CreateAttribute("newton:damping", Sdf.ValueTypeNames.Float).Set(float(value) * scale)
    for name, limits in edits.limits.items():
        turn = prims[name].IsA(UsdPhysics.RevoluteJoint)
        low, high = map(float, np.degrees(limits) if turn else limits)
        joint = UsdPhysics.RevoluteJoint(prims[name]) if turn else UsdPhysics.PrismaticJoint(prims[name])
        joint.CreateLowerLimitAttr(low)
        joint.CreateUpperLimitAttr(high)


def _body_of(prim: Usd.Prim) -> Usd.Prim | None:
    """Return the body that a prim belongs to; None: it does not move."""
    while prim and not prim.HasAPI(UsdPhysics.RigidBodyAPI):
        prim = prim.GetParent()
    return prim or None


def _local(owner: Usd.Prim, points: np.ndarray, fixed: bool) -> np.ndarray:
    """Return points [n 3] of a body's frame, or of the world with z up where it is `fixed`, in a prim's own coordinates."""
    whole = UsdGeom.XformCache().GetLocalToWorldTransform(owner)
    frame = np.array(whole.RemoveScaleShear())
    if fixed:
        frame = np.eye(4)
        if UsdGeom.GetStageUpAxis(owner.GetStage()) == UsdGeom.Tokens.y:  # (x, -z, y) is (x, y, z) with z up
            frame[1:3, 1:3] = [[0.0, -1.0], [1.0, 0.0]]
    moved = np.c_[points, np.ones(len(points))] @ frame @ np.linalg.inv(np.array(whole))
    return moved[:, :3]


def same_visuals(one: Asset, other: Asset) -> bool:
    """Return whether two assets look and are jointed alike: the surfaces of each body, and the axes of each joint."""
    if one.bodies.keys() != other.bodies.keys() or one.joints.keys() != other.joints.keys():
        return False
    for name, body in one.bodies.items():
        seen, again = (_seen(each) for each in (body, other.bodies[name]))
        if body.visuals and (seen.shape != again.shape or np.abs(seen - again).max(initial=0.0) > 1e-5):
            return False
        if np.abs(body.pose - other.bodies[name].pose).max() > 1e-5:
            return False
    return all(
        np.allclose(joint.motion.axis, other.joints[name].motion.axis, atol=1e-5)
        and np.allclose(joint.motion.origin, other.joints[name].motion.origin, atol=1e-5)
        for name, joint in one.joints.items()
    )


def _seen(body: AssetBody) -> np.ndarray:
    points = [mesh.vertices for mesh in body.visuals]
    return np.concatenate(points) if points else np.zeros((0, 3))


def described(edits: Edits) -> list[Check]:
    """Return what a repair changed as checks of its report."""
    return [Check("repaired", "info", message=note) for note in edits.notes]
