"""An asset that others made: one object or a room as URDF, MJCF or USD, as MuJoCo and Newton read it."""

import contextlib
import io
import logging
import re
import warnings
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import mujoco
import newton
import numpy as np
import trimesh
import warp as wp
from pxr import Usd

from s2a.core.errors import InputError
from s2a.core.outputs import temporary_folder
from s2a.scene.geometry.convex import hull
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Joint, Mesh
from s2a.scene.usd.sim_scene import Collider, Mass, SimBody
from s2a.scene.usd.stage import reading

FORMATS = {
    ".urdf": "URDF",
    ".xml": "MJCF",
    ".mjcf": "MJCF",
    ".usd": "USD",
    ".usda": "USD",
    ".usdc": "USD",
    ".usdz": "USD",
}
WORLD = "world"  # Name of what does not move
CHAIN = 3  # Moving joints in series from which on a file without motors is of a robot, whose joints are driven
MAX_STL = 200_000  # Faces of an STL file that MuJoCo reads
MAX_MESH_BYTES, MAX_BYTES = 500_000_000, 50_000_000
MIN_MASS = (
    1e-6,
    1e-10,
)  # [kg], [kg m^2] What a body gets that has no mass or no inertia, so that all else can be asked
HINGE, SLIDE, FREE = (
    int(each) for each in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_FREE)
)
PLANE = int(mujoco.mjtGeom.mjGEOM_PLANE)
DROP = 0.05  # [m] Height from which what is free falls
SEGMENTS = 24  # Sides of a round shape as a mesh: of 50 mm radius exact to 0.4 mm
RESOLVED = "asset"  # Name of the copy whose meshes are resolved


@dataclass(frozen=True)
class AssetBody:
    """One body, or link, at the rest pose."""

    name: str
    parent: str  # name of the body that it hangs on
    rigid: str  # name of the first of the bodies that are welded to each other; WORLD: it does not move
    pose: np.ndarray = field(repr=False)  # in the world, shape [4 4]
    mass: float  # [kg]
    center: np.ndarray = field(repr=False)  # of mass in its frame [m], shape [3]
    inertia: np.ndarray = field(repr=False)  # about the centre, in its frame [kg m^2], shape [3 3]
    visuals: tuple[Mesh, ...] = field(repr=False)  # in its frame
    colliders: tuple[Mesh, ...] = field(repr=False)  # their convex hulls, as simulators take them, in its frame
    shapes: tuple[str, ...] = ()  # kind of each collider: mesh, box, ...


@dataclass(frozen=True)
class AssetJoint:
    """One hinge or slide at the rest pose."""

    name: str
    body: str  # that it moves
    motion: Joint  # in the world; limits relative to the rest pose
    rest: float  # coordinate of the rest pose [m or rad]
    limited: bool  # The file states limits; of a hinge without them the motion goes half a turn to either side
    driven: bool  # A motor moves it
    damping: float  # [N s/m] or [N m s/rad]


@dataclass(frozen=True)
class Asset:
    """What a file holds, as MuJoCo and Newton read it.

    Attributes:
        path: the file.
        kind: URDF, MJCF or USD.
        bodies: by name.
        joints: hinges and slides that move, by name.
        models: MuJoCo's model of it by the engine that read the file.
        grounds: the same over ground, DROP below what is free and has no planes of its own.
        problems: what an engine says of a file that it cannot read, or reads only where its faults are corrected.
        free: its first body falls, for nothing holds it.
        swapped: joints whose lower limit is above the upper one.
        unsound: bodies whose stated moments of inertia no body has.
        hidden: pairs of bodies that the file excludes from contacts.
        units: metres of one unit and the up axis, as a USD states them; None for what it does not state.
    """

    path: Path
    kind: str
    bodies: Mapping[str, AssetBody]
    joints: Mapping[str, AssetJoint]
    models: Mapping[str, mujoco.MjModel] = field(repr=False)
    grounds: Mapping[str, mujoco.MjModel] = field(repr=False)
    problems: Mapping[str, str]
    free: bool
    swapped: tuple[str, ...] = ()
    unsound: tuple[str, ...] = ()
    hidden: int = 0
    units: tuple[float | None, str | None] = (1.0, "Z")

    @cached_property
    def moving(self) -> dict[str, list[AssetBody]]:
        """Bodies that are welded to each other, by the first of them; WORLD: those that do not move."""
        groups: dict[str, list[AssetBody]] = {}
        for body in self.bodies.values():
            groups.setdefault(body.rigid, []).append(body)
        return groups

    @cached_property
    def parents(self) -> dict[str, str]:
        """What each group of welded bodies moves against."""
        return {name: self.bodies[self.bodies[name].parent].rigid for name in self.moving if name != WORLD}

    def sim_bodies(self) -> dict[str, SimBody]:
        """Return each group of welded bodies with its colliders in the world; each collider names its body."""
        return {
            name: SimBody(
                name,
                merge([placed(mesh, body.pose) for body in group for mesh in body.visuals]),
                tuple(Collider(body.name, placed(mesh, body.pose)) for body in group for mesh in body.colliders),
                Mass(1.0, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)),
            )
            for name, group in self.moving.items()
        }


