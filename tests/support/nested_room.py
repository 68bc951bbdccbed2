"""A room with joints of every kind: a cabinet of four, a drawer behind a door, a lid that belongs to no furniture."""

from __future__ import annotations

from dataclasses import replace

from cabinet_rooms import clean_cabinet_room
from settings import load

from s2a.prepare.room import PrepareConfig
from s2a.scene.scene import Mesh, Part, Scene

INNER, LONE = "drawer_30", "drawer_40"
"""A drawer that hangs on door_5, and one without a parent."""


def nested_room() -> Scene:
    """Return the clean cabinet's room with a small drawer and its handle on a door, and a drawer that stands alone."""
    room = clean_cabinet_room()
    drawer, handle = room.parts["drawer_7"], room.parts["handle_11"]
    inner = replace(drawer, mesh=_moved(drawer.mesh, 0.4, (0.02, 0.19, 0.0)), parent="door_5")
    grip = Part("handle", _moved(handle.mesh, 0.4, (0.02, 0.19, 0.0)), INNER, "fixed", True)
    lone = replace(drawer, mesh=_moved(drawer.mesh, 1.0, (0.0, -1.2, 0.0)), parent=None)
    knob = Part("handle", _moved(handle.mesh, 1.0, (0.0, -1.2, 0.0)), LONE, "fixed", True)
    return Scene("nested", {**room.parts, INNER: inner, "handle_31": grip, LONE: lone, "handle_41": knob})


def quick() -> PrepareConfig:
    """Return settings without what takes seconds: the search for a base pose and fine decompositions."""
    found: PrepareConfig = load(PrepareConfig, "prepare/handle")
    furniture, around = (replace(one, resolution=3000) for one in (found.cabinet, found.room))
    return replace(found, cabinet=furniture, room=around, base=replace(found.base, search=False))


def _moved(mesh: Mesh, scale: float, by: tuple[float, float, float]) -> Mesh:
    """Return a mesh, scaled about its middle and moved [m]."""
    middle = mesh.bounds.mean(axis=0)
    return Mesh((mesh.vertices - middle) * scale + middle + by, mesh.faces, mesh.colors)
