"""A simulation-ready room for other simulators: MJCF for MuJoCo, URDF for PyBullet, ROS, SAPIEN and Drake.

Both formats are written from the same Newton model (`s2a.certify.links`), so that what is frozen, cut and filtered is what the
simulation here has.

MJCF is Newton's text (`SolverMuJoCo(save_to_mjcf=...)`): joints, masses, contacts and solver options as MuJoCo gets them in the
simulation. It is tidied: names without paths, meshes in files of their own, surfaces to see, and cabinets that can be attached to
another model (Newton makes mocap bodies of them, which cannot).

URDF is one tree a room, its root the link `world`, which is the room itself. A link's frame is at its joint's origin and is
turned as the scene is; cabinets are fixed to `world`. What URDF cannot express: pairs that do not collide are in room.srdf
(MoveIt's format), a free object is a file of its own, placed where room.urdf has a frame of its name, and a joint's spring is
left out.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal
from xml.etree.ElementTree import Element

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from s2a.certify.links import FOLDER, STATIC, Link, LinkedRoom, read_links, write_hull, write_surface
from s2a.core.outputs import Output, atomic_write, refuse_loss, temporary_folder
from s2a.scene.scene import Mesh
from s2a.scene.usd.sim_read import refuse_unphysical
from s2a.scene.usd.sim_scene import Articulation, Mass, Quat
from s2a.scene.usd.sim_stage import FRICTION
from s2a.scene.usd.stage import ROOT
from s2a.sim.room import carrier_of
from s2a.sim.solver import SimConfig, make_solver

FILES = {"mjcf": "room.xml", "urdf": "room.urdf"}  # Formats, and the file of each that is loaded
PREFIX = f"{ROOT}/".replace("/", "_")  # Newton's names of bodies and joints begin with it
MASKS = ("contype", "conaffinity")
INLINE = ("vertex", "face")  # What Newton writes of a mesh into the XML, with six digits
HULL, SURFACE = "3", "2"  # Groups of geoms, as in mujoco_menagerie: viewers show 0 to 2
PAIRS = "room.srdf"  # Beside room.urdf: which links do not collide
WORLD = "world"  # Name of the root link, by which PyBullet knows that it does not move
# URDF requires limits of a joint's motor [N or N m] and speed [m/s or rad/s]; no furniture has them,
# and these limit nothing
EFFORT, VELOCITY = "1000", "10"


def write_urdf(linked: LinkedRoom, config: SimConfig, folder: Path) -> None:
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
    _save(robot, folder / FILES["urdf"])
    _save(_pairs(linked), folder / PAIRS)


@dataclass(frozen=True)
class ConvertSettings:
    """Keys of `s2a convert`: what is written, and how.

    Attributes:
        stage: the sim.usd.
        out: folder that receives room.xml or room.urdf, and the meshes.
        to: format.
        parts: articulated parts and free objects that move: all, the id of one, or several; all others are frozen.
        sim: physics settings; the joint's spring and damping, the time step and the solver's settings are exported.
    """

    stage: Path
    out: Output
    to: Literal["mjcf", "urdf"]
    parts: str | tuple[str, ...]
    sim: SimConfig


def convert(settings: ConvertSettings) -> LinkedRoom:
    """Write the room of a sim.usd in another format into a folder, which replaces an earlier one; return its links.

    Raises:
        InputError: no simulation-ready stage; an id that cannot move; `out` is a file, or a folder of something else.
    """
    file, write = FILES[settings.to], {"mjcf": write_mjcf, "urdf": write_urdf}[settings.to]
    refuse_loss(settings.out, file, [settings.stage])
    refuse_unphysical(settings.stage)
    linked = read_links(settings.stage, settings.parts, settings.sim)
    with atomic_write(settings.out, file) as folder:
        folder.mkdir()
        write(linked, settings.sim, folder)
    return linked


def write_mjcf(linked: LinkedRoom, config: SimConfig, folder: Path) -> None:
    """Write room.xml and its meshes.

    `config`: how physics is stepped; time step, solver and joint resistance go into the file.
    """
    root, shapes = _from_newton(linked, config)
    names = {geom: linked.shape_names[shape] for geom, shape in shapes.items()}
    (folder / FOLDER).mkdir()
    for link in linked.links.values():
        for name, mesh in link.colliders.items():
            write_hull(folder / FOLDER / f"{name}.obj", mesh)
    root.set("model", linked.room.name)
    _child(root, "compiler").attrib |= {"meshdir": FOLDER, "texturedir": FOLDER}
    _child(root, "option").set("timestep", repr(config.dt))
    assets = _child(root, "asset")
    given = {str(mesh.get("name")): mesh for mesh in assets}
    assets.clear()
    for body in root.iter("body"):
        _tidy_body(body)
    for geom in root.iter("geom"):
        name = names[str(geom.get("name"))]
        settings = {key: value for key, value in given[str(geom.get("mesh"))].items() if key not in INLINE}
        assets.append(_element("mesh", **settings | {"name": name, "file": f"{name}.obj"}))
        _tidy_geom(geom, name)
    for exclude in root.iter("exclude"):
        exclude.attrib |= {end: str(exclude.get(end)).removeprefix(PREFIX) for end in ("body1", "body2")}
    _add_surfaces(root, linked, folder)
    ElementTree.indent(root)
    ElementTree.ElementTree(root).write(folder / FILES["mjcf"], encoding="utf-8")
    mujoco.MjModel.from_xml_path(str(folder / FILES["mjcf"]))  # raises where MuJoCo cannot read it


def _from_newton(linked: LinkedRoom, config: SimConfig) -> tuple[Element, dict[str, int]]:
    """Return Newton's MJCF of a room, and the shape that each of its geoms is, by the geom's name."""
    with temporary_folder() as folder:
        file = folder / FILES["mjcf"]
        model = linked.builder.finalize(device="cpu")
        solver = make_solver(model, config, use_mujoco_cpu=True, save_to_mjcf=str(file))
        shapes = solver.mjc_geom_to_newton_shape.numpy()[0]
        names = {solver.mj_model.geom(i).name: int(shape) for i, shape in enumerate(shapes)}
        return ElementTree.parse(file).getroot(), names


def _tidy_body(body: Element) -> None:
    """Name a body, its joint and its grasp site; leave out what is Newton's own business."""
    name = str(body.get("name")).removeprefix(PREFIX)
    body.attrib = {"name": name, **{key: value for key, value in body.items() if key in ("pos", "quat")}}
    for joint in (*body.findall("joint"), *body.findall("freejoint")):
        joint.set("name", name)
        for key in ("actuatorfrcrange", "actuatorfrclimited"):  # 1e6, which limits nothing
            joint.attrib.pop(key, None)
    for site in body.findall("site"):
        site.set("name", f"{name}_grasp")


