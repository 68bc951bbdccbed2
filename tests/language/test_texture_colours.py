"""Textures of inserted objects survive as colours of vertices."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from s2a.language.insert.object_file import ObjectConfig, painted, read_object
from s2a.scan import source
from s2a.scan.source import SourceMesh

OBJECT = ObjectConfig()
RED, BLUE = (220, 20, 20), (20, 20, 220)


def checked(squares: int = 4, size: int = 64) -> Image.Image:
    """A chessboard in red and blue."""
    x, y = np.meshgrid(*[np.arange(size) * squares // size] * 2)
    return Image.fromarray(np.where(((x + y) % 2 == 0)[..., None], RED, BLUE).astype(np.uint8))


def crate(image: Image.Image | None) -> trimesh.Trimesh:
    """A box of 0.2 m, each side with vertices of its own and the whole texture."""
    box = trimesh.creation.box((0.2, 0.2, 0.2))
    corners = box.vertices[box.faces.reshape(-1)]
    normals = np.repeat(np.abs(box.face_normals).argmax(axis=1), 3)
    uv = np.array([np.delete(corner, axis) for corner, axis in zip(corners, normals, strict=True)]) / 0.2 + 0.5
    shape = trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=image)
    shape.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    return shape


def near(colors: np.ndarray, color: tuple[int, int, int]) -> np.ndarray:
    return np.abs(colors.astype(int) - color).max(axis=1) < 30


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["glb", "obj"])
def test_the_squares_of_a_texture_are_on_the_object(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"crate.{ending}"
    crate(checked()).export(path)
    mesh = read_object(path, OBJECT).mesh
    assert mesh.colors is not None
    assert len(mesh.faces) <= OBJECT.faces
    centers, colors = mesh.vertices[mesh.faces].mean(axis=1), mesh.colors[mesh.faces].mean(axis=1)
    areas = np.asarray(mesh.face_areas, float)
    for color in (RED, BLUE):
        share = areas[near(colors, color)].sum() / areas.sum()
        # Half of it, less two to three texels of 64 at each of three borders in both directions.
        assert 0.5 * (55 / 64) ** 2 < share < 0.5 * (58 / 64) ** 2
    # A square of the top and the one beside it.
    top = centers[:, 2] > 0.099
    squares = [top & (np.abs(centers[:, :2] - place).max(axis=1) < 0.015) for place in ((0.025, 0.025), (0.075, 0.025))]
    assert near(colors[squares[0]].mean(axis=0)[None], RED) != near(colors[squares[1]].mean(axis=0)[None], RED)


def test_splitting_leaves_the_shape_closed_and_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "crate.glb"
    crate(checked()).export(path)
    mesh = read_object(path, OBJECT).mesh
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces)
    assert solid.is_watertight
    assert solid.volume == pytest.approx(0.008, rel=1e-4)


def written(path: Path, image: Image.Image | None) -> SourceMesh:
    crate(image).export(path)
    return source.read(path)


def test_what_has_one_colour_is_not_split_and_a_budget_holds(tmp_path: Path) -> None:
    plain = painted(written(tmp_path / "plain.glb", Image.new("RGB", (8, 8), RED)), 60000)
    assert len(plain[1]) == 12
    assert plain[2] is not None and (plain[2] == RED).all()
    assert len(painted(written(tmp_path / "checked.glb", checked(16)), 200)[1]) <= 200


def test_what_has_neither_colour_nor_material_has_none(tmp_path: Path) -> None:
    trimesh.creation.box().export(tmp_path / "box.stl")
    assert painted(source.read(tmp_path / "box.stl"), 1000)[2] is None
