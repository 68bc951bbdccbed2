"""The URDF of one object, as a network predicts it from images, as predicted parts of the scan around it.

The object is fitted into its box in the scan, and each face of the scan in the box goes to the link whose surface is nearest.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import trimesh
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from s2a.core.errors import InputError
from s2a.scan import source
from s2a.scan.ply import ScanMesh
from s2a.scan.predictions import USUAL_LABEL, USUAL_RANGE, Prediction

KINDS = {"revolute": "rotation", "continuous": "rotation", "prismatic": "translation"}
FIXED = "fixed"
MAX_BYTES, MAX_MESH_BYTES, MAX_LINKS = 5_000_000, 100_000_000, 1000
MAX_NUMBER = 1e6  # In a file; of larger ones nothing of an object is left in single precision


@dataclass(frozen=True)
class UrdfJoint:
    """A joint of a URDF."""

    name: str  # of the joint
    kind: str  # one of KINDS, or FIXED
    parent: str  # name of a link
    child: str  # name of a link
    pose: np.ndarray  # of the child in its parent's frame at zero, shape [4 4]
    axis: np.ndarray  # unit vector in the child's frame, shape [3]
    limits: tuple[float, float] | None  # lowest and highest coordinate [m or rad]; None: the file states none


@dataclass(frozen=True)
class UrdfObject:
    """One object at its zero pose."""

    joints: list[UrdfJoint]  # of all kinds
    poses: dict[str, np.ndarray]  # of the links in the root's frame, shape [4 4] each
    triangles: dict[str, np.ndarray]  # of the links that have a surface, in the root's frame, shape [face 3 3] each


def read_links(path: Path) -> UrdfObject:
    """Read a URDF; meshes lie in its folder or below.

    Raises:
        InputError: a damaged file, one without moving joints or surfaces, with loops, or a mesh that is missing or elsewhere.
    """
    robot = _root(path)
    joints = [_joint(path, element) for element in robot.findall("joint")]
    if not any(joint.kind in KINDS for joint in joints):
        raise InputError(f"{path}: no joint moves; give a URDF with a {', '.join(KINDS)} joint")
    named = [(_name(path, link), link) for link in robot.findall("link")]
    poses = _poses(path, [name for name, _ in named], joints)
    surfaces = {name: _triangles(path, link, poses[name]) for name, link in dict(named).items()}
    triangles = {name: each for name, each in surfaces.items() if trimesh.triangles.area(each).sum() > 0.0}
    if not triangles:
        raise InputError(f"{path}: no link has a surface; give a URDF with <visual> meshes or boxes")
    return UrdfObject(joints, poses, triangles)


def _root(path: Path) -> ElementTree.Element:
    """Return the document's root; declarations of entities, which can fill the memory, are refused."""
    if not path.is_file():
        raise InputError(f"predictions {str(path)!r} is not a file; give predictions=FILE.urdf")
    if (size := path.stat().st_size) > MAX_BYTES:
        limit = f"give one below {MAX_BYTES / 1e6:.0f} MB"
        raise InputError(f"{path}: {size / 1e6:.0f} MB are no URDF of one object; {limit}")
    text = path.read_bytes()
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text or b"\0" in text:
        raise InputError(f"{path}: declares a document type or entities, or is not UTF-8; remove them")
    try:
        robot = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"{path}: not XML ({error}); write it again") from error
    if robot.tag != "robot":
        raise InputError(f"{path}: its root is <{robot.tag}>; expected <robot>: give a URDF")
    if (count := len(robot.findall("link"))) > MAX_LINKS:
        raise InputError(f"{path}: {count} links; {MAX_LINKS} are possible: give the URDF of one object")
    return robot


