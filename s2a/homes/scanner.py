"""A scanner on a tripod or in a hand: from a furnished room to one noisy surface with holes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from s2a.core.bounds import AtLeast, CountFromZero, Fraction, Positive
from s2a.core.progress import track
from s2a.homes.handheld import DriftConfig, drifts, smoothed
from s2a.homes.panorama import NoiseConfig, cast_panorama
from s2a.homes.pixel_planes import measure
from s2a.homes.project_to_scan import project_to_scan
from s2a.homes.solids import rotation, translation
from s2a.homes.surface_nets import extract
from s2a.homes.thin import ThinConfig, thin
from s2a.homes.tsdf import FusionConfig, fuse
from s2a.scene.geometry.mesh_query import RayMesh


@dataclass(frozen=True)
class ScannerConfig:
    """How a room is scanned.

    Attributes:
        poses: number of places from which it is scanned; a room of virtual=classic has no more than 6.
        spacing: mean angle between rays [rad].
        reach: longest range that is measured [m].
        noise: errors of the ranges.
        drift: errors of the places.
        dark: fraction of the rays that a black surface swallows; less on lighter ones, none from a luminance of LIGHT on.
        fusion: how all panoramas become one surface.
        smooth: passes of averaging over neighbouring vertices after the fusion.
        project_to_scan: Project vertices onto the measured planes, which keeps a laser's detail.
        colors: "surface": of the nearest true surface; "camera": of what is seen from where the scanner stood, so that a
            handle that is missing in the mesh is painted on its front.
        thin: how that surface is thinned out.
        glb: Write a textured GLB with y up beside the annotated scan.
    """

    poses: Annotated[int, AtLeast(4, 24)]
    spacing: Positive
    reach: Positive
    noise: NoiseConfig
    drift: DriftConfig
    dark: Fraction
    fusion: FusionConfig
    smooth: CountFromZero
    project_to_scan: bool
    colors: Literal["surface", "camera"]
    thin: ThinConfig
    glb: bool


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
    offsets, turns = drifts(len(scanners), config.drift, rng)
    panoramas = []
    for i, errors in track(list(enumerate(rng.spawn(len(scanners)))), "scan"):
        pose = T_room_scene @ translation(scanners[i]) @ rotation(turns[i])
        ranges = cast_panorama(mesh, dropout, pose, config.spacing, config.noise, errors)
        panoramas.append(np.where(ranges > config.reach, np.float32(0.0), ranges))
    views = measure(panoramas, scanners + offsets, config.spacing)
    net = extract(fuse(views, bounds, config.fusion))
    net = project_to_scan(net, views, config.fusion.voxel) if config.project_to_scan else net
    return thin(smoothed(net, config.smooth), config.thin)
