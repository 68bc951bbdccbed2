"""A simulation-ready room as links: what moves or carries something that moves, each with its hulls and surfaces."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import newton
import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

from s2a.core.errors import InputError
from s2a.scene.geometry.mesh_ops import bake
from s2a.scene.scene import Mesh
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import ALL, SimRoom, in_scene
from s2a.sim.room import add_room, carrier_of, kept_bodies, owner
from s2a.sim.solver import SimConfig
from s2a.sim.world import empty_world, joint_index, stiffen

STATIC = "static"  # Id of the link that is the room itself
MIN_AREA = 1e-8  # [m^2] A tenth of a millimetre squared: less is not seen


@dataclass(frozen=True)
class Link:
    """A rigid body, or the room itself."""

    # convex hulls by name, in the body's frame, which is the scene's for all but free objects
    colliders: dict[str, Mesh] = field(default_factory=dict)
    visuals: dict[str, Mesh] = field(default_factory=dict)  # surfaces by name, in the same frame


@dataclass(frozen=True)
class LinkedRoom:
    """A room of which some bodies move and all else stands still."""

    room: SimRoom  # the room
    active: tuple[str, ...]  # ids of the articulated parts and free objects that move
    bodies: tuple[str, ...]  # ids of these and of the fixed bodies that carry them, parents before children
    links: dict[str, Link]  # by id, STATIC among them
    builder: newton.ModelBuilder  # the same room for Newton
    shape_names: list[str]  # name of every shape of the builder; that of a hull names it in its link too

    def filtered(self) -> list[tuple[str, str]]:
        """Return the pairs of links that do not collide: those that a joint connects, and those that overlap somewhere."""
        pairs = set()
        for part in (i for i in self.active if i in self.room.articulations):
            others = (carrier_of(self.room, part, self.bodies), *self.room.articulations[part].filtered)
            pairs |= {(min(part, i), max(part, i)) for i in others if i in self.bodies}
        return sorted(pairs)


def read_links(path: Path, parts: str | Sequence[str], config: SimConfig) -> LinkedRoom:
    """Read a simulation-ready room with its surfaces.

    `parts`: ALL, or ids of the articulated parts and free objects that move; all others are frozen at the scanned pose.

    Raises:
        InputError: no such file, or another kind of stage; an id that cannot move; nothing is to move.
    """
    room = sim_stage.read(path)
    named = (parts,) if isinstance(parts, str) else tuple(parts)
    active = room.movable if named == (ALL,) else tuple(dict.fromkeys(named))
    if not active:
        raise InputError(
            f"{path}: nothing of room {room.name!r} is to move; give parts={ALL}, parts=drawer_7 or parts=[drawer_6,door_8]"
        )
    bodies = kept_bodies(room, active)
    builder = empty_world()
    add_room(builder, room, sim_stage.open_physics(path), active, load_sites=True)
    for part in (i for i in active if i in room.articulations):
        dof = builder.joint_qd_start[joint_index(builder, part)]
        builder.joint_stiffness[dof] = config.joint.joint_stiffness(room.articulations[part])
        builder.joint_damping[dof] = config.joint.joint_damping(room.articulations[part])
        stiffen(builder, dof, config.dt)
    names = [_name(label) for label in builder.shape_label]
    links = {i: Link() for i in (*bodies, STATIC)}
    for shape, name in enumerate(names):
        if builder.shape_flags[shape] & newton.ShapeFlags.COLLIDE_SHAPES:
            body = builder.shape_body[shape]
            link = STATIC if body < 0 else builder.body_label[body].split("/")[-1]
            links[link].colliders[name] = _hull(builder, shape)
    _add_visuals(links, room, bodies)
    return LinkedRoom(room, active, bodies, links, builder, names)


def _name(label: str) -> str:
    """Return the name of a shape, from the path of its prim: drawer_7_hull_00, drawer_7_grasp; of the room floor_1_00."""
    last, body = label.split("/")[-1], owner(label)
    return last if body == STATIC else f"{body}_{last}"


def _hull(builder: newton.ModelBuilder, shape: int) -> Mesh:
    """Return a collider in its body's frame."""
    source, (*position, x, y, z, w) = builder.shape_source[shape], builder.shape_transform[shape]
    points = np.asarray(source.vertices, np.float64) * np.array(builder.shape_scale[shape])
    points = Rotation.from_quat((x, y, z, w)).apply(points) + position
    return Mesh(points, np.asarray(source.indices).reshape(-1, 3))


def _visible(mesh: Mesh) -> bool:
    """Return whether a surface is more than MuJoCo refuses: three vertices, or no area."""
    return len(mesh.vertices) > 3 and bool(mesh.face_areas.sum() > MIN_AREA)


def _add_visuals(links: dict[str, Link], room: SimRoom, bodies: Sequence[str]) -> None:
    """Give every surface to the link that it moves with."""
    if _visible(room.static_visual):
        links[STATIC].visuals[STATIC] = room.static_visual
    for body in (b for b in (*room.bodies.values(), *room.free.values()) if _visible(b.visual)):
        link = body.id if body.id in bodies else carrier_of(room, body.id, bodies) or STATIC
        points = body.visual.vertices if body.id in bodies else in_scene(body, body.visual)
        links[link].visuals[body.id] = Mesh(points, body.visual.faces, body.visual.colors)


FOLDER = "meshes"  # Of the mesh files, beside the file of the room


def write_hull(path: Path, mesh: Mesh) -> None:
    """Write a collider as OBJ; its numbers are read back as the same float32."""
    path.write_text(_vertices(mesh.vertices) + _rows("f {} {} {}", mesh.faces + 1))


def write_surface(path: Path, mesh: Mesh) -> None:
    """Write a surface as OBJ; its colours go into .mtl and .png files of the same name."""
    uv, texture = bake(mesh.faces, mesh.colors)
    Image.fromarray(texture[..., :3]).save(path.with_suffix(".png"))
    path.with_suffix(".mtl").write_text(f"newmtl {path.stem}\nKd 1 1 1\nmap_Kd {path.stem}.png\n")
    corners = np.stack([mesh.faces.ravel() + 1, np.arange(mesh.faces.size) + 1], axis=1).reshape(-1, 6)
    path.write_text(
        f"mtllib {path.stem}.mtl\nusemtl {path.stem}\n{_vertices(mesh.vertices)}"
        + _rows("vt {:.6f} {:.6f}", uv)
        + _rows("f {}/{} {}/{} {}/{}", corners)
    )


def _vertices(points: np.ndarray) -> str:
    return _rows("v {:.9g} {:.9g} {:.9g}", points)


def _rows(form: str, rows: np.ndarray) -> str:
    return "".join(form.format(*row) + "\n" for row in rows.tolist())