def _joint(path: Path, element: ElementTree.Element) -> UrdfJoint:
    name, kind = _name(path, element), element.get("type", "")
    if kind not in (*KINDS, FIXED):
        raise InputError(f"{path}: joint {name!r} is of type {kind!r}; possible: {', '.join((*KINDS, FIXED))}")
    ends = ["" if (end := element.find(tag)) is None else end.get("link", "") for tag in ("parent", "child")]
    axis = element.find("axis")
    along = _numbers(path, axis.get("xyz", "1 0 0") if axis is not None else "1 0 0", 3)
    if np.linalg.norm(along) < 1e-6:
        raise InputError(f"{path}: joint {name!r} has an axis of length 0; give a direction")
    limit, limits = element.find("limit"), None
    if limit is not None and kind != "continuous" and limit.get("upper") is not None:
        low, high = (float(_numbers(path, limit.get(key, "0"), 1)[0]) for key in ("lower", "upper"))
        if low > high:
            raise InputError(f"{path}: joint {name!r} has limits {low:g} to {high:g}; swap them")
        limits = (low, high)
    return UrdfJoint(name, kind, ends[0], ends[1], _pose(path, element), along / np.linalg.norm(along), limits)


def _poses(path: Path, links: list[str], joints: list[UrdfJoint]) -> dict[str, np.ndarray]:
    """Return the poses [4 4] of all links in the frame of the only root, at the zero pose."""
    names, children = set(links), [joint.child for joint in joints]
    if unknown := [end for joint in joints for end in (joint.parent, joint.child) if end not in names]:
        raise InputError(
            f"{path}: a joint names the link {unknown[0]!r}, which does not exist; links: {', '.join(links[:8])}"
        )
    roots = [link for link in links if link not in children]
    if len(set(children)) < len(children) or len(names) < len(links) or len(roots) != 1:
        raise InputError(f"{path}: its links are no tree ({len(roots)} roots); each link but one needs one parent")
    poses = {roots[0]: np.eye(4)}
    left = joints
    while left:
        ready = [joint for joint in left if joint.parent in poses]
        if not ready:
            raise InputError(
                f"{path}: the links {left[0].parent!r} and {left[0].child!r} are in a loop; remove a joint"
            )
        poses |= {joint.child: poses[joint.parent] @ joint.pose for joint in ready}
        left = [joint for joint in left if joint.child not in poses]
    return poses


def _triangles(path: Path, link: ElementTree.Element, pose: np.ndarray) -> np.ndarray:
    """Return the visible triangles of a link in the root's frame, or those that collide if none is seen, shape [face 3 3]."""
    triangles = [np.zeros((0, 3, 3))]
    for element in link.findall("visual") or link.findall("collision"):
        at = pose @ _pose(path, element)
        for shape in element.findall("geometry/*"):
            corners = _shape(path, shape)
            triangles.append(corners @ at[:3, :3].T + at[:3, 3])
    return np.concatenate(triangles)


def _shape(path: Path, shape: ElementTree.Element) -> np.ndarray:
    """Return the triangles of a geometry, shape [face 3 3]; a cylinder and a sphere are taken for their boxes."""
    if shape.tag == "mesh":
        scale = _numbers(path, shape.get("scale", "1 1 1"), 3)
        mesh = source.read(_mesh_file(path, shape.get("filename", "")))
        return np.asarray(mesh.vertices[mesh.faces] * scale)
    if shape.tag == "box":
        size = _numbers(path, shape.get("size", ""), 3)
    elif shape.tag in ("cylinder", "sphere"):
        radius = float(_numbers(path, shape.get("radius", ""), 1)[0])
        length = float(_numbers(path, shape.get("length", ""), 1)[0]) if shape.tag == "cylinder" else 2 * radius
        size = np.array([2 * radius, 2 * radius, length])
    else:
        raise InputError(f"{path}: geometry <{shape.tag}> is unknown; possible: mesh, box, cylinder, sphere")
    return np.asarray(trimesh.creation.box(size).triangles)


