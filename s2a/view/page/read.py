"""The data of a page, from files."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from s2a.core import config
from s2a.core.errors import InputError
from s2a.scan import visuals
from s2a.scene.geometry.mesh_ops import keep
from s2a.scene.scene import Mesh, Scene
from s2a.scene.usd.descriptive import DescribedPart
from s2a.scene.usd.sim_scene import SimBody, SimRoom, in_scene
from s2a.view.page.room import Extra, PagePart, PageRoom, RobotStand

THINNEST = 1e-3
"""[m] Of a box that is shown."""


def read(path: Path) -> PageRoom:
    """Read a scan's folder, or a descriptive, geometric or simulation-ready stage.

    Raises:
        InputError: another file, or a damaged one.
    """
    match visuals.read(path):
        case Scene() as scene:
            return of_scene(scene)
        case SimRoom() as room:
            return of_sim_room(room)
        case dict() as parts:
            return of_description(path.stem, parts)
    raise InputError(
        f"{path}: cannot be shown on a page; give a scan's folder, or a stage of s2a export or s2a prepare"
    )


def of_scene(scene: Scene) -> PageRoom:
    """Return the page of a scene."""
    movers = {i: _moving(scene, scene.body(i)) for i in scene.parts}
    return PageRoom(
        scene.name,
        {
            i: PagePart(part.label, part.mesh, part.parent, movers[i], part.motion, part.mass)
            for i, part in scene.parts.items()
        },
        {i: _moving(scene, scene.parent_body(i)) for i in scene.movable},
        grasps=tuple(
            Extra(i, i, scene.parts[handle].mesh)
            for i in scene.movable
            for handle in scene.handle_parts(i)
            if handle != i  # else it has none
        ),
    )


def of_sim_room(room: SimRoom) -> PageRoom:
    """Return the page of a simulation-ready room."""
    bodies = {i: body for i, body in room.bodies.items() if len(body.visual.faces) or body.colliders}
    shown = {i: _body(room, body, bodies) for i, body in (bodies | room.free).items()}
    return PageRoom(
        room.name,
        shown | {i: PagePart(label_of(i), mesh) for i, mesh in _static(room).items() if i not in shown},
        {i: part.parent if part.parent in room.articulations else None for i, part in room.articulations.items()},
        tuple(
            [
                Extra(collider.part, _jointed(room, body.id), Mesh(in_scene(body, collider.mesh), collider.mesh.faces))
                for body in (*room.bodies.values(), *room.free.values())
                for collider in body.colliders
            ]
            + [Extra(collider.part, None, collider.mesh, collider.structure) for collider in room.static_colliders]
        ),
        tuple(Extra(i, i, part.grasp.region) for i, part in room.articulations.items()),
        stands=tuple(_stands(room)),
    )


def of_description(name: str, parts: Mapping[str, DescribedPart]) -> PageRoom:
    """Return the page of a description: the box of every part, which holds those inside it, too."""
    return PageRoom(
        name,
        {
            i: PagePart(
                part.label,
                _box(part),
                part.parent,
                _described_mover(parts, i),
                part.joint or ("free" if part.motion == "free" else "fixed"),
                part.mass,
            )
            for i, part in parts.items()
        },
        {i: _described_mover(parts, part.against) for i, part in parts.items() if part.joint},
        boxes=True,
    )


def label_of(part_id: str) -> str:
    """Return the label in an id ("kitchen drawer" of kitchen_drawer_7), for stages that keep no other."""
    return part_id.rpartition("_")[0].replace("_", " ") or part_id


def _moving(scene: Scene, body: str | None) -> str | None:
    return body if body in scene.movable else None


def _jointed(room: SimRoom, body: str) -> str | None:
    return body if body in room.articulations else None


def _body(room: SimRoom, body: SimBody, shown: dict[str, SimBody]) -> PagePart:
    surface = Mesh(in_scene(body, body.visual), body.visual.faces, body.visual.colors)
    articulation = room.articulations.get(body.id)
    if articulation is None:
        free = body.id in room.free
        return PagePart(label_of(body.id), surface, None, None, "free" if free else "fixed", body.mass.mass)
    parent = articulation.parent if articulation.parent in shown else None
    return PagePart(label_of(body.id), surface, parent, body.id, articulation.joint, body.mass.mass)


def _static(room: SimRoom) -> dict[str, Mesh]:
    """Return the surfaces of the room that stands still, by part; as one where the stage does not tell its parts."""
    visual, owners = room.static_visual, room.static_face_part
    if owners is None or not room.static_parts:
        return {"static": visual}
    order = np.argsort(owners, kind="stable")
    ends = np.searchsorted(owners[order], np.arange(len(room.static_parts) + 1))
    faces = {part: order[ends[i] : ends[i + 1]] for i, part in enumerate(room.static_parts)}
    return {part: keep(visual, those) for part, those in faces.items() if len(those)}


def _stands(room: SimRoom) -> Iterator[RobotStand]:
    """Yield where robots stand whose sizes a file of conf/robot tells."""
    for part, articulation in room.articulations.items():
        for robot, base in articulation.bases.items():
            if (config.folder() / "robot" / f"{robot}.yaml").is_file():
                size = config.file(f"robot/{robot}")["base"]
                foot = np.array(base.position)
                shoulder = foot + [0.0, 0.0, size["shoulder_height"]]
                yield RobotStand(part, foot, shoulder, size["reach"], size["radius"], base.free)


def _described_mover(parts: Mapping[str, DescribedPart], part: str | None) -> str | None:
    """Return the jointed part that a part moves with: itself, or the nearest one that it is inside of."""
    while part is not None and part in parts and parts[part].joint is None:
        part = parts[part].parent
    return part if part in parts else None  # "world" is none


def _box(part: DescribedPart) -> Mesh:
    if part.center is None or part.size is None:
        return Mesh(np.zeros((0, 3)), np.zeros((0, 3)))
    from s2a.scene.geometry.convex import box  # brings scipy, which no other flavour needs

    cos, sin = math.cos(part.yaw), math.sin(part.yaw)
    axes = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return box(np.array(part.center), axes, np.maximum(part.size, THINNEST))