def recognise(path: Path) -> str:
    """Return the format of a file: URDF, MJCF or USD.

    Raises:
        InputError: no such file, or one of another format.
    """
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "does not exist"
        raise InputError(f"asset {str(path)!r} {what}; give a URDF, MJCF or USD file")
    kind = FORMATS.get(path.suffix.lower())
    if kind is None:
        raise InputError(f"asset {str(path)!r}: {path.suffix or 'no ending'}; possible: {', '.join(FORMATS)}")
    if kind == "USD":
        return kind
    if path.stat().st_size > MAX_BYTES:
        raise InputError(f"{path}: {path.stat().st_size / 1e6:.0f} MB are too many for XML; give one below 50 MB")
    root = xml(path).tag
    if root not in ("robot", "mujoco"):
        raise InputError(f"{path}: its root is <{root}>; expected <robot> of a URDF or <mujoco> of an MJCF")
    return "URDF" if root == "robot" else "MJCF"


def xml(path: Path) -> ElementTree.Element:
    """Return the root of an XML file; InputError: it is none, or declares entities, which can fill the memory."""
    text = path.read_bytes()
    if b"<!ENTITY" in text or b"\0" in text:
        raise InputError(f"{path}: declares entities, or is not UTF-8; remove them")
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"{path}: not XML ({error}); write it again") from error


def read(path: Path) -> Asset:
    """Read an asset with MuJoCo and Newton.

    A URDF's root falls freely where it has mass and collides, as in PyBullet; else it is fixed, as in MuJoCo.

    Raises:
        InputError: no such file, another format, missing meshes, or nothing that MuJoCo can simulate.
    """
    kind = recognise(path)
    with temporary_folder() as folder, wp.ScopedDevice("cpu"), quiet():
        source, swapped = _resolved(path, folder) if kind == "URDF" else (path, ())
        free = _falls(xml(path), kind) if kind != "USD" else False
        builder, problem = _newton(source, kind, free)
        problems = {"Newton": problem} if problem else {}
        specs, models = {}, {}
        if builder is not None and not problem:
            spec, text = _solved(builder, folder)
            if spec is None:
                problems["Newton"] = text
            else:
                specs["Newton"], models["Newton"] = spec, spec.compile()
        if kind != "USD":
            try:
                spec, more = _spec(source, path, free)
                swapped += more
                models["MuJoCo"], problem = _compiled(spec, path)
            except InputError as error:
                if not models:
                    raise
                problem = str(error).removeprefix(f"{path}: ")
            else:
                specs["MuJoCo"] = spec
            if problem:
                problems["MuJoCo"] = problem
        if not models:
            raise InputError(f"{path}: Newton cannot read this USD: {problems['Newton']}; correct the file")
        model = models.get("MuJoCo") or models["Newton"]
        asset = replace(_extracted(path, kind, model, problems), swapped=swapped)
        if not any(body.visuals or body.colliders or body.mass for body in asset.bodies.values()):
            raise InputError(f"{path}: holds no body; give a URDF, MJCF or USD of an object or a room")
        if "MuJoCo" in specs:
            asset = replace(asset, unsound=tuple(b.name for b in specs["MuJoCo"].bodies if b.name and not _sound(b)))
        grounds = {engine: _grounded(specs[engine], each) for engine, each in models.items()}
        asset = replace(asset, models=models, grounds=grounds)
        return _with_usd(asset, builder) if builder is not None and kind == "USD" else asset


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Keep the importers' notes, of which a report has its own, off the terminal."""
    level = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(level)


def placed(mesh: Mesh, pose: np.ndarray) -> Mesh:
    """Return a mesh at a pose [4 4]."""
    return Mesh(mesh.vertices.astype(np.float64) @ pose[:3, :3].T + pose[:3, 3], mesh.faces, mesh.colors)


