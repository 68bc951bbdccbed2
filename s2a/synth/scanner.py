"""A scanner on a tripod: from a furnished room to one noisy surface with holes, as laser scans have them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from s2a.geometry.mesh_query import NoiseConfig, RayMesh, cast_panorama
from s2a.progress import track
from s2a.ranges import AtLeast, Positive
from s2a.synth.pixel_planes import measure
from s2a.synth.project_to_scan import snap
from s2a.synth.solids import rotation, translation
from s2a.synth.surface_nets import extract
from s2a.synth.thin import ThinConfig, thin
from s2a.synth.tsdf import FusionConfig, fuse


@dataclass(frozen=True)
class ScannerConfig:
    """How a room is scanned.

    Attributes:
        poses: number of places from which it is scanned, 4 to 6.
        spacing: mean angle between rays [rad].
        noise: errors of the ranges.
        fusion: how all panoramas become one surface.
        thin: how that surface is thinned out.
    """

    poses: Annotated[int, AtLeast(4, 6)]
    spacing: Positive
    noise: NoiseConfig
    fusion: FusionConfig
    thin: ThinConfig


def scan(
    mesh: RayMesh,
    dropout: np.ndarray,
    yaw: float,
    scanners: np.ndarray,
    bounds: np.ndarray,
    config: ScannerConfig,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the scanned surface: vertices [m] in the scene, shape [vertex 3], float32, and faces, shape [face 3], int32.

    Args:
        mesh: the room in its own frame.
        dropout: share of rays that each face swallows, shape [face].
        yaw: rotation of the room's frame about z against the scene [rad].
        scanners: where the scanner stood in the scene [m], shape [pose 3].
        bounds: of what is of interest in the scene [m], shape [2 3].
        config: the scanner.
        rng: where its errors come from.
    """
    T_room_scene = rotation((0.0, 0.0, -yaw))

    panoramas = [
        cast_panorama(mesh, dropout, T_room_scene @ translation(place), config.spacing, config.noise, errors)
        for place, errors in track(list(zip(scanners, rng.spawn(len(scanners)), strict=True)), "scan")
    ]
    views = measure(panoramas, scanners, config.spacing)
    net = snap(extract(fuse(views, bounds, config.fusion)), views, config.fusion.voxel)
    return thin(net, config.thin)
