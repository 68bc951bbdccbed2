"""Mesh files beside a converted room: OBJ, the colours of a scan as a texture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from s2a.scene.geometry.texture import bake
from s2a.scene.scene import Mesh

FOLDER = "meshes"
"""Of the mesh files, beside the file of the room."""


def write_hull(path: Path, mesh: Mesh) -> None:
    """Write a collider as OBJ; its numbers are read back as the same float32."""
    path.write_text(_vertices(mesh.vertices) + _rows("f {} {} {}", mesh.faces + 1))


def write_surface(path: Path, mesh: Mesh) -> None:
    """Write a surface as OBJ; its colours go into .mtl and .png files of the same name."""
    uv, texture = bake(mesh.faces, mesh.colors)
    Image.fromarray(texture[..., :3]).save(path.with_suffix(".png"))
    path.with_suffix(".mtl").write_text(f"newmtl {path.stem}\nKd 1 1 1\nmap_Kd {path.stem}.png\n")
    corners = np.stack([mesh.faces.ravel() + 1, np.arange(mesh.faces.size) + 1], axis=1).reshape(-1, 6)
    path.write_text(
        f"mtllib {path.stem}.mtl\nusemtl {path.stem}\n{_vertices(mesh.vertices)}"
        + _rows("vt {:.6f} {:.6f}", uv)
        + _rows("f {}/{} {}/{} {}/{}", corners)
    )


def _vertices(points: np.ndarray) -> str:
    return _rows("v {:.9g} {:.9g} {:.9g}", points)


def _rows(form: str, rows: np.ndarray) -> str:
    return "".join(form.format(*row) + "\n" for row in rows.tolist())