def mesh_file(folder: Path, name: str) -> Path:
    """Return the file that a URDF names from its folder: a path, a file: or a package: address.

    Raises:
        InputError: there is none.
    """
    plain = re.sub(r"^(file|package|model)://", "", name)
    above = [folder, *folder.resolve().parents]
    # a package is a folder above the file, or beside one of those
    for base in above:
        for tail in (plain, plain.partition("/")[2]) if "://" in name else (plain,):
            if tail and (file := base / tail).is_file():
                return file
        if "://" not in name:
            break
    raise InputError(f"{folder}: no mesh {name!r}, which the asset names; put it there")


def _resolved(path: Path, folder: Path) -> tuple[Path, tuple[str, ...]]:
    """Write a URDF whose meshes MuJoCo finds and reads, with what MuJoCo has to be asked for, and limits in order.

    Returns:
        Its path, and the joints whose limits were not in order, which MuJoCo would take for endless ones.
    """
    robot, swapped = xml(path), []
    for joint in robot.findall("joint"):
        name, limit = str(joint.get("name")), joint.find("limit")
        ends = ("0", "0") if limit is None else (limit.get("lower", "0"), limit.get("upper", "0"))
        try:
            low, high = map(float, ends)
        except ValueError as error:
            raise InputError(
                f"{path}: joint {name!r} has the limits {ends[0]!r} and {ends[1]!r}; give numbers"
            ) from error
        if limit is not None and low > high:
            limit.attrib |= {"lower": ends[1], "upper": ends[0]}
            swapped.append(name)
    for k, shape in enumerate(robot.iter("mesh")):
        file = mesh_file(path.parent, str(shape.get("filename")))
        if file.stat().st_size > MAX_MESH_BYTES:
            raise InputError(f"{file}: {file.stat().st_size / 1e6:.0f} MB; give meshes below 500 MB")
        shape.set("filename", _readable(file, folder / f"mesh{k}").name)
    for old in robot.findall("mujoco"):
        robot.remove(old)
    for joint in robot.findall("joint"):
        if joint.get("type") == "floating":  # MuJoCo's own free joint, which only a root has
            joint.set("type", "fixed")
    options = {"meshdir": str(folder), "strippath": "true", "discardvisual": "false", "fusestatic": "false"}
    ElementTree.SubElement(ElementTree.SubElement(robot, "mujoco"), "compiler", options)
    target = folder / f"{RESOLVED}.urdf"
    ElementTree.ElementTree(robot).write(target)
    return target, tuple(swapped)


def _readable(file: Path, target: Path) -> Path:
    """Put a mesh where MuJoCo reads it; return that path."""
    suffix = file.suffix.lower()
    if suffix == ".stl":
        head = file.open("rb").read(84)
        count = int.from_bytes(head[80:84], "little")
        if file.stat().st_size == 84 + 50 * count and count < MAX_STL:
            (link := target.with_suffix(".stl")).symlink_to(file.resolve())
            return link
    try:
        mesh = trimesh.load(str(file), force="mesh", skip_materials=True)
    except Exception as error:  # of any of trimesh's readers
        raise InputError(f"{file}: cannot be read as a mesh ({' '.join(str(error).split())[:100]})") from error
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise InputError(f"{file}: holds no triangles; give a mesh")
    if suffix == ".dae" and (unit := str(mesh.units).removesuffix(" * meters")) != str(mesh.units):
        mesh.apply_scale(float(unit))  # as ROS does; trimesh leaves it to others
    mesh.visual = trimesh.visual.ColorVisuals()
    mesh.export(str(target.with_suffix(".obj")), include_texture=False, include_normals=False)
    return target.with_suffix(".obj")


def _falls(root: ElementTree.Element, kind: str) -> bool:
    """Return whether nothing holds an asset: a URDF's root has mass and collides, an MJCF is one body without a joint."""
    if kind == "MJCF":
        moves = any(
            root.find(f".//{tag}") is not None for tag in ("joint", "freejoint", "actuator", "include", "replicate")
        )
        return not moves and len(root.findall("worldbody/body")) == 1
    ends = [joint.find("child") for joint in root.findall("joint")]
    children = {str(end.get("link")) for end in ends if end is not None}
    roots = [link for link in root.findall("link") if link.get("name") not in children]
    mass = roots[0].find("inertial/mass") if roots else None
    # Bullet's models say by a mass of 0 that a link is fixed
    return mass is not None and mass.get("value") not in ("0", "0.0", ".0") and roots[0].find("collision") is not None


