"""ScanNet's and ScanNet++'s scans without joints, and meshes that nobody annotated -> Scene of flat, fixed parts."""

import logging
from pathlib import Path

import numpy as np

from s2a.scan import folder, ply, rest
from s2a.scene.scene import UNANNOTATED, Scene

_log = logging.getLogger(__name__)

NAME = "ScanNet, ScanNet++, bare mesh"


def recognise(path: Path) -> bool:
    """Return whether a folder holds a mesh: ScanNet's, ScanNet++'s, or any PLY file, as `s2a import` writes it."""
    return folder.has_mesh(path)


def read(path: Path) -> Scene:
    """Read a scan whose motions nobody annotated.

    With segments the scene holds their objects, numbered from 1 in the order of their file, and last, where faces are left
    over, one part "unannotated". A mesh alone becomes that one part, and a warning is logged.

    Raises:
        InputError: several meshes, or a damaged file.
    """
    files = folder.find_bare(path)
    surface = ply.read(files.mesh)
    scene = rest.scene(files.name, surface, np.full(len(surface.faces), -1), {}, {}, {}, files.segments)
    if [part.label for part in scene.parts.values()] == [UNANNOTATED]:
        _log.warning("%s: nothing is annotated; the whole room is one static part %r", files.mesh, UNANNOTATED)
    return scene
