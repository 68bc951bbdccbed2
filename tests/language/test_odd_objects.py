"""Object files with something odd in them: each is read, or one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom

from s2a.commands import cli
from s2a.core.errors import InputError
from s2a.language.insert.object_file import ObjectConfig, read_object
from s2a.scene.usd.stage import open_stage

READ = ObjectConfig(20_000, 7.0)
OBJ = "v 0 0 0\nv {} 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def scaled(path: Path, factor: float) -> Path:
    """Write a triangle below a scaled prim."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.Xform.Define(stage, "/object").AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(factor))
    mesh = UsdGeom.Mesh.Define(stage, "/object/shape")
    mesh.CreatePointsAttr([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    mesh.CreateFaceVertexCountsAttr([3] * 4)
    mesh.CreateFaceVertexIndicesAttr([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3])
    stage.Save()
    return path


@pytest.mark.parametrize("factor", [1e300, 1e30, -1e300, 1e12, float("inf"), float("nan"), 0.0])
def test_a_stage_scaled_beyond_all_bounds_is_one_line(tmp_path: Path, factor: float) -> None:
    with pytest.raises(InputError, match="object.usda: ") as error:
        read_object(scaled(tmp_path / "object.usda", factor), READ)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("far", ["1e30", "1e300", "-1e38", "1e400"])
def test_a_mesh_beyond_all_bounds_is_one_line(tmp_path: Path, far: str) -> None:
    (tmp_path / "object.obj").write_text(OBJ.format(far))
    try:
        mesh = read_object(tmp_path / "object.obj", READ).mesh
    except InputError as error:
        assert "object.obj" in str(error) and "\n" not in str(error)
    else:
        assert np.abs(mesh.bounds).max() < 1e9


@pytest.mark.parametrize("content", [b"solid \xff\xfe\x00", b"\x00" * 84 + b"\xff\xff\xff\xff", b"solid\nfacet", b""])
def test_a_damaged_mesh_is_called_so(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "object.stl").write_bytes(content)
    with pytest.raises(InputError, match="object.stl") as error:
        read_object(tmp_path / "object.stl", READ)
    assert "No module" not in str(error.value) and "\n" not in str(error.value)


def test_a_loop_of_links_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    (tmp_path / "a.obj").symlink_to("b.obj")
    (tmp_path / "b.obj").symlink_to("a.obj")
    (tmp_path / "stage.usd").symlink_to("stage.usd")
    given = [f"stage={tmp_path}/stage.usd", f"object={tmp_path}/a.obj", "label=mug", "llm=rules"]
    for out in (tmp_path / "out", tmp_path / "stage.usd"):
        assert cli.main(["insert", *given, f"out={out}"]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 2


@pytest.mark.parametrize("opener", ['def "a" {', 'def "a" (customData = {', "(", "[", "{"])
def test_text_that_nests_so_deeply_that_its_parser_would_crash_is_one_line(tmp_path: Path, opener: str) -> None:
    path = tmp_path / "deep.usda"
    path.write_text("#usda 1.0\n" + f"{opener}\n" * 150_000)
    for read in (open_stage, lambda file: read_object(file, READ)):
        with pytest.raises(InputError, match="nest deeper than"):
            read(path)
