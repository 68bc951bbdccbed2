"""Certificates: a clean stage passes, and each seeded defect is named by the rule that it breaks."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from cabinet import HANDLE, box, write_cabinet
from pxr import Sdf, Usd
from seeded_defects import (
    CARCASS,
    STATIC_DEFECTS,
    edit,
    empty_region,
    missing_base,
    missing_grasp,
    missing_grasp_size,
    missing_root,
    reshape,
    zero_mass,
)
from settings import load

from s2a.certify import contents, report
from s2a.certify.check_suite import CertifyConfig, certify
from s2a.certify.contents import STRUCTURE, Contents, ShapeConfig
from s2a.certify.portability import foundation
from s2a.certify.report import images
from s2a.commands import cli
from s2a.core import provenance
from s2a.core.check import Check, ValidationReport, at_most
from s2a.core.errors import InputError
from s2a.scene.geometry.camera import OrbitCamera
from s2a.scene.usd import sim_stage
from s2a.scene.usd.stage import new_stage, save
from s2a.scene.usd.stamp import content_hash, read_stamp, write_stamp


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    return write_cabinet(tmp_path / "sim.usda")


def static_checks(path: Path) -> list[Check]:
    held = contents.read(path)
    bounds = load(CertifyConfig, "certify/default").shapes
    return [*STRUCTURE.ask(held, bounds, "room"), *STRUCTURE.ask(held, bounds)]


def test_a_clean_stage_breaks_no_static_rule(stage: Path) -> None:
    assert [check for check in static_checks(stage) if check.status != "pass"] == []


@pytest.mark.parametrize("defect", STATIC_DEFECTS, ids=lambda defect: defect.__name__)
def test_a_static_defect_is_named_by_its_rule(defect: Callable[[Usd.Stage], None], stage: Path) -> None:
    save(new_stage(), stage.with_name("other.usda"))
    edit(stage, defect)
    failed = {check.name: check for check in static_checks(stage) if check.status == "fail"}
    named = failed[STATIC_DEFECTS[defect]]
    assert named.prim.startswith("/scene") and named.message and named.remedy
    # usd-core has rules of its own for some of these; without its target or joint, nothing of a stage holds together.
    entangled = {"target", "bodies", "root_joint", "target_joint", "collider_count", "grasp_site", "mass", "convex"}
    entangled |= {"mass_distribution"}  # asked of the same masses
    assert set(failed) - {STATIC_DEFECTS[defect], "usd"} <= entangled


def test_a_check_is_one_function(stage: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(STRUCTURE, "rules", list(STRUCTURE.rules))

    @STRUCTURE.check("room")
    def few_bodies(held: Contents, config: ShapeConfig) -> Check:
        return at_most("few_bodies", len(held.bodies), 1, "bodies", remedy="remove some")

    (result,) = certify(stage, load(CertifyConfig, "certify/default"))
    (check,) = [check for check in result.checks if check.name == "few_bodies"]
    assert check.status == "fail" and check.value == len(contents.read(stage).bodies) > 1
    assert "few_bodies" in result.checks[-1].message and result.checks[-1].name == "physics", "it is needed for physics"


def test_a_stage_of_another_kind_gets_no_certificate(tmp_path: Path) -> None:
    save(new_stage(), tmp_path / "other.usda")
    with pytest.raises(InputError, match="not a simulation-ready stage"):
        contents.read(tmp_path / "other.usda")
    with pytest.raises(InputError, match="no such file"):
        contents.read(tmp_path / "missing.usd")


def quick(stage: Path, out: Path) -> list[str]:
    """Return arguments that certify without long waits."""
    times = ["certify.motion.rest_time=0.1", "certify.motion.open_time=0.1", "camera.width=60", "camera.height=40"]
    return ["certify", f"stage={stage}", f"out={out}", *times]


@pytest.mark.slow
def test_the_command_writes_a_record_and_a_page_and_keeps_them(
    stage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        provenance, "__file__", str(tmp_path / "provenance.py")
    )  # in a changed checkout nothing is kept
    monkeypatch.setenv("S2A_COMMIT", "abc1234")
    out = tmp_path / "validation"
    assert cli.main(quick(stage, out)) == 0
    shown = capsys.readouterr().out
    assert "drawer_2: PASSED\n  graspable by a parallel gripper\n" in shown
    record = json.loads((out / "report.json").read_text())
    (result,) = record["reports"]
    assert record["passed"] and {"name", "value", "bound", "prim", "remedy"} <= set(result["checks"][0])
    page = (out / "report.html").read_text()
    assert page.count("<img") == 4 and "grasp_hold" in page and "1 of 1 parts passed</h1>" in page
    written = (out / "report.json").stat().st_mtime_ns
    assert cli.main(quick(stage, out)) == 0
    stamp = read_stamp(stage)
    assert stamp is not None and stamp.valid and stamp.parts == {"drawer_2": True}
    assert "kept from" in capsys.readouterr().out and (out / "report.json").stat().st_mtime_ns == written


def test_a_part_without_a_grasp_has_passed_and_a_line_of_its_own_says_why() -> None:
    hold = Check("grasp_hold", "info", message="not graspable by a parallel gripper: the region is 277 mm thick")
    results = [
        ValidationReport("a.usd", "", part, (check,), verdict, {}, 1.0)
        for part, check, verdict in (("door_1", hold, False), ("door_2", Check("mass", "pass"), True))
    ]
    head, grip, *_ = report.summary(results[0]).splitlines()
    assert head == "a.usd: door_1: PASSED"
    assert grip == "  not graspable by a parallel gripper: the region is 277 mm thick"
    lines = report.table(results).splitlines()
    assert lines[-3:] == ["2 of 2 passed", "graspable: door_2", "not graspable: door_1"]
    assert not any("passed" in line and "graspable" in line for line in lines)


def test_a_certificate_is_kept_for_the_same_file_settings_and_code_alone(tmp_path: Path) -> None:
    settings = {"bound": 0.1, "required": ("one", "two"), "none": float("nan")}
    code = {"commit": "abc"}
    made = ValidationReport("sim.usd", "5ca1ab1e", "drawer_2", (Check("mass", "pass", 1.0),), True, settings, 1.0, code)
    path = tmp_path / "report.json"
    assert report.kept(path, "5ca1ab1e", settings, code, ["drawer_2"]) is None
    path.write_text(report.to_json([made]))
    kept = report.kept(path, "5ca1ab1e", settings, code, ["drawer_2"])
    assert kept is not None and kept[0].checks == made.checks and kept[0].passed
    assert report.kept(path, "0ddba11", settings, code, ["drawer_2"]) is None
    assert report.kept(path, "5ca1ab1e", {**settings, "bound": 0.2}, code, ["drawer_2"]) is None
    assert report.kept(path, "5ca1ab1e", settings, {"commit": "def"}, ["drawer_2"]) is None
    assert report.kept(path, "5ca1ab1e", settings, code, ["drawer_2", "drawer_3"]) is None
    path.write_text(report.to_json([replace(made, provenance={"commit": "abc+"})]))
    assert report.kept(path, "5ca1ab1e", settings, {"commit": "abc+"}, ["drawer_2"]) is None


def test_a_stage_is_another_when_a_file_below_it_is(stage: Path, tmp_path: Path) -> None:
    over = tmp_path / "over.usda"
    over.write_text(f"#usda 1.0\n(\n    subLayers = [@{stage}@]\n)\n")
    before = content_hash(over)
    assert content_hash(over) == before != content_hash(stage)
    visuals = sim_stage.visuals_file(stage)
    mine = content_hash(stage)
    visuals.write_bytes(visuals.read_bytes() + b"# another line\n")
    assert content_hash(stage) != mine and content_hash(over) != before


def test_a_stamp_holds_until_the_content_changes(stage: Path) -> None:
    assert read_stamp(stage) is None
    before = content_hash(stage)
    write_stamp(stage, {"drawer_2": True})
    write_stamp(stage, {"door_3": False})
    assert content_hash(stage) == before, "a stamp is no content"
    stamp = read_stamp(stage)
    assert stamp is not None and stamp.valid and stamp.parts == {"drawer_2": True, "door_3": False}
    edit(stage, zero_mass)
    changed = read_stamp(stage)
    assert changed is not None and not changed.valid
    write_stamp(stage, {"door_3": True})
    renewed = read_stamp(stage)
    assert renewed is not None and renewed.valid and renewed.parts == {"door_3": True}


def test_a_certificate_never_takes_the_stages_own_place(
    stage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept/report.json").write_text("{}")
    mine = stage.rename(tmp_path / "kept" / stage.name)
    assert cli.main(quick(mine, tmp_path / "kept")) == 2
    assert "would be replaced with" in capsys.readouterr().err and mine.is_file()


@pytest.mark.slow
def test_only_what_moves_is_painted_orange_wherever_the_rest_stands(stage: Path) -> None:
    def blue() -> int:
        image = images(stage, "drawer_2", load(OrbitCamera, "camera/near"))["what collides; orange moves"].astype(int)
        return int((image[..., 2] > image[..., 0]).sum())

    def plate_on_the_bar(edited: Usd.Stage) -> None:
        path = f"{CARCASS}/colliders/hull_99"
        Sdf.CopySpec(edited.GetRootLayer(), f"{CARCASS}/colliders/hull_00", edited.GetRootLayer(), path)
        reshape(edited, path, box(tuple(HANDLE + [0.0072, 0.0, 0.0]), (0.0001, 0.08, 0.011)))

    without = blue()
    edit(stage, plate_on_the_bar)
    assert blue() > without + 500


def test_a_failed_check_is_a_result_with_exit_code_1(
    stage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    edit(stage, zero_mass)
    assert cli.main(quick(stage, tmp_path / "validation")) == 1
    captured = capsys.readouterr()
    assert "FAILED" in captured.out and "mass at /scene/drawer_2" in captured.out and "a mass of 0 kg" in captured.out
    assert "bug" not in captured.err and (tmp_path / "validation" / "report.html").exists()


@pytest.mark.parametrize("defect", [missing_grasp, missing_grasp_size, empty_region, missing_base])
def test_what_physics_would_ask_in_vain_is_a_failed_check_and_no_bug(
    defect: Callable[[Usd.Stage], None], stage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    edit(stage, defect)
    assert cli.main(quick(stage, tmp_path / "validation")) == 1
    captured = capsys.readouterr()
    assert "grasp_and_base at /scene" in captured.out and "bug" not in captured.err


@pytest.mark.slow
def test_a_sweep_ends_with_a_table_and_the_worst_exit_code(
    stage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.argv", ["s2a"])
    monkeypatch.setenv("HYDRA_FULL_ERROR", "1")
    first, second = stage.with_name("a.usda"), stage.with_name("b.usda")
    for path, defect in ((first, zero_mass), (second, missing_root)):
        write_cabinet(path)
        edit(path, defect)
    arguments = quick(stage, Path("validation"))
    arguments[1] = f"stage={first},{second}"
    assert cli.main([*arguments, "-m", f"hydra.sweep.dir={tmp_path / 'sweep'}"]) == 1
    lines = capsys.readouterr().out.splitlines()
    last = lines.index("0 of 2 passed")
    assert " mass" in lines[last - 2] and " root_joint" in lines[last - 1]


def test_the_foundations_rules_hold_for_a_clean_stage(stage: Path) -> None:
    pytest.importorskip("simready.validate", reason="an optional extra")
    checks = foundation(stage, load(CertifyConfig, "certify/default").foundation)
    required = [check for check in checks if check.status != "info"]
    assert [check.name for check in required if check.status == "pass"] == [
        f"simready:{name}" for name in ("FET_003_NEWTON", "FET_003_STANDARD", "FET_004_NEWTON", "FET_004_STANDARD")
    ]


def test_without_the_validator_its_rules_are_not_run(stage: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    (check,) = foundation(stage, load(CertifyConfig, "certify/default").foundation)
    assert check.status == "skipped" and "s2a[simready]" in check.remedy
    results = [ValidationReport("a.usd", "", part, (check,), None, {}, 0.0) for part in ("drawer_2", "door_3")]
    assert report.summary(results[0]).splitlines()[1:] == ["  grasp not tested", "  1 skipped"]
    missing = "  simready skipped: the package simready-validate is not installed; pip install 's2a[simready]'"
    assert report.skipped(results) == [missing], "one line for all parts"
    other = replace(results[1], checks=())
    assert report.skipped([results[0], other]) == [f"{missing} (drawer_2)"]
