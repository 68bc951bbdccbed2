"""MJCF files as URDF: links, joints and shapes as MuJoCo compiles them, closed loops as mimic joints."""

import hashlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from s2a.core import cache
from s2a.core.errors import InputError

EFFORT = "1000"  # [N or N m] Effort limit of a joint that the robot's YAML gives none
SAMPLES = 9  # Positions of the gripper's drive at which the joints of its linkage are read
SETTLE = 1500  # Time steps that the linkage takes to come to rest at each of them
LINEAR = 0.05  # [rad or m] Largest deviation of a joint from a linear function of the finger joint that it follows


def read(path: Path, arm: Sequence[str], fingers: Sequence[str]) -> ElementTree.Element:
    """Return an MJCF file as a URDF: a link for every body and the world, its frame the body's, at its joint's position.

    Where bodies form closed loops, or joints are tied to each other, the drives of the file (all actuated joints that are not the
    arm's) are moved through their range in a simulation without gravity, and every joint that moves with them mimics the nearest
    finger joint.

    Raises:
        InputError: MuJoCo cannot read the file; a body has several joints, or a ball or free joint; a joint of the linkage is no
            linear function of its finger joint.
    """
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise InputError(f"{path}: MuJoCo cannot read this MJCF: {' '.join(str(error).split())}") from error
    robot = ElementTree.Element("robot", {"name": path.stem})
    ElementTree.SubElement(robot, "link", {"name": _name(model, 0)})
    meshes = cache.folder() / "robots" / hashlib.blake2b(_content(path, model), digest_size=12).hexdigest()
    for body in range(1, model.nbody):
        if model.body_jntnum[body] > 1:
            raise InputError(
                f"{path}: body {model.body(body).name!r} has {model.body_jntnum[body]} joints; expected one"
            )
        robot.append(_link(model, body, meshes))
    for body in range(1, model.nbody):
        robot.append(_joint(path, model, body))
    for name, (finger, offset, multiplier) in _followers(path, model, arm, fingers).items():
        joint = robot.find(f"joint[@name='{name}']")
        assert joint is not None
        attributes = {"joint": finger, "multiplier": repr(multiplier), "offset": repr(offset)}
        ElementTree.SubElement(joint, "mimic", attributes)
    return robot


def _content(path: Path, model: mujoco.MjModel) -> bytes:
    return path.read_bytes() + model.mesh_vert.tobytes() + model.mesh_face.tobytes()


def _name(model: mujoco.MjModel, body: int) -> str:
    return str(model.body(body).name or f"body_{body}")


def _anchor(model: mujoco.MjModel, body: int) -> np.ndarray:
    """Return where the joint of a body is in its frame [m], shape [3]: the origin of its link."""
    first = model.body_jntadr[body]
    return model.jnt_pos[first] if first >= 0 else np.zeros(3)


def _pose(element: ElementTree.Element, position: np.ndarray, quat: np.ndarray) -> None:
    """Add an <origin> at a position [3] with a quaternion wxyz."""
    angles = Rotation.from_quat(np.roll(quat, -1)).as_euler("xyz", suppress_warnings=True)
    ElementTree.SubElement(element, "origin", {"xyz": _words(position), "rpy": _words(angles)})


def _words(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)


def _link(model: mujoco.MjModel, body: int, meshes: Path) -> ElementTree.Element:
    link, anchor = ElementTree.Element("link", {"name": _name(model, body)}), _anchor(model, body)
    if model.body_mass[body] > 0.0:
        inertial = ElementTree.SubElement(link, "inertial")
        _pose(inertial, model.body_ipos[body] - anchor, model.body_iquat[body])
        ElementTree.SubElement(inertial, "mass", {"value": repr(float(model.body_mass[body]))})
        moments = {key: repr(float(v)) for key, v in zip(("ixx", "iyy", "izz"), model.body_inertia[body], strict=True)}
        ElementTree.SubElement(inertial, "inertia", {"ixy": "0", "ixz": "0", "iyz": "0"} | moments)
    first = model.body_geomadr[body]
    for geom in range(first, first + model.body_geomnum[body]) if first >= 0 else ():
        collides = bool(model.geom_contype[geom] | model.geom_conaffinity[geom])
        element = ElementTree.Element("collision" if collides else "visual")
        _pose(element, model.geom_pos[geom] - anchor, model.geom_quat[geom])
        geometry = ElementTree.SubElement(element, "geometry")
        if _shape(model, geom, geometry, meshes):
            link.append(element)
    return link


