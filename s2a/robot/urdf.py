"""A robot's URDF or MJCF, reduced to one arm and its gripper.

The fingers are made alike: coordinate 0 where the pads touch, growing as they open, and no mimic tag (in MuJoCo it would
become a soft equality; the fingers are driven one by one). Other joints of a gripper's linkage mimic a finger joint, and are 0
where it is. What is fixed to a finger becomes part of its link.
"""

import copy
import xml.etree.ElementTree as ElementTree
from functools import cache
from importlib.metadata import files
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from s2a.core.errors import InputError
from s2a.robot import mjcf
from s2a.robot.spec import Attachment, RobotSpec

MOVING = ("revolute", "prismatic", "continuous")
EFFORT = mjcf.EFFORT
TURN = 2.0 * np.pi  # [rad] Limit of a continuous joint to either side
STILL = 0.02  # A joint that follows a finger joint by a smaller fraction is fixed
SPARE = 0.1  # [rad or m] By how much the limits of a joint that mimics another are wider than what it mimics


def arm(spec: RobotSpec, visuals: bool = False) -> ElementTree.Element:
    """Return the URDF of arm and gripper; without visuals (DAE files) unless they are to be rendered."""
    return _reduced(spec, spec.root_link, visuals)


def gripper(spec: RobotSpec) -> ElementTree.Element:
    """Return the URDF of the gripper body and its fingers alone, without frames that have no geometry."""
    robot = _reduced(spec, spec.gripper.body, False)
    while bare := [link for link in _leaves(robot) if robot.find(f"link[@name='{link}']/collision") is None]:
        _drop(robot, set(bare))
    return robot


def description_folder() -> Path:
    """Return the folder that holds example-robot-data's packages."""
    for file in files("example-robot-data") or []:
        if file.name == "panda.urdf":
            return Path(str(file.locate())).parents[4]
    raise FileNotFoundError("panda.urdf of the package example-robot-data; reinstall the requirements")


def position_limits(spec: RobotSpec) -> np.ndarray:
    """Return the lower and upper limits of `spec.joints` [rad, m], shape [2 joint]."""
    robot = arm(spec)
    limits = [_named(robot, "joint", name).find("limit") for name in spec.joints]
    return np.array(
        [[float(limit.get(side, 0)) for limit in limits if limit is not None] for side in ("lower", "upper")]
    )


def origin(element: ElementTree.Element) -> np.ndarray:
    """Return the pose in an element's <origin> tag, shape [4 4]; the identity where there is none."""
    pose, tag = np.eye(4), element.find("origin")
    if tag is not None:
        pose[:3, :3] = Rotation.from_euler("xyz", _numbers(tag.get("rpy", "0 0 0"))).as_matrix()
        pose[:3, 3] = _numbers(tag.get("xyz", "0 0 0"))
    return pose


def axis(joint: ElementTree.Element) -> np.ndarray:
    """Return a joint's unit axis in its own frame, shape [3]."""
    tag = joint.find("axis")
    direction = _numbers("1 0 0" if tag is None else tag.get("xyz", "1 0 0"))
    return direction / np.linalg.norm(direction)


def motion(joint: ElementTree.Element, q: np.ndarray) -> np.ndarray:
    """Return how a joint at coordinates q [pose] [rad or m] moves its child link in the joint's frame, shape [pose 4 4]."""
    moved, direction = np.tile(np.eye(4), (len(q), 1, 1)), axis(joint)
    if joint.get("type") == "prismatic":
        moved[:, :3, 3] = q[:, None] * direction
        return moved
    x, y, z = direction
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])  # cross @ v = axis x v; Rodrigues' formula
    sine, rest = np.sin(q)[:, None, None], (1.0 - np.cos(q))[:, None, None]
    moved[:, :3, :3] = np.eye(3) + sine * cross + rest * (cross @ cross)
    return moved


