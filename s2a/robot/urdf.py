"""A robot's URDF out of example-robot-data, reduced to one arm and its gripper.

The fingers are made alike: coordinate 0 where the pads touch, growing as they open, and no mimic tag (in MuJoCo it would
become a soft equality; the fingers are driven one by one). What is fixed to a finger becomes part of its link.
"""

from __future__ import annotations

import copy
import xml.etree.ElementTree as ElementTree
from functools import cache
from importlib.metadata import files
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.core.errors import InputError
from s2a.robot.spec import RobotSpec

MOVING = ("revolute", "prismatic", "continuous")


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


@cache
def _text(path: Path) -> str:
    return path.read_text()


def _reduced(spec: RobotSpec, root: str, visuals: bool) -> ElementTree.Element:
    """Return the URDF of what hangs on a link."""
    robot = ElementTree.fromstring(_text(description_folder() / "example-robot-data/robots" / spec.urdf))
    names = {str(link.get("name")) for link in robot.findall("link")}
    if missing := {root, spec.gripper.body, *spec.gripper.links} - names:
        raise InputError(f"robot {spec.name!r}: {spec.urdf} has no link {', '.join(sorted(missing))}; correct its YAML")
    _drop(robot, names - _below(robot, root))
    for link in robot.findall("link"):
        for visual in [] if visuals else link.findall("visual"):
            link.remove(visual)
    for joint in robot.findall("joint"):
        _normalise(joint, spec)
    for finger in spec.gripper.links:
        _merge_fixed(robot, finger)
    return robot


def _normalise(joint: ElementTree.Element, spec: RobotSpec) -> None:
    """Fix a joint that is not driven; let a finger's coordinate be 0 where the pads touch and positive where they are apart."""
    for mimic in joint.findall("mimic"):
        joint.remove(mimic)
    name, limit, tag = joint.get("name"), joint.find("limit"), joint.find("axis")
    if joint.get("type") in MOVING and name not in spec.joints:
        joint.set("type", "fixed")
    if name not in spec.gripper.joints or limit is None or tag is None:
        return
    if float(limit.get("upper", 0)) <= 0.0:  # opens towards its lower limit
        limit.attrib |= {"lower": f"{-float(limit.get('upper', 0))}", "upper": f"{-float(limit.get('lower', 0))}"}
        tag.set("xyz", _words(-axis(joint)))
    if spec.gripper.finger_inset:
        pose = origin(joint)
        shift = pose[:3, :3] @ axis(joint) * spec.gripper.finger_inset
        _set_origin(joint, pose[:3, :3], pose[:3, 3] - shift)


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


def _below(robot: ElementTree.Element, root: str) -> set[str]:
    """Return a link and all links that hang on it."""
    tree, found, waiting = children(robot), {root}, [root]
    while waiting:
        below = [child for child, _ in tree.get(waiting.pop(), [])]
        found.update(below)
        waiting += below
    return found


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
    found = robot.find(f"{tag}[@name='{name}']")
    if found is None:
        raise InputError(f"the URDF has no {tag} {name!r}; correct the robot's YAML")
    return found


def _numbers(text: str) -> np.ndarray:
    return np.array([float(word) for word in text.split()])


def _words(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)
