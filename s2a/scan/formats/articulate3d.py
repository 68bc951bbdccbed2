"""Articulate3D's annotations on a ScanNet++ mesh -> Scene.

Lenient where releases differ (missing optional keys, untidy labels, repeated records: a warning is logged), strict
where a guess would be wrong. What belongs to what comes from the labels of `<scene>_parts.json`, what moves from
`<scene>_artic.json`, and the rest of the room from ScanNet++'s own annotation.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from s2a.scan import articulate3d_files, folder, labels, ply, rest
from s2a.scan.articulate3d_files import AnnotatedPart
from s2a.scan.rest import cut
from s2a.scene.scene import Joint, Mesh, Part, Scene

NAME = "Articulate3D"
PRIORITY = 30


def recognise(path: Path) -> bool:
    """Return whether a folder holds any of Articulate3D's files, maybe not all."""
    return folder.is_articulate3d(path)


def read(path: Path) -> Scene:
    """Read the annotated scan in a folder.

    The scene holds Articulate3D's parts as their labels nest. Then follow, numbered on from the largest partId, fixed
    and flat: the ScanNet++ objects that those parts do not cover already, in the order of their file, and last, where
    faces are left over, one part "unannotated". Parts called REMOVE are left out with all that belongs
    to them; SPLIT ones that do not move are "unannotated".

    Raises:
        InputError: a file is missing, damaged, or does not belong to the others.
    """
    files = folder.find(path)
    surface = ply.read(files.mesh)
    annotated = articulate3d_files.read_parts(files.parts, surface)
    names = {number: part.label for number, part in annotated.items()}
    parent_of = labels.parents(names)
    moving = articulate3d_files.read_joints(files.articulations, names, surface.origin)
    artefacts = labels.artefacts(names, parent_of)
    gone = artefacts | {number for number, name in names.items() if number not in moving and labels.is_split(name)}
    owner = articulate3d_files.owners(annotated, labels.depths(parent_of), len(surface.faces))
    place = [rest.REMOVED if number in artefacts else -1 if number in gone else 0 for number in annotated]
    order = np.cumsum([number not in gone for number in annotated]) - 1
    owner = np.append(np.where(place, place, order), -1)[owner]
    rest.warn_of_removed(files.parts, int((owner == rest.REMOVED).sum()))
    annotated = {number: part for number, part in annotated.items() if number not in gone}
    moving = {number: joint for number, joint in moving.items() if number not in gone}
    parent_of = labels.without(parent_of, gone)
    further = rest.claim(surface, owner, len(annotated), files.segments)
    meshes = cut(surface, owner, len(annotated) + len(further))
    nested = _nested_parts(annotated, parent_of, moving, meshes[: len(annotated)])
    flat = rest.parts(further, max(names, default=0) + 1, meshes[len(annotated) :])
    return Scene(files.name, nested | flat, tuple(surface.origin.tolist()))


def _nested_parts(
    annotated: Mapping[int, AnnotatedPart],
    parent_of: Mapping[int, int | None],
    moving: Mapping[int, Joint],
    meshes: list[Mesh],
) -> dict[str, Part]:
    """Return Articulate3D's parts by id, every part followed by what belongs to it."""
    mesh_of = dict(zip(annotated, meshes, strict=True))
    name_of = {number: labels.split(part.label)[0] for number, part in annotated.items()}
    id_of = {number: labels.part_id(name, number) for number, name in name_of.items()}
    grasped = labels.grasped(set(moving), parent_of)
    return {
        id_of[number]: Part(
            label=name_of[number],
            mesh=mesh_of[number],
            parent=None if (parent := parent_of[number]) is None else id_of[parent],
            motion=moving.get(number, "fixed"),
            graspable=number in grasped,
            mass=annotated[number].mass,
        )
        for number in labels.parents_first(parent_of)
    }
