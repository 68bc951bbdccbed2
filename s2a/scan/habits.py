"""Frames that capture programs are known to write, recognised by the names of their files."""

from __future__ import annotations

import re
from pathlib import Path

from s2a.scan.source import Stated

_HABITS = (
    (r"scene\d{4}_\d{2}_vh_clean(_2)?(\.labels)?\.ply", "z", "ScanNet"),
    (r"scene_\d{5}_\d{2}\.ply", "z", "MultiScan"),
    (r"mesh_aligned_0\.05\.ply", "z", "ScanNet++"),
    (r"\d+_3dod_mesh\.ply", "z", "ARKitScenes"),
    (r"\w*SpatialMapping\w*\.obj", "y", "HoloLens"),
    (r"textured_output\.obj", "y", "3d Scanner App"),
)


def habit(path: Path) -> Stated | None:
    """Return the frame, in metres, that the program behind a file's name writes; None for any other name."""
    for pattern, up, program in _HABITS:
        if re.fullmatch(pattern, path.name):
            return Stated(up, 1.0, f"{program}'s file name")
    return None
