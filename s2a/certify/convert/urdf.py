"""URDF: one tree a room, its root the link `world`, which is the room itself.

A link's frame lies in its joint's origin and is turned as the scene is; cabinets hang on `world` by fixed joints. What URDF
cannot express: pairs that do not collide are in room.srdf beside (MoveIt's format), a free object is a file of its own, which
stands where room.urdf has a frame of its name, and the spring of a joint is left out.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.certify.convert.links import FOLDER, STATIC, Link, LinkedRoom, write_hull, write_surface
from s2a.scene.scene import Mesh
from s2a.scene.usd.sim_scene import Articulation, Mass, Quat
from s2a.scene.usd.sim_stage import FRICTION
from s2a.sim.room import carrier_of
from s2a.sim.solver import SimConfig

FILE, PAIRS = "room.urdf", "room.srdf"
WORLD = "world"  # Name of the root link, by which PyBullet knows that it does not move
# URDF requires limits of a joint's motor [N or N m] and speed [m/s or rad/s]; no furniture has them,
# and these limit nothing
EFFORT, VELOCITY = "1000", "10"

Element = ElementTree.Element


def write(linked: LinkedRoom, config: SimConfig, folder: Path) -> None:
    """Write room.urdf, room.srdf, a URDF for each free object, and the meshes.

    `config`: how physics is stepped; the joints' damping is of it.
    """
    (folder / FOLDER).mkdir()
    room, robot = linked.room, Element("robot", name=linked.room.name)
    _add_link(robot, WORLD, linked.links[STATIC], None, np.zeros(3), folder)
    for body in linked.bodies:
        if body in room.free:
            _write_free(linked, body, folder)
            ElementTree.SubElement(robot, "link", name=body)
            _add_joint(robot, body, WORLD, room.free[body].position, room.free[body].orientation)
            continue
        origin = _origin(linked, body)
        _add_link(robot, body, linked.links[body], room.bodies[body].mass, origin, folder)
        parent = carrier_of(room, body, linked.bodies) or WORLD
        joint = _add_joint(robot, body, parent, origin - _origin(linked, parent))
        if body in room.articulations:
            _articulate(joint, room.articulations[body], config.joint.joint_damping(room.articulations[body]))
    _save(robot, folder / FILE)
    _save(_pairs(linked), folder / PAIRS)


def _origin(linked: LinkedRoom, link: str) -> np.ndarray:
    """Return the origin of a link's frame in the scene [m], shape [3]: that of its joint, or the scene's."""
    articulation = linked.room.articulations.get(link)
    return np.array(articulation.joint.origin) if articulation and link in linked.active else np.zeros(3)


def _add_link(robot: Element, name: str, content: Link, mass: Mass | None, origin: np.ndarray, folder: Path) -> None:
    """Add a link and write its meshes; `origin` is that of its frame in the frame of the content [m], shape [3]."""
    link = ElementTree.SubElement(robot, "link", name=name)
    if mass is not None:
        _add_mass(link, mass, origin)
    for surface, mesh in content.visuals.items():
        write_surface(folder / FOLDER / f"{surface}_visual.obj", _moved(mesh, origin))
        _add_shape(link, "visual", f"{surface}_visual")
    for hull, mesh in content.colliders.items():
        write_hull(folder / FOLDER / f"{hull}.obj", _moved(mesh, origin))
        _add_shape(link, "collision", hull)
    if content.colliders:  # Bullet's own tag, which other readers skip
        contact = ElementTree.SubElement(link, "contact")
        ElementTree.SubElement(contact, "lateral_friction", value=f"{FRICTION}")


def _add_mass(link: Element, mass: Mass, origin: np.ndarray) -> None:
    inertial = ElementTree.SubElement(link, "inertial")
    _add_origin(inertial, np.array(mass.center) - origin, mass.axes)
    ElementTree.SubElement(inertial, "mass", value=repr(mass.mass))
    moments = dict(zip(("ixx", "iyy", "izz"), map(repr, mass.inertia), strict=True))
    ElementTree.SubElement(inertial, "inertia", {**dict.fromkeys(("ixy", "ixz", "iyz"), "0"), **moments})


def _add_shape(link: Element, tag: str, name: str) -> None:
    geometry = ElementTree.SubElement(ElementTree.SubElement(link, tag, name=name), "geometry")
    ElementTree.SubElement(geometry, "mesh", filename=f"{FOLDER}/{name}.obj")


def _add_joint(
    robot: Element, child: str, parent: str, position: Iterable[float], orientation: Quat = (0, 0, 0, 1)
) -> Element:
    """Add and return a fixed joint."""
    joint = ElementTree.SubElement(robot, "joint", name=f"{child}_fixed", type="fixed")
    _add_origin(joint, position, orientation)
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)
    return joint


def _articulate(tag: Element, articulation: Articulation, damping: float) -> None:
    """Turn a fixed joint into the one on which a part moves."""
    joint = articulation.joint
    tag.attrib = {"name": str(tag.get("name")).removesuffix("_fixed"), "type": joint.kind}
    ElementTree.SubElement(tag, "axis", xyz=_words(joint.axis))
    lower, upper = map(repr, joint.limits)
    ElementTree.SubElement(tag, "limit", lower=lower, upper=upper, effort=EFFORT, velocity=VELOCITY)
    ElementTree.SubElement(tag, "dynamics", damping=repr(damping), friction=repr(articulation.friction))


def _write_free(linked: LinkedRoom, name: str, folder: Path) -> None:
    """Write a free object as a tree of its own, one link."""
    robot = Element("robot", name=name)
    _add_link(robot, name, linked.links[name], linked.room.free[name].mass, np.zeros(3), folder)
    _save(robot, folder / f"{name}.urdf")


def _pairs(linked: LinkedRoom) -> Element:
    """Return the SRDF of a room: which links do not collide."""
    room, robot = linked.room, Element("robot", name=linked.room.name)
    for one, other in linked.filtered():
        joined = carrier_of(room, one, linked.bodies) == other or carrier_of(room, other, linked.bodies) == one
        reason = "Adjacent" if joined else "Default"  # SAPIEN heeds no other word
        ElementTree.SubElement(robot, "disable_collisions", link1=one, link2=other, reason=reason)
    return robot


def _moved(mesh: Mesh, origin: np.ndarray) -> Mesh:
    """Return a mesh in a frame with another origin [m], shape [3]."""
    return Mesh(mesh.vertices.astype(np.float64) - origin, mesh.faces, mesh.colors)


def _add_origin(element: Element, position: Iterable[float], orientation: Quat) -> None:
    rpy = Rotation.from_quat(orientation).as_euler("xyz")
    ElementTree.SubElement(element, "origin", xyz=_words(position), rpy=_words(rpy))


def _words(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _save(robot: Element, path: Path) -> None:
    ElementTree.indent(robot)
    ElementTree.ElementTree(robot).write(path, encoding="utf-8", xml_declaration=True)
