"""A mesh with vertex colours -> PLY."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from s2a.scene.scene import Mesh


def write_ply(path: Path, mesh: Mesh) -> None:
    """Write a mesh with vertex colours as ScanNet++ does: binary, little endian, float x y z, uchar red green blue."""
    vertex = np.dtype([("xyz", "<f4", 3), ("rgb", "u1", 3)])
    face = np.dtype([("count", "u1"), ("indices", "<i4", 3)])
    vertices, faces = np.empty(len(mesh.vertices), vertex), np.empty(len(mesh.faces), face)
    vertices["xyz"], vertices["rgb"] = mesh.vertices, mesh.colors
    faces["count"], faces["indices"] = 3, mesh.faces
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property float {axis}" for axis in "xyz"] + [f"property uchar {c}" for c in ("red", "green", "blue")]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    with path.open("wb") as file:
        file.write("\n".join(header).encode("ascii"))
        vertices.tofile(file)
        faces.tofile(file)