def _shape(model: mujoco.MjModel, geom: int, geometry: ElementTree.Element, meshes: Path) -> bool:
    """Add a geom's shape; return whether URDF has one of its kind, or a mesh stands for it."""
    kinds, size = mujoco.mjtGeom, [float(x) for x in model.geom_size[geom]]
    kind = kinds(model.geom_type[geom])
    if kind == kinds.mjGEOM_BOX:
        ElementTree.SubElement(geometry, "box", {"size": _words(2.0 * np.array(size))})
    elif kind == kinds.mjGEOM_SPHERE:
        ElementTree.SubElement(geometry, "sphere", {"radius": repr(size[0])})
    elif kind in (kinds.mjGEOM_CYLINDER, kinds.mjGEOM_CAPSULE):
        tag, length = ("cylinder", "length") if kind == kinds.mjGEOM_CYLINDER else ("capsule", "height")
        ElementTree.SubElement(geometry, tag, {"radius": repr(size[0]), length: repr(2.0 * size[1])})
    elif kind == kinds.mjGEOM_ELLIPSOID:
        ball = trimesh.creation.icosphere(3).apply_scale(size)
        ElementTree.SubElement(geometry, "mesh", {"filename": str(_written(meshes / f"geom_{geom}.stl", ball))})
    elif kind == kinds.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        vertices, faces = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
        solid = trimesh.Trimesh(
            model.mesh_vert[vertices : vertices + model.mesh_vertnum[mesh]],
            model.mesh_face[faces : faces + model.mesh_facenum[mesh]],
            process=False,
        )
        ElementTree.SubElement(geometry, "mesh", {"filename": str(_written(meshes / f"mesh_{mesh}.stl", solid))})
    else:
        return False
    return True


def _written(path: Path, mesh: trimesh.Trimesh) -> Path:
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        aside = path.with_suffix(".part.stl")
        mesh.export(aside)
        aside.replace(path)
    return path


def _joint(path: Path, model: mujoco.MjModel, body: int) -> ElementTree.Element:
    """Return the joint between a body and its parent; a fixed one where it has none."""
    first, parent = int(model.body_jntadr[body]), int(model.body_parentid[body])
    name = str(model.joint(first).name or f"joint_{first}") if first >= 0 else f"{_name(model, body)}_fixed"
    kinds = {int(mujoco.mjtJoint.mjJNT_HINGE): "revolute", int(mujoco.mjtJoint.mjJNT_SLIDE): "prismatic"}
    if first >= 0 and int(model.jnt_type[first]) not in kinds:
        raise InputError(f"{path}: joint {name!r} is a ball or free joint; expected a hinge or a slide")
    kind = "fixed" if first < 0 else kinds[int(model.jnt_type[first])]
    if kind == "revolute" and not model.jnt_limited[first]:
        kind = "continuous"
    joint = ElementTree.Element("joint", {"name": name, "type": kind})
    rotation = Rotation.from_quat(np.roll(model.body_quat[body], -1))
    place = model.body_pos[body] + rotation.apply(_anchor(model, body)) - _anchor(model, parent)
    if first >= 0 and (ref := float(model.qpos0[model.jnt_qposadr[first]])):  # the file's pose is that at `ref`
        axis = model.jnt_axis[first]
        if kind == "prismatic":
            place = place - rotation.apply(ref * axis)
        else:
            rotation = rotation * Rotation.from_rotvec(-ref * axis)
    _pose(joint, place, np.roll(rotation.as_quat(), 1))
    ElementTree.SubElement(joint, "parent", {"link": _name(model, parent)})
    ElementTree.SubElement(joint, "child", {"link": _name(model, body)})
    if first >= 0:
        ElementTree.SubElement(joint, "axis", {"xyz": _words(model.jnt_axis[first])})
        low, high = model.jnt_range[first]
        ElementTree.SubElement(
            joint, "limit", {"lower": repr(float(low)), "upper": repr(float(high)), "effort": EFFORT}
        )
    return joint