def solid(collision: ElementTree.Element) -> trimesh.Trimesh:
    """Return a collision shape in its link's frame."""
    geometry = collision.find("geometry")
    assert geometry is not None
    (shape,) = geometry
    if shape.tag == "mesh":
        path = description_folder() / str(shape.get("filename")).removeprefix("package://")
        mesh = trimesh.load(str(path), force="mesh")
        mesh.apply_scale(_numbers(shape.get("scale", "1 1 1")))
    elif shape.tag == "box":
        mesh = trimesh.creation.box(_numbers(str(shape.get("size"))))
    elif shape.tag == "cylinder":
        mesh = trimesh.creation.cylinder(float(shape.get("radius", 0)), float(shape.get("length", 0)))
    elif shape.tag == "capsule":
        mesh = trimesh.creation.capsule(float(shape.get("height", 0)), float(shape.get("radius", 0)))
    else:
        mesh = trimesh.creation.icosphere(radius=float(shape.get("radius", 0)))
    return mesh.apply_transform(origin(collision))


def without(robot: ElementTree.Element, links: set[str]) -> ElementTree.Element:
    """Return a copy of a URDF without some links and their joints."""
    copied = copy.deepcopy(robot)
    _drop(copied, links)
    return copied


def without_colliders(robot: ElementTree.Element) -> ElementTree.Element:
    """Return a copy of a URDF whose links collide with nothing."""
    copied = copy.deepcopy(robot)
    for link in copied.findall("link"):
        for shape in link.findall("collision"):
            link.remove(shape)
    return copied


def children(robot: ElementTree.Element) -> dict[str, list[tuple[str, ElementTree.Element]]]:
    """Return the (child link, joint) pairs of every parent link, by name."""
    tree: dict[str, list[tuple[str, ElementTree.Element]]] = {}
    for joint in robot.findall("joint"):
        parent, child = _ends(joint)
        tree.setdefault(parent, []).append((child, joint))
    return tree


def followers_last(robot: ElementTree.Element) -> ElementTree.Element:
    """Return a copy of a URDF, its joints depth first; those that mimic others, and what hangs on these, come last."""
    copied = copy.deepcopy(robot)
    tree, links = children(copied), [str(link.get("name")) for link in copied.findall("link")]
    (root,) = set(links) - {child for hanging in tree.values() for child, _ in hanging}
    early: list[ElementTree.Element] = []
    late: list[ElementTree.Element] = []
    waiting = [(root, False)]
    while waiting:
        link, follows = waiting.pop()
        for child, joint in reversed(tree.get(link, [])):
            waiting.append((child, follows or joint.find("mimic") is not None))
        for joint in copied.findall("joint"):
            if _ends(joint)[1] == link:
                (late if follows else early).append(joint)
    if late:
        for joint in [*early, *late]:
            copied.remove(joint)
        copied.extend([*early, *late])
    return copied


def below(robot: ElementTree.Element, root: str) -> set[str]:
    """Return a link and all links that hang on it."""
    tree, links, waiting = children(robot), {root}, [root]
    while waiting:
        hanging = [child for child, _ in tree.get(waiting.pop(), [])]
        links.update(hanging)
        waiting += hanging
    return links


def _file(spec: RobotSpec, model: str) -> Path:
    """Return a model's file: by its path, or below example-robot-data's folder of robots."""
    path = description_folder() / "example-robot-data/robots" / model  # an absolute path stays as it is
    if not path.is_file():
        raise InputError(f"robot {spec.name!r}: {path}: no such file; correct `model` in its YAML")
    return path


@cache
def _source(spec: RobotSpec) -> str:
    """Return the URDF of all files of a robot, with paths of meshes that can be read from anywhere."""
    robot, tied = _read(spec, spec.model, ""), spec.attach
    if tied is not None:
        other = _read(spec, tied.model, tied.prefix)
        _attach(spec, robot, other, tied)
    return ElementTree.tostring(robot, encoding="unicode")