def _newton(source: Path, kind: str, free: bool) -> tuple[newton.ModelBuilder | None, str]:
    """Return Newton's builder of an asset, and what Newton says of one that it cannot read."""
    builder = newton.ModelBuilder()
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    try:
        if kind == "URDF":
            builder.add_urdf(str(source), floating=free)
        elif kind == "MJCF":
            builder.add_mjcf(str(source), floating=free or None)
        else:
            builder.add_usd(str(source), apply_up_axis_from_stage=False)
    except Exception as error:  # of any of its importers
        return None, _line(error)
    return builder, "" if builder.body_count else "no body moves"


def _solved(builder: newton.ModelBuilder, folder: Path) -> tuple[mujoco.MjSpec | None, str]:
    """Return what Newton read as its own writer gives it to MuJoCo, and what went wrong."""
    try:
        model = builder.finalize(device="cpu")
        file = folder / "newton.xml"
        newton.solvers.SolverMuJoCo(model, use_mujoco_cpu=True, save_to_mjcf=str(file), skip_visual_only_geoms=True)
        spec = mujoco.MjSpec.from_file(str(file))
        for geom in spec.geoms:  # Newton's masks repeat its filters, in bits of which the ground knows nothing
            geom.contype = geom.conaffinity = 1
        spec.compile()
        return spec, ""
    except Exception as error:  # of Newton's conversion or MuJoCo's compiler
        return None, _line(error)


def _line(error: Exception) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"


def _spec(source: Path, path: Path, free: bool) -> tuple[mujoco.MjSpec, tuple[str, ...]]:
    """Return MuJoCo's description of a file, limits in the right order, and the joints whose limits were not."""
    try:
        spec = mujoco.MjSpec.from_file(str(source))
    except (ValueError, OSError) as error:
        raise InputError(f"{path}: MuJoCo cannot read it: {' '.join(str(error).split())[:300]}") from error
    swapped = []
    for k, joint in enumerate(spec.joints):
        low, high = joint.range
        if low > high and joint.limited != mujoco.mjtLimited.mjLIMITED_FALSE:
            swapped.append(joint.name or f"joint_{k}")
            joint.range = [high, low]
    if free and (root := spec.worldbody.first_body()) is not None and not root.joints:
        root.add_freejoint()
    return spec, tuple(swapped)


def _sound(body: mujoco.MjsBody) -> bool:
    """Return whether a body's moments of inertia, where a file states them, can be those of a body."""
    xx, yy, zz, xy, xz, yz = body.fullinertia
    full = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    moments = np.linalg.eigvalsh(full) if np.isfinite(full).all() else np.sort(body.inertia)
    if not body.explicitinertial or not np.isfinite(moments).all():
        return True
    return bool(moments[0] > 0.0 and moments[2] <= (moments[0] + moments[1]) * (1.0 + 1e-6))


def _compiled(spec: mujoco.MjSpec, path: Path) -> tuple[mujoco.MjModel, str]:
    """Return the compiled model, and why MuJoCo compiles it only with masses and inertias that are corrected."""
    try:
        return spec.compile(), ""
    except ValueError as error:
        problem = _line(error)
    spec.compiler.balanceinertia = True
    spec.compiler.boundmass, spec.compiler.boundinertia = MIN_MASS
    try:
        return spec.compile(), problem
    except ValueError as error:
        raise InputError(f"{path}: MuJoCo cannot read it: {' '.join(str(error).split())[:300]}") from error


