"""Colours are levels as shown in a mesh, and linear light in USD."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from s2a.core.color_space import to_bytes, to_linear, to_srgb
from s2a.scene.scene import Mesh
from s2a.scene.usd.stage import new_stage, read_mesh, save, write_mesh

LEVELS = np.arange(256, dtype=np.uint8)


def test_every_level_survives_the_way_there_and_back() -> None:
    assert np.array_equal(to_bytes(to_linear(LEVELS)), LEVELS)
    assert np.allclose(to_linear(LEVELS), to_linear(LEVELS / 255), atol=1e-7)


@pytest.mark.parametrize(("level", "light"), [(0, 0), (255, 1), (188, 0.5029), (128, 0.2159), (10, 10 / 255 / 12.92)])
def test_levels_are_those_of_the_standard(level: int, light: float) -> None:
    assert to_linear(np.array([level], np.uint8))[0] == pytest.approx(light, abs=1e-4)


def test_what_is_no_colour_stays_so_or_is_clipped() -> None:
    assert to_srgb(np.array([-1.0, 2.0])).tolist() == [0, 1]
    assert np.isnan(to_srgb(np.array([np.nan])))[0]


def test_a_stage_holds_linear_light_and_gives_the_levels_back(tmp_path: Path) -> None:
    colors = np.array([(128, 51, 26), (0, 255, 1), (254, 3, 77)], np.uint8)
    mesh = Mesh(np.eye(3), np.array([[0, 1, 2]]), colors)
    stage = new_stage()
    write_mesh(stage, "/scene/part", mesh)
    save(stage, tmp_path / "part.usda")
    opened = Usd.Stage.Open(str(tmp_path / "part.usda"))  # held, since its prims end with it
    prim = opened.GetPrimAtPath("/scene/part")
    assert np.array(UsdGeom.Mesh(prim).GetDisplayColorPrimvar().Get())[0] == pytest.approx(
        [0.2159, 0.0331, 0.0103], abs=1e-4
    )
    assert np.array_equal(read_mesh(prim).colors, colors)