def _read(spec: RobotSpec, model: str, prefix: str) -> ElementTree.Element:
    """Return one file as a URDF, a prefix before the names of its links and joints."""
    path = _file(spec, model)
    try:
        robot = ElementTree.fromstring(path.read_text())
    except (ElementTree.ParseError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not an XML file: {error}; expected a URDF or MJCF") from error
    if robot.tag == "mujoco":
        names = [[name.removeprefix(prefix) for name in group] for group in (spec.arm_joints, spec.gripper.joints)]
        robot = mjcf.read(path, *names)
    elif robot.tag != "robot":
        raise InputError(f"{path}: its root is <{robot.tag}>; expected <robot>, a URDF, or <mujoco>, an MJCF")
    for kind in ("collision", "visual"):
        for mesh in robot.iterfind(f"link/{kind}/geometry/mesh"):
            name = str(mesh.get("filename"))
            file = _mesh(path, name)
            if file is None and kind == "collision":  # Newton warns of a visual one that is rendered
                raise InputError(
                    f"{path}: collision mesh {name}: no such file, nor package in a folder above the model"
                )
            mesh.set("filename", file or name)
    for element in robot.iter() if prefix else ():
        key = {"link": "name", "joint": "name", "parent": "link", "child": "link", "mimic": "joint"}.get(element.tag)
        if key and element.get(key):
            element.set(key, prefix + str(element.get(key)))
    return robot


def _mesh(model: Path, name: str) -> str | None:
    """Return the path of a mesh that a URDF names: relative to it, or in a package above it or of example-robot-data."""
    if not name.startswith("package://"):
        path = model.parent / name.removeprefix("file://")
        return str(path) if path.is_file() else None
    inner = name.removeprefix("package://")
    if (description_folder() / inner).is_file():
        return name
    return next((str(folder / inner) for folder in model.resolve().parents if (folder / inner).is_file()), None)


def _attach(spec: RobotSpec, robot: ElementTree.Element, other: ElementTree.Element, tied: Attachment) -> None:
    """Fix the root of another URDF to a link."""
    links = {str(link.get("name")) for link in robot.findall("link")}
    if tied.link not in links:
        raise InputError(
            f"robot {spec.name!r}: {spec.model} has no link {tied.link}; correct `attach.link` in its YAML"
        )
    (root,) = {str(link.get("name")) for link in other.findall("link")} - {_ends(j)[1] for j in other.findall("joint")}
    robot.extend([*other.findall("link"), *other.findall("joint")])
    joint = ElementTree.SubElement(robot, "joint", {"name": f"{root}_attached", "type": "fixed"})
    ElementTree.SubElement(joint, "parent", {"link": tied.link})
    ElementTree.SubElement(joint, "child", {"link": root})
    _set_origin(joint, Rotation.from_euler("xyz", tied.rpy).as_matrix(), np.array(tied.position))


def _reduced(spec: RobotSpec, root: str, visuals: bool) -> ElementTree.Element:
    """Return the URDF of what hangs on a link."""
    robot = ElementTree.fromstring(_source(spec))
    names = {str(link.get("name")) for link in robot.findall("link")}
    if missing := {root, spec.gripper.body, *spec.gripper.links} - names:
        raise InputError(
            f"robot {spec.name!r}: {spec.model} has no link {', '.join(sorted(missing))}; correct its YAML"
        )
    joints = {str(joint.get("name")) for joint in robot.findall("joint")}
    if missing := {*spec.joints, *(name for name, _ in spec.fixed_joints)} - joints:
        raise InputError(
            f"robot {spec.name!r}: {spec.model} has no joint {', '.join(sorted(missing))}; correct its YAML"
        )
    _rotate_body(robot, spec)
    ratios = _ratios(robot, spec)
    _drop(robot, names - below(robot, root))
    for link in robot.findall("link"):
        for visual in [] if visuals else link.findall("visual"):
            link.remove(visual)
    signs = [
        _sign(_named(robot, "joint", name), closed, spec.gripper.finger_joint_open)
        for name, closed in zip(spec.gripper.joints, spec.gripper.closed, strict=True)
    ]
    for joint in robot.findall("joint"):
        _normalise(joint, spec, ratios)
        if (tag := joint.find("mimic")) is not None:
            sign = signs[spec.gripper.joints.index(str(tag.get("joint")))]
            tag.set("multiplier", repr(sign * float(tag.get("multiplier", 1))))
    for finger in spec.gripper.links:
        _merge_fixed(robot, finger)
    return robot


def _rotate_body(robot: ElementTree.Element, spec: RobotSpec) -> None:
    """Turn the frame of the gripper body by `tool_rotation`; nothing else moves."""
    if not any(spec.tool_rotation):
        return
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_euler("xyz", spec.tool_rotation).as_matrix()
    body = _named(robot, "link", spec.gripper.body)
    inside = [joint for _, joint in children(robot).get(spec.gripper.body, [])]
    for element in [*inside, *body.findall("collision"), *body.findall("visual"), *body.findall("inertial")]:
        pose = turn.T @ origin(element)
        _set_origin(element, pose[:3, :3], pose[:3, 3])
    for joint in robot.findall("joint"):
        if _ends(joint)[1] == spec.gripper.body:
            pose, direction = origin(joint) @ turn, turn[:3, :3].T @ axis(joint)
            _set_origin(joint, pose[:3, :3], pose[:3, 3])
            if (tag := joint.find("axis")) is not None:
                tag.set("xyz", _words(direction))


def _ratios(robot: ElementTree.Element, spec: RobotSpec) -> dict[str, tuple[int, float, float]]:
    """Return which finger joint each joint that mimics one follows, its offset and its multiplier, in the file's coordinates."""
    fingers, ratios = spec.gripper.joints, {}
    links = [below(robot, _ends(_named(robot, "joint", name))[1]) for name in fingers]
    tags = {str(joint.get("name")): joint.find("mimic") for joint in robot.findall("joint")}

    def leader(name: str) -> tuple[str, float, float]:
        """Return the joint that is not a follower, and how a joint depends on it."""
        if (tag := tags.get(name)) is None:
            return name, 0.0, 1.0
        first, offset, multiplier = leader(str(tag.get("joint")))
        own = float(tag.get("multiplier", 1))
        return first, float(tag.get("offset", 0)) + own * offset, own * multiplier

    for joint in robot.findall("joint"):
        name = str(joint.get("name"))
        if tags[name] is None or name in spec.joints:
            continue
        child = _ends(joint)[1]
        first, offset, multiplier = leader(name)
        for index in [k for k, hanging in enumerate(links) if child in hanging] or range(len(fingers)):
            same, shift, factor = leader(fingers[index])
            if same == first and factor:
                ratio = multiplier / factor
                ratios[name] = index, offset - ratio * shift, ratio
                break
    return ratios


def _normalise(joint: ElementTree.Element, spec: RobotSpec, ratios: dict[str, tuple[int, float, float]]) -> None:
    """Fix a joint that is not driven; let a finger's coordinate be 0 where the pads touch and positive where they are apart.

    What mimics a finger joint is 0 where that is.
    """
    for mimic in joint.findall("mimic"):
        joint.remove(mimic)
    name, limit, gripper = str(joint.get("name")), joint.find("limit"), spec.gripper
    if joint.get("type") == "continuous" and name in spec.joints:
        limit = ElementTree.SubElement(joint, "limit", {"effort": EFFORT}) if limit is None else limit
        joint.set("type", "revolute")
        limit.attrib |= {"lower": repr(-TURN), "upper": repr(TURN)}
    if joint.get("type") in MOVING and name not in spec.joints:
        _follow(joint, spec, ratios)
    if name not in gripper.joints or limit is None:
        return
    closed = gripper.closed[gripper.joints.index(name)]
    ends = [float(limit.get(side, 0)) - closed for side in ("lower", "upper")]
    _shift(joint, closed)
    if _sign(joint, closed, gripper.finger_joint_open) < 0.0:  # opens towards its lower limit
        ends = [-ends[1], -ends[0]]
        _set_axis(joint, -axis(joint))
    limit.attrib |= {"lower": f"{max(ends[0], 0.0)}", "upper": f"{min(ends[1], gripper.finger_joint_open)}"}
    if gripper.finger_inset:
        _shift(joint, -gripper.finger_inset)


def _sign(joint: ElementTree.Element, closed: float, opened: float) -> float:
    """Return -1 for a finger joint that opens towards its lower limit, else 1."""
    limit = joint.find("limit")
    return -1.0 if limit is not None and closed + opened > float(limit.get("upper", 0)) + 1e-6 else 1.0


def _follow(joint: ElementTree.Element, spec: RobotSpec, ratios: dict[str, tuple[int, float, float]]) -> None:
    """Let a joint that is not driven mimic its finger joint, or fix it where the YAML says, else at 0."""
    name = str(joint.get("name"))
    if name not in ratios:
        _shift(joint, dict(spec.fixed_joints).get(name, 0.0))
        joint.set("type", "fixed")
        return
    index, offset, multiplier = ratios[name]
    gripper = spec.gripper
    _shift(joint, offset + multiplier * gripper.closed[index])
    if abs(multiplier) < STILL:
        joint.set("type", "fixed")
        return
    joint.set("type", "prismatic" if joint.get("type") == "prismatic" else "revolute")
    attributes = {"joint": gripper.joints[index], "multiplier": repr(multiplier), "offset": "0.0"}
    ElementTree.SubElement(joint, "mimic", attributes)
    if (limit := joint.find("limit")) is not None:
        joint.remove(limit)
    most = abs(multiplier) * gripper.finger_joint_open + SPARE
    ElementTree.SubElement(joint, "limit", {"lower": repr(-most), "upper": repr(most), "effort": EFFORT})


def _shift(joint: ElementTree.Element, coordinate: float) -> None:
    """Let a joint's coordinate be 0 where it was a given one [rad or m]."""
    if coordinate:
        pose = origin(joint) @ motion(joint, np.array([coordinate]))[0]
        _set_origin(joint, pose[:3, :3], pose[:3, 3])


def _set_axis(joint: ElementTree.Element, direction: np.ndarray) -> None:
    tag = joint.find("axis")
    tag = ElementTree.SubElement(joint, "axis") if tag is None else tag
    tag.set("xyz", _words(direction))


def _merge_fixed(robot: ElementTree.Element, link: str) -> None:
    """Move the geometry and the mass of what is fixed to a link into that link."""
    own = _named(robot, "link", link)
    for child, joint in children(robot).get(link, []):
        if joint.get("type") != "fixed":
            continue
        _merge_fixed(robot, child)
        other, pose = _named(robot, "link", child), origin(joint)
        for shape in [*other.findall("collision"), *other.findall("visual")]:
            placed = pose @ origin(shape)
            _set_origin(shape, placed[:3, :3], placed[:3, 3])
            own.append(shape)
        mass, more = own.find("inertial/mass"), other.find("inertial/mass")
        if mass is not None and more is not None:  # its inertia is lost: that of a fingertip
            mass.set("value", f"{float(mass.get('value', 0)) + float(more.get('value', 0))}")
        _drop(robot, {child})


def _set_origin(element: ElementTree.Element, rotation: np.ndarray, position: np.ndarray) -> None:
    tag = element.find("origin")
    tag = ElementTree.SubElement(element, "origin") if tag is None else tag
    tag.attrib |= {"rpy": _words(Rotation.from_matrix(rotation).as_euler("xyz")), "xyz": _words(position)}


def _leaves(robot: ElementTree.Element) -> list[str]:
    """Return the links on which no other hangs."""
    tree = children(robot)
    return [str(link.get("name")) for link in robot.findall("link") if link.get("name") not in tree]


def _drop(robot: ElementTree.Element, links: set[str]) -> None:
    """Remove links and the joints at either of their ends."""
    for link in robot.findall("link"):
        if link.get("name") in links:
            robot.remove(link)
    for joint in robot.findall("joint"):
        if links.intersection(_ends(joint)):
            robot.remove(joint)


def _ends(joint: ElementTree.Element) -> tuple[str, str]:
    """Return the names of a joint's parent and child link."""
    parent, child = (joint.find(end) for end in ("parent", "child"))
    assert parent is not None and child is not None
    return str(parent.get("link")), str(child.get("link"))


def _named(robot: ElementTree.Element, tag: str, name: str) -> ElementTree.Element:
    element = robot.find(f"{tag}[@name='{name}']")
    if element is None:
        raise InputError(f"the URDF has no {tag} {name!r}; correct the robot's YAML")
    return element


def _numbers(text: str) -> np.ndarray:
    return np.array([float(word) for word in text.split()])


def _words(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)
