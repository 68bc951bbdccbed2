"""MJCF, MuJoCo's own format, by Newton's writer: the room loads in plain MuJoCo and does there what it does here.

Newton's text (`SolverMuJoCo(save_to_mjcf=...)`) has joints, masses, contacts and solver options as MuJoCo gets them in the
simulation. It is tidied: names without paths, meshes in files of their own, surfaces to see, and cabinets that can be attached to
another model (Newton makes mocap bodies of them, which cannot).
"""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import mujoco

from s2a.certify.convert.links import FOLDER, STATIC, LinkedRoom, write_hull, write_surface
from s2a.core.outputs import temporary_folder
from s2a.scene.usd.stage import ROOT
from s2a.sim.solver import SimConfig, make_solver

FILE = "room.xml"
PREFIX = f"{ROOT}/".replace("/", "_")  # Newton's names of bodies and joints begin with it
MASKS = ("contype", "conaffinity")
INLINE = ("vertex", "face")  # What Newton writes of a mesh into the XML, with six digits
HULL, SURFACE = "3", "2"  # Groups of geoms, as in mujoco_menagerie: viewers show 0 to 2


def write(linked: LinkedRoom, config: SimConfig, folder: Path) -> None:
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
    ElementTree.ElementTree(root).write(folder / FILE, encoding="utf-8")
    mujoco.MjModel.from_xml_path(str(folder / FILE))  # raises where MuJoCo cannot read it


def _from_newton(linked: LinkedRoom, config: SimConfig) -> tuple[ElementTree.Element, dict[str, int]]:
    """Return Newton's MJCF of a room, and the shape that each of its geoms is, by the geom's name."""
    with temporary_folder() as folder:
        file = folder / FILE
        model = linked.builder.finalize(device="cpu")
        solver = make_solver(model, config, use_mujoco_cpu=True, save_to_mjcf=str(file))
        shapes = solver.mjc_geom_to_newton_shape.numpy()[0]
        names = {solver.mj_model.geom(i).name: int(shape) for i, shape in enumerate(shapes)}
        return ElementTree.parse(file).getroot(), names


def _tidy_body(body: ElementTree.Element) -> None:
    """Name a body, its joint and its grasp site; leave out what is Newton's own business."""
    name = str(body.get("name")).removeprefix(PREFIX)
    body.attrib = {"name": name, **{key: value for key, value in body.items() if key in ("pos", "quat")}}
    for joint in (*body.findall("joint"), *body.findall("freejoint")):
        joint.set("name", name)
        for key in ("actuatorfrcrange", "actuatorfrclimited"):  # 1e6, which limits nothing
            joint.attrib.pop(key, None)
    for site in body.findall("site"):
        site.set("name", f"{name}_grasp")


def _tidy_geom(geom: ElementTree.Element, name: str) -> None:
    """Name a hull and its mesh; let it collide with everything, as a robot added later will expect.

    Newton's masks only repeat what joints and exclusions say, in bits of which a robot's geoms know nothing.
    """
    geom.attrib |= {"name": name, "mesh": name, "group": HULL}
    for key in (*MASKS, "pos", "quat"):  # a hull's vertices lie in its body's frame
        geom.attrib.pop(key, None)


def _add_surfaces(root: ElementTree.Element, linked: LinkedRoom, folder: Path) -> None:
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


def _child(root: ElementTree.Element, tag: str) -> ElementTree.Element:
    child = root.find(tag)
    return ElementTree.SubElement(root, tag) if child is None else child


def _element(tag: str, **attributes: str) -> ElementTree.Element:
    return ElementTree.Element(tag, attributes)