def _grounded(spec: mujoco.MjSpec, model: mujoco.MjModel) -> mujoco.MjModel:
    """Return a model with ground below what is free; the same model where nothing is, or where it has planes of its own."""
    if not (model.jnt_type == FREE).any() or (model.geom_type == PLANE).any():
        return model
    at = [0.0, 0.0, _lowest(model) - DROP]
    spec.worldbody.add_geom(name="s2a_ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0], pos=at)
    return spec.compile()


def _lowest(model: mujoco.MjModel) -> float:
    """Return the lowest point of the colliders at rest [m]."""
    data, lowest = rest_state(model), []
    for geom in np.flatnonzero((model.geom_contype != 0) | (model.geom_conaffinity != 0)):
        center, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
        turn = data.geom_xmat[geom].reshape(3, 3)
        lowest.append(data.geom_xpos[geom][2] + turn[2] @ center - np.abs(turn[2]) @ half)
    return float(min(lowest, default=0.0))


def rest_state(model: mujoco.MjModel) -> mujoco.MjData:
    """Return the rest pose: the first keyframe, or all at their reference; within limits."""
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    for joint in range(model.njnt):
        if model.jnt_limited[joint] and model.jnt_type[joint] in (HINGE, SLIDE):
            at = model.jnt_qposadr[joint]
            data.qpos[at] = np.clip(data.qpos[at], *model.jnt_range[joint])
    mujoco.mj_forward(model, data)
    return data


def _extracted(
    path: Path,
    kind: str,
    model: mujoco.MjModel,
    problems: Mapping[str, str],
) -> Asset:
    """Return the bodies and joints of a compiled model."""
    data = rest_state(model)
    names = [WORLD, *(model.body(i).name or f"body_{i}" for i in range(1, model.nbody))]
    bodies = {}
    for i, name in enumerate(names):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = data.xmat[i].reshape(3, 3), data.xpos[i]
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.body_iquat[i])
        axes = turn.reshape(3, 3)
        shapes = range(model.body_geomadr[i], model.body_geomadr[i] + model.body_geomnum[i])
        solid = [g for g in shapes if model.geom_contype[g] or model.geom_conaffinity[g]]
        visuals = [m for g in shapes if g not in solid and (m := _shape(model, g)) is not None]
        colliders, kinds = [], []
        for g in solid:
            if (piece := _convex(model, g)) is not None:
                colliders.append(piece)
                kinds.append(_geom_kind(model, g))
        bodies[name] = AssetBody(
            name,
            names[model.body_parentid[i]],
            names[model.body_weldid[i]],
            pose,
            float(model.body_mass[i]),
            model.body_ipos[i].copy(),
            axes @ np.diag(model.body_inertia[i]) @ axes.T,
            tuple(visuals),
            tuple(colliders),
            tuple(kinds),
        )
    driven, joints = _driven(model), {}
    for j in range(model.njnt):
        if model.jnt_type[j] not in (HINGE, SLIDE):
            continue
        hinge, limited = model.jnt_type[j] == HINGE, bool(model.jnt_limited[j])
        q = float(data.qpos[model.jnt_qposadr[j]])
        low, high = model.jnt_range[j] - q if limited else ((-np.pi, np.pi) if hinge else (0.0, 0.0))
        motion = Joint(
            "revolute" if hinge else "prismatic",
            tuple(data.xaxis[j]),
            tuple(data.xanchor[j]),
            (min(float(low), 0.0), max(float(high), 0.0)),
        )
        name, body = model.joint(j).name or f"joint_{j}", names[model.jnt_bodyid[j]]
        motor = bool(driven[j]) or (not model.nu and _chain(model, j) >= CHAIN)
        joints[name] = AssetJoint(name, body, motion, q, limited, motor, float(model.dof_damping[model.jnt_dofadr[j]]))
    free = bool((model.jnt_type == FREE).any())
    return Asset(path, kind, bodies, joints, {}, {}, problems, free, hidden=int(model.nexclude))


def _driven(model: mujoco.MjModel) -> np.ndarray:
    """Return which joints a motor moves, by itself or by a tendon, shape [joint]."""
    driven = np.zeros(model.njnt, bool)
    for i in range(model.nu):
        target = int(model.actuator_trnid[i, 0])
        if model.actuator_trntype[i] in (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT):
            driven[target] = True
        elif model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_TENDON:
            first, count = int(model.tendon_adr[target]), int(model.tendon_num[target])
            wraps = range(first, first + count)
            driven[[model.wrap_objid[w] for w in wraps if model.wrap_type[w] == mujoco.mjtWrap.mjWRAP_JOINT]] = True
            sites = [
                model.site_bodyid[model.wrap_objid[w]]
                for w in wraps
                if model.wrap_type[w] == mujoco.mjtWrap.mjWRAP_SITE
            ]
            driven[np.isin(model.jnt_bodyid, sites)] = True
    return driven


def _chain(model: mujoco.MjModel, joint: int) -> int:
    """Return how many joints move in the longest series that a joint is in."""
    depth = np.zeros(model.nbody, int)
    for body in range(1, model.nbody):
        depth[body] = depth[model.body_parentid[body]] + int(model.body_jntnum[body] > 0)
    below = [b for b in range(model.nbody) if _above(model, b, int(model.jnt_bodyid[joint]))]
    return int(max(depth[below], default=0)) - int((model.jnt_type == FREE).any())