def _mesh_file(path: Path, name: str) -> Path:
    """Return the file of a mesh, which lies in the URDF's folder or below."""
    file = path.parent / name.removeprefix("file://").removeprefix("package://")
    if not file.resolve().is_relative_to(path.parent.resolve()):
        raise InputError(f"{path}: the mesh {name!r} lies outside of the URDF's folder; copy it into that folder")
    if file.is_file() and (size := file.stat().st_size) > MAX_MESH_BYTES:
        raise InputError(f"{file}: {size / 1e6:.0f} MB; {MAX_MESH_BYTES / 1e6:.0f} MB are possible: simplify the mesh")
    return file


def _pose(path: Path, element: ElementTree.Element) -> np.ndarray:
    """Return the pose [4 4] of an element's <origin>: position [m]; roll, pitch, yaw [rad] about fixed axes."""
    origin = element.find("origin")
    pose = np.eye(4)
    if origin is not None:
        pose[:3, 3] = _numbers(path, origin.get("xyz", "0 0 0"), 3)
        pose[:3, :3] = Rotation.from_euler("xyz", _numbers(path, origin.get("rpy", "0 0 0"), 3)).as_matrix()
    return pose


def _numbers(path: Path, text: str, count: int) -> np.ndarray:
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.zeros(0)
    if len(values) != count or not (np.abs(values) <= MAX_NUMBER).all():
        raise InputError(
            f"{path}: {text[:80]!r} where {count} finite numbers up to {MAX_NUMBER:g} are expected; write it again"
        )
    return values


def _name(path: Path, element: ElementTree.Element) -> str:
    name = element.get("name", "")
    if not name:
        raise InputError(f"{path}: a <{element.tag}> has no name; give it one")
    return name


SUFFIX = ".urdf"
HANDLE = ("handle", "knob")  # A link that is fixed to a moving one and has such a word in its name is its handle
# [m] Beyond its box a face of the scan still belongs to the object, and so far from a link's surface at most
MARGIN = 0.03
SAMPLES = 2000  # Points on the surface of each link


