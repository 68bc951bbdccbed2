"""Rooms as USDZ packages, and names that a page has to escape."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from pathlib import Path

import pytest
import usd_room
from cabinet import write_cabinet
from pxr import Sdf, Usd, UsdShade, UsdUtils

from s2a.commands import cli
from s2a.core.errors import InputError
from s2a.scene.usd import geometric, stamp


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A geometric stage and its package."""
    folder = tmp_path_factory.mktemp("package")
    geometric.write(usd_room.room(), folder / "room.usd")
    assert UsdUtils.CreateNewUsdzPackage(str(folder / "room.usd"), str(folder / "room.usdz"))
    return folder / "room.usdz"


def test_a_package_has_the_tree_of_its_stage(package: Path, capsys: pytest.CaptureFixture[str]) -> None:
    trees = []
    for path in (package, package.with_suffix(".usd")):
        assert cli.main(["view", f"path={path}", "text=true"]) == 0
        trees.append(capsys.readouterr().out)
    assert trees[0] == trees[1] and "4 jointed" in trees[0]


def test_a_package_has_the_image_of_its_stage(package: Path, tmp_path: Path) -> None:
    images = []
    for path in (package, package.with_suffix(".usd")):
        assert (
            cli.main(["view", f"path={path}", f"image={tmp_path / 'room.png'}", "camera.width=96", "camera.height=64"])
            == 0
        )
        images.append((tmp_path / "room.png").read_bytes())
    assert images[0] == images[1]


def test_a_package_of_another_program_is_one_line_that_names_import(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "scan.usda").write_text('#usda 1.0\n(\n defaultPrim = "R"\n)\ndef Xform "R"\n{\n}\n')
    assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "scan.usda"), str(tmp_path / "scan.usdz"))
    for more in ("text=true", f"image={tmp_path / 'room.png'}"):
        assert cli.main(["view", f"path={tmp_path / 'scan.usdz'}", more]) == 2
        message = capsys.readouterr().err
        assert message.count("\n") == 1 and "scan.usdz" in message and "s2a import mesh=" in message


def test_a_package_of_a_simulated_room_is_validated_as_its_stage_is(tmp_path: Path) -> None:
    stage, package = write_cabinet(tmp_path / "sim.usda"), tmp_path / "sim.usdz"
    stamp.write_stamp(stage, {"drawer_2": True})
    assert UsdUtils.CreateNewUsdzPackage(str(stage), str(package))
    verdict = stamp.read_stamp(package)
    assert verdict == stamp.read_stamp(stage) and verdict is not None and verdict.valid
    assert stamp.layer_hash(package) == stamp.layer_hash(stage)
    with pytest.raises(InputError, match="cannot be stamped; give stamp=false"):
        stamp.require_stampable(package)


def test_a_room_whose_name_usd_cannot_refer_to_is_refused_before_it_is_prepared(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    geometric.write(usd_room.room(), tmp_path / "room.usd")
    assert cli.main(["prepare", f"stage={tmp_path / 'room.usd'}", f"out={tmp_path}/two\nlines.usda"]) == 2
    message = capsys.readouterr().err.strip().splitlines()[-1]
    assert "holds a control character" in message and [file.name for file in tmp_path.iterdir()] == ["room.usd"]


def test_a_name_from_a_file_is_text_in_the_page(tmp_path: Path) -> None:
    pytest.importorskip("viser")
    name = "</title><script>alert(1)</script>&amp;"
    geometric.write(replace(usd_room.room(), name=name), tmp_path / "room.usd")
    assert cli.main(["view", f"path={tmp_path / 'room.usd'}", f"html={tmp_path / 'room.html'}"]) == 0
    text = (tmp_path / "room.html").read_text(encoding="utf-8")
    assert "<script>alert(1)" not in text
    assert "<title>&lt;/title&gt;&lt;script&gt;alert(1)&lt;/script&gt;&amp;amp;</title>" in text


def test_an_image_is_no_part_of_the_hash_of_a_stage_or_its_package(tmp_path: Path) -> None:
    stage, package = write_cabinet(tmp_path / "sim.usda"), tmp_path / "sim.usdz"
    (tmp_path / "paint.png").write_bytes(b"an image")
    layer = Sdf.Layer.FindOrOpen(str(stage))
    layer.Reload(force=True)
    scene = Usd.Stage.Open(layer)
    shader = UsdShade.Shader.Define(scene, "/scene/paint")
    shader.CreateIdAttr("UsdUVTexture")
    shader.CreateInput("file", Sdf.ValueTypeNames.Asset).Set("./paint.png")
    layer.Save()
    stamp.write_stamp(stage, {"drawer_2": True})
    assert UsdUtils.CreateNewUsdzPackage(str(stage), str(package))
    assert any(name.endswith(".png") for name in zipfile.ZipFile(package).namelist())
    verdict = stamp.read_stamp(package)
    assert verdict is not None and verdict.valid and verdict == stamp.read_stamp(stage)