def _above(model: mujoco.MjModel, body: int, other: int) -> bool:
    """Return whether a body is another one, or hangs on it."""
    while body > other:
        body = int(model.body_parentid[body])
    return body == other


def _primitive(kind: str, size: np.ndarray) -> Mesh | None:
    """Return a shape with the half extents or the radius and half length of MuJoCo and Newton; None for an endless one."""
    makers: dict[str, Callable[[], trimesh.Trimesh]] = {
        "box": lambda: trimesh.creation.box(2 * size),
        "sphere": lambda: trimesh.creation.icosphere(3, size[0]),
        "ellipsoid": lambda: trimesh.creation.icosphere(3).apply_scale(size),
        "cylinder": lambda: trimesh.creation.cylinder(size[0], 2 * size[1], SEGMENTS),
        "capsule": lambda: trimesh.creation.capsule(2 * size[1], size[0], count=[SEGMENTS, SEGMENTS]),
    }
    made = makers[kind]() if kind in makers else None
    return None if made is None else Mesh(made.vertices, made.faces)


def _geom_kind(model: mujoco.MjModel, geom: int) -> str:
    return str(mujoco.mjtGeom(model.geom_type[geom]).name).removeprefix("mjGEOM_").lower()


def _shape(model: mujoco.MjModel, geom: int) -> Mesh | None:
    """Return a shape's surface in its body's frame; None for a plane, a height field, or nothing."""
    kind, surface = _geom_kind(model, geom), None
    if kind == "mesh":
        m = model.geom_dataid[geom]
        first, count = model.mesh_vertadr[m], model.mesh_vertnum[m]
        begin, faces = model.mesh_faceadr[m], model.mesh_facenum[m]
        surface = Mesh(model.mesh_vert[first : first + count], model.mesh_face[begin : begin + faces])
    elif (surface := _primitive(kind, model.geom_size[geom])) is None:
        return None
    turn, moved = np.zeros(9), np.eye(4)
    mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
    moved[:3, :3], moved[:3, 3] = turn.reshape(3, 3), model.geom_pos[geom]
    return placed(surface, moved)


def _convex(model: mujoco.MjModel, geom: int) -> Mesh | None:
    """Return a collider's convex hull in its body's frame; None for what has none."""
    surface = _shape(model, geom)
    return None if surface is None else hull(surface.vertices)


def _with_usd(asset: Asset, builder: newton.ModelBuilder) -> Asset:
    """Add what is seen of a USD, which MuJoCo's model of it does not hold, and its units."""
    with reading(asset.path):
        stage = Usd.Stage.Open(str(asset.path))
    per, up = (
        stage.GetRootLayer().pseudoRoot.GetInfo("metersPerUnit"),
        stage.GetRootLayer().pseudoRoot.GetInfo("upAxis"),
    )
    stated = stage.HasAuthoredMetadata("metersPerUnit"), stage.HasAuthoredMetadata("upAxis")
    seen: dict[str, list[Mesh]] = {}
    for i in range(builder.shape_count):
        flags, owner = int(builder.shape_flags[i]), int(builder.shape_body[i])
        if flags & int(newton.ShapeFlags.VISIBLE) and (mesh := _newton_shape(builder, i)) is not None:
            name = WORLD if owner < 0 else str(builder.body_label[owner]).replace("/", "_")
            seen.setdefault(name, []).append(mesh)
    bodies = {name: replace(body, visuals=tuple(seen.get(name, body.visuals))) for name, body in asset.bodies.items()}
    units = (float(per) if stated[0] else None, str(up) if stated[1] else None)
    return replace(asset, bodies=bodies, units=units)


def _newton_shape(builder: newton.ModelBuilder, shape: int) -> Mesh | None:
    """Return a shape that Newton read, in its body's frame; None for a plane or a height field."""
    source, size = builder.shape_source[shape], np.array(builder.shape_scale[shape], float)
    if isinstance(source, newton.Mesh):
        surface: Mesh | None = Mesh(np.asarray(source.vertices) * size, np.asarray(source.indices).reshape(-1, 3))
    else:
        surface = _primitive(newton.GeoType(int(builder.shape_type[shape])).name.lower(), size)
    place, pose, turn = np.array(builder.shape_transform[shape], float), np.eye(4), np.zeros(9)
    mujoco.mju_quat2Mat(turn, np.roll(place[3:], 1))
    pose[:3, :3], pose[:3, 3] = turn.reshape(3, 3), place[:3]
    return None if surface is None else placed(surface, pose)
