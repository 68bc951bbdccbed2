"""Rooms and their visible surfaces from any file of s2a that holds one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from s2a import scan
from s2a.core.errors import InputError
from s2a.scene.scene import Mesh, Scene
from s2a.scene.usd import descriptive, geometric, sim_stage
from s2a.scene.usd.descriptive import DescribedPart
from s2a.scene.usd.sim_scene import SimRoom, in_scene
from s2a.scene.usd.stage import open_stage, read_attribute, reading

Content = Scene | SimRoom | dict[str, DescribedPart]
READERS: dict[str, Callable[[Path], Content]] = {
    descriptive.FLAVOUR: descriptive.read,
    geometric.FLAVOUR: geometric.read,
    sim_stage.FLAVOUR: sim_stage.read,
}


def read(path: Path) -> Content | None:
    """Read a scan's folder, or a descriptive, geometric or simulation-ready stage; None for a stage of another flavour.

    Raises:
        InputError: no such file, or a damaged one.
    """
    if path.is_dir():
        return scan.read(path)
    with reading(path):
        stage = open_stage(path, payloads=False)  # held, since its prims end with it
        reader = READERS.get(read_attribute(stage.GetDefaultPrim(), "flavour", str) or "")
        return reader(path) if reader else None


@dataclass(frozen=True)
class Visible:
    """Surfaces in scene coordinates.

    Attributes:
        name: of the scan.
        surfaces: what is seen, by the id of its part or the name of its prim.
        colliders: convex hulls with the part each stands for; none but in a simulation-ready stage.
        jointed: ids of the parts that move.
    """

    name: str
    surfaces: dict[str, Mesh]
    colliders: tuple[tuple[str, Mesh], ...]
    jointed: tuple[str, ...]

    def part(self, part_id: str) -> list[Mesh]:
        """Return the surfaces that bear a part's name, or else its colliders; InputError where it has neither."""
        pieces = [mesh for part, mesh in self.colliders if part == part_id]
        found = [self.surfaces[part_id]] if part_id in self.surfaces else pieces
        found = [mesh for mesh in found if len(mesh.faces)]
        if not found:
            known = dict.fromkeys([*self.surfaces, *(part for part, _ in self.colliders)])
            raise InputError(f"part {part_id!r} has no surface in {self.name!r}; those with one: {', '.join(known)}")
        return found


def visible(path: Path) -> Visible:
    """Read what there is to see in a scan's folder, a geometric or a simulation-ready stage.

    Raises:
        InputError: another file, or a damaged one.
    """
    match read(path):
        case Scene() as scene:
            return _scene(scene)
        case SimRoom() as room:
            return visible_room(room)
    raise InputError(f"{path}: holds no surfaces; give a scan's folder, a geometric or a simulation-ready stage")


def _scene(scene: Scene) -> Visible:
    return Visible(scene.name, {i: part.mesh for i, part in scene.parts.items()}, (), scene.movable)


def visible_room(room: SimRoom) -> Visible:
    """Return what there is to see in a simulation-ready room."""
    surfaces = {
        body.id: Mesh(in_scene(body, body.visual), body.visual.faces, body.visual.colors)
        for body in (*room.bodies.values(), *room.free.values())
        if len(body.visual.faces)
    }
    colliders = tuple((part, mesh) for _, part, mesh in hulls(room))
    return Visible(room.name, surfaces | {"static": room.static_visual}, colliders, tuple(room.articulations))


def hulls(room: SimRoom) -> Iterator[tuple[str, str, Mesh]]:
    """Yield the colliders of a simulation-ready room in scene coordinates: their body, their part, the hull."""
    for body in (*room.bodies.values(), *room.free.values()):
        for collider in body.colliders:
            yield body.id, collider.part, Mesh(in_scene(body, collider.mesh), collider.mesh.faces)
    for collider in room.static_colliders:
        yield "static", collider.part, collider.mesh