def _tidy_geom(geom: Element, name: str) -> None:
    """Name a hull and its mesh; let it collide with everything, as a robot added later will expect.

    Newton's masks only repeat what joints and exclusions say, in bits of which a robot's geoms know nothing.
    """
    geom.attrib |= {"name": name, "mesh": name, "group": HULL}
    for key in (*MASKS, "pos", "quat"):  # a hull's vertices lie in its body's frame
        geom.attrib.pop(key, None)


def _add_surfaces(root: Element, linked: LinkedRoom, folder: Path) -> None:
    """Add what is seen of each link, without contacts and without mass."""
    assets, world = _child(root, "asset"), _child(root, "worldbody")
    bodies = {str(body.get("name")): body for body in root.iter("body")} | {STATIC: world}
    for link, content in linked.links.items():
        for name, mesh in content.visuals.items():
            seen = f"{name}_visual"
            write_surface(folder / FOLDER / f"{seen}.obj", mesh)
            assets.append(_element("texture", name=seen, type="2d", file=f"{seen}.png"))
            assets.append(_element("material", name=seen, texture=seen, specular="0"))
            assets.append(_element("mesh", name=seen, file=f"{seen}.obj", inertia="shell"))
            off = dict.fromkeys(MASKS, "0") | {"mass": "0", "group": SURFACE}
            bodies[link].append(_element("geom", name=seen, type="mesh", mesh=seen, material=seen, **off))


def _child(root: Element, tag: str) -> Element:
    child = root.find(tag)
    return ElementTree.SubElement(root, tag) if child is None else child


def _element(tag: str, **attributes: str) -> Element:
    return Element(tag, attributes)


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