def _followers(
    path: Path, model: mujoco.MjModel, arm: Sequence[str], fingers: Sequence[str]
) -> dict[str, tuple[str, float, float]]:
    """Return the joints that follow a finger joint: its name, offset and multiplier of each."""
    names = [str(model.joint(i).name) for i in range(model.njnt)]
    if not model.neq or not set(fingers) <= set(names):
        return {}
    drives = sorted(_actuated(model) - {names.index(name) for name in arm if name in names})
    drives = drives or [names.index(name) for name in fingers]
    moved = _sweep(model, drives)
    followers = {}
    leaders = [names.index(name) for name in fingers]
    for i, name in enumerate(names):
        if name in (*arm, *fingers) or np.ptp(moved[:, i]) < 1e-3:
            continue
        leader = _nearest(model, i, leaders)
        multiplier, offset = np.polyfit(moved[:, leader], moved[:, i], 1)
        if (off := np.abs(multiplier * moved[:, leader] + offset - moved[:, i]).max()) > LINEAR:
            raise InputError(
                f"{path}: joint {name!r} is off a linear function of {names[leader]!r} by up to {off:.3f}; "
                "only linkages of constant ratio are possible, such as a parallelogram"
            )
        followers[name] = names[leader], float(offset), float(multiplier)
    return followers


def _actuated(model: mujoco.MjModel) -> set[int]:
    """Return the joints that actuators drive, also by a tendon."""
    joints: set[int] = set()
    for kind, (target, _) in zip(model.actuator_trntype, model.actuator_trnid, strict=True):
        if kind == mujoco.mjtTrn.mjTRN_JOINT:
            joints.add(int(target))
        elif kind == mujoco.mjtTrn.mjTRN_TENDON:
            first = model.tendon_adr[target]
            joints.update(int(model.wrap_objid[k]) for k in range(first, first + model.tendon_num[target]))
    return joints


def _sweep(model: mujoco.MjModel, drives: Sequence[int]) -> np.ndarray:
    """Return the coordinates of all joints with the drives at positions between their limits, shape [sample joint]."""
    model.opt.gravity[:] = 0.0
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_ACTUATION
    model.dof_damping[:] = np.maximum(model.dof_damping, 1e-3)
    data, moved = mujoco.MjData(model), []
    at, dofs = model.jnt_qposadr, model.jnt_dofadr[list(drives)]
    model.dof_armature[dofs] = 1e3  # nothing moves a drive but this function
    low, high = model.jnt_range[list(drives)].T
    for fraction in np.linspace(0.0, 1.0, SAMPLES):
        goal, begin = low + fraction * (high - low), data.qpos[at[list(drives)]].copy()
        for step in range(SETTLE):
            data.qpos[at[list(drives)]] = begin + (goal - begin) * min(1.0, 2.0 * step / SETTLE)
            data.qvel[dofs] = 0.0
            mujoco.mj_step(model, data)
        moved.append(data.qpos[at].copy())
    return np.array(moved)


def _nearest(model: mujoco.MjModel, joint: int, leaders: Sequence[int]) -> int:
    """Return the finger joint on whose body the one of a joint hangs, else the nearest at the file's pose."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    body = int(model.jnt_bodyid[joint])
    above = {body}
    while body:
        body = int(model.body_parentid[body])
        above.add(body)
    hanging = [k for k in leaders if int(model.jnt_bodyid[k]) in above]
    away = [float(np.linalg.norm(data.xanchor[joint] - data.xanchor[k])) for k in leaders]
    return hanging[0] if hanging else leaders[int(np.argmin(away))]
