"""ScanNet++ scans without Articulate3D's annotation, and bare meshes -> Scene of flat, fixed parts."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from s2a.scan import folder, ply, rest
from s2a.scan.cut import cut
from s2a.scene.scene import Scene

_log = logging.getLogger(__name__)


def read(path: Path) -> Scene:
    """Read the scan in a folder whose motions nobody annotated.

    With ScanNet++'s segments the scene holds its objects, numbered from 1 in the order of their file, and last, where
    faces are left over, one part "unannotated". A mesh alone becomes that one part, and a warning is logged.

    Raises:
        InputError: no mesh there, several, or a damaged file.
    """
    files = folder.find_bare(path)
    surface = ply.read(files.mesh)
    owner = np.full(len(surface.faces), -1, dtype=np.int32)
    names = rest.claim(surface, owner, 0, files.segments)
    if names == [rest.UNANNOTATED]:
        _log.warning("%s: nothing is annotated; the whole room is one static part %r", files.mesh, rest.UNANNOTATED)
    parts = rest.parts(names, 1, cut(surface, owner, len(names)))
    return Scene(files.name, parts, tuple(surface.origin.tolist()))