@dataclass(frozen=True)
class ObjectBox:
    """Where an object stands in a scan."""

    center: np.ndarray  # [m], scan file's coordinates, shape [3]
    size: np.ndarray  # full extents along its own axes [m], shape [3]
    yaw: float  # of its x axis about z [rad]

    @property
    def axes(self) -> np.ndarray:
        """Its axes as columns, shape [3 3]."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])

    def __str__(self) -> str:
        return "[" + ",".join(f"{value:.3f}" for value in (*self.center, *self.size, self.yaw)) + "]"


def best(path: Path, surface: ScanMesh, boxes: Sequence[ObjectBox]) -> ObjectBox:
    """Return the box in which the scan's faces lie nearest to the object's surface, on average by their areas.

    Raises:
        InputError: as of `read`.
    """
    middle = surface.vertices[surface.faces].mean(axis=1) + surface.origin
    a, b, c = np.moveaxis(surface.vertices[surface.faces].astype(np.float64), 1, 0)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    inside = _inside(middle, boxes[0])

    def misfit(box: ObjectBox) -> float:
        _, triangles, _, _ = _placed(path, box)
        tree = cKDTree(np.concatenate([_sampled(each) for each in triangles.values()]))
        return float(np.average(tree.query(middle[inside])[0], weights=areas[inside] + 1e-12)) if inside.any() else 0.0

    return min(boxes, key=misfit)


def read(path: Path, surface: ScanMesh, box: ObjectBox) -> list[Prediction]:
    """Return the moving links of a URDF at its zero pose as predicted parts of a scan; those without a face are left out.

    Args:
        path: the URDF, z up; meshes lie in its folder or below.
        surface: the scan's mesh.
        box: that the object fills; its extents are stretched to those of the box.

    Raises:
        InputError: as of `read_links`, or an object without volume.
    """
    urdf, triangles, linear, offset = _placed(path, box)
    near = _nearest(triangles, surface, box)
    movers = {name: _mover(name, urdf.joints) for name in urdf.poses}
    moving = [joint for joint in urdf.joints if joint.kind in KINDS]
    return [p for joint in moving for p in _predicted(joint, urdf.poses, linear, offset, near, movers)]


def _placed(path: Path, box: ObjectBox) -> tuple[UrdfObject, dict[str, np.ndarray], np.ndarray, np.ndarray]:
    """Return the links of a URDF, their triangles [face 3 3] in its box, and how they came there: linear map and offset."""
    urdf = read_links(path)
    points = np.concatenate([each.reshape(-1, 3) for each in urdf.triangles.values()])
    low, high = points.min(axis=0), points.max(axis=0)
    if (high - low).min() < 1e-6:
        raise InputError(f"{path}: its surfaces lie in a plane; give a URDF of a solid object")
    linear = box.axes * (box.size / (high - low))
    offset = box.center - linear @ ((low + high) / 2)
    return urdf, {name: each @ linear.T + offset for name, each in urdf.triangles.items()}, linear, offset


def _inside(points: np.ndarray, box: ObjectBox) -> np.ndarray:
    return np.asarray((np.abs((points - box.center) @ box.axes) <= box.size / 2 + MARGIN).all(axis=1))


def _nearest(triangles: Mapping[str, np.ndarray], surface: ScanMesh, box: ObjectBox) -> dict[str, np.ndarray]:
    """Return the faces of the scan in a box by the link that is nearest, at most MARGIN away."""
    middle = surface.vertices[surface.faces].mean(axis=1) + surface.origin
    chosen = np.flatnonzero(_inside(middle, box))
    points = np.concatenate([_sampled(each) for each in triangles.values()])
    away, k = cKDTree(points).query(middle[chosen])
    return {name: chosen[(k // SAMPLES == i) & (away <= MARGIN)] for i, name in enumerate(triangles)}


def _sampled(triangles: np.ndarray) -> np.ndarray:
    """Return points on triangles [face 3 3], evenly by area, shape [SAMPLES 3]."""
    solid = trimesh.Trimesh(**trimesh.triangles.to_kwargs(triangles), process=False)
    return np.asarray(trimesh.sample.sample_surface(solid, SAMPLES, seed=0)[0])


def _mover(link: str, joints: list[UrdfJoint]) -> str | None:
    """Return the moving link that a link is or is fixed to, or None."""
    by_child = {joint.child: joint for joint in joints}
    while link in by_child:
        if by_child[link].kind in KINDS:
            return link
        link = by_child[link].parent
    return None


def _predicted(
    joint: UrdfJoint,
    poses: Mapping[str, np.ndarray],
    linear: np.ndarray,
    offset: np.ndarray,
    near: Mapping[str, np.ndarray],
    movers: Mapping[str, str | None],
) -> list[Prediction]:
    """Return the prediction of a moving joint, or none where no face of the scan belongs to it."""
    links = [link for link, mover in movers.items() if mover == joint.child and link in near]
    held = [link for link in links if link != joint.child and any(word in link.lower() for word in HANDLE)]
    faces = np.unique(np.concatenate([np.zeros(0, np.int64), *(near[link] for link in links)]))
    handle = np.unique(np.concatenate([np.zeros(0, np.int64), *(near[link] for link in held)]))
    if not len(faces):
        return []
    pose, kind = poses[joint.child], KINDS[joint.kind]
    axis = linear @ pose[:3, :3] @ joint.axis
    stretch = float(np.linalg.norm(axis))
    limits = joint.limits or (0.0, USUAL_RANGE[kind])
    if joint.limits and kind == "translation":
        limits = (limits[0] * stretch, limits[1] * stretch)
    origin = linear @ pose[:3, 3] + offset
    return [
        Prediction(USUAL_LABEL[kind], kind, axis / stretch, origin, limits, 1.0, faces, handle, joint.limits is None)
    ]
