"""Certificates: a clean stage passes, and each seeded defect is named by the rule that it breaks."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest
from cabinet import write_cabinet
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, Vt
from settings import load

from s2a import cli
from s2a.certify import contents, foundation, shapes, static
from s2a.certify.battery import CertifyConfig
from s2a.certify.check import Check
from s2a.certify.shapes import ShapeConfig
from s2a.errors import InputError
from s2a.usd.stage import new_stage, save

TARGET, CARCASS, JOINT = "/scene/drawer_2", "/scene/cabinet_1", "/scene/joints/drawer_2"
BAR = f"{TARGET}/colliders/hull_00"


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    return write_cabinet(tmp_path / "sim.usda")


def static_checks(path: Path) -> list[Check]:
    held = contents.read(path)
    config = load(dict, "certify/default")["shapes"]
    bounds = ShapeConfig(**config)
    return [rule(held) for rule in static.RULES] + [rule(held, bounds) for rule in shapes.RULES]


def edit(path: Path, change: Callable[[Usd.Stage], object]) -> None:
    """Change a stage on disk."""
    stage = Usd.Stage.Open(str(path))
    change(stage)
    stage.GetRootLayer().Save()


def attribute(stage: Usd.Stage, path: str, value: object) -> None:
    assert stage.GetAttributeAtPath(path).Set(value)


def wrong_units(stage: Usd.Stage) -> None:
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)


def missing_root(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath(CARCASS).RemoveAPI(UsdPhysics.ArticulationRootAPI)


def carcass_not_fixed(stage: Usd.Stage) -> None:
    stage.RemovePrim("/scene/joints/cabinet_1")


def stale_anchor(stage: Usd.Stage) -> None:
    UsdPhysics.Joint(stage.GetPrimAtPath(JOINT)).GetBody0Rel().SetTargets([])


def duplicate_target(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath(CARCASS).CreateAttribute("s2a:target", Sdf.ValueTypeNames.Int).Set(1)


def unknown_target(stage: Usd.Stage) -> None:
    attribute(stage, "/scene.s2a:target", "drawer_70")


def detached_joint(stage: Usd.Stage) -> None:
    UsdPhysics.Joint(stage.GetPrimAtPath(JOINT)).GetBody0Rel().SetTargets(["/scene/cabinet_9"])


def second_joint(stage: Usd.Stage) -> None:
    Sdf.CopySpec(stage.GetRootLayer(), JOINT, stage.GetRootLayer(), f"{JOINT}_b")


def left_over_anchor(stage: Usd.Stage) -> None:
    """An anchor body that nothing hangs on any more."""
    UsdPhysics.RigidBodyAPI.Apply(UsdGeom.Xform.Define(stage, "/scene/drawer_9_anchor").GetPrim())


def nested_body(stage: Usd.Stage) -> None:
    inner = UsdGeom.Xform.Define(stage, f"{CARCASS}/shelf")
    UsdPhysics.RigidBodyAPI.Apply(inner.GetPrim())


def mirrored_body(stage: Usd.Stage) -> None:
    UsdGeom.Xformable(stage.GetPrimAtPath(TARGET)).AddScaleOp().Set(Gf.Vec3f(1, -1, 1))


def mirrored_frame(stage: Usd.Stage) -> None:
    attribute(stage, f"{JOINT}.physics:localRot1", Gf.Quatf(0, 0, 0, 1))


def axis_disagrees(stage: Usd.Stage) -> None:
    attribute(stage, f"{JOINT}.s2a:axis", Gf.Vec3d(math.cos(0.01), math.sin(0.01), 0.0))


def origin_disagrees(stage: Usd.Stage) -> None:
    attribute(stage, f"{JOINT}.physics:localPos0", Gf.Vec3f(0.351, 0.002, 0.7267))


def limits_in_centimetres(stage: Usd.Stage) -> None:
    attribute(stage, f"{JOINT}.s2a:limits", Gf.Vec2d(0.0, 40.0))
    attribute(stage, f"{JOINT}.physics:upperLimit", 40.0)


def limits_without_zero(stage: Usd.Stage) -> None:
    attribute(stage, f"{JOINT}.s2a:limits", Gf.Vec2d(0.1, 0.4))
    attribute(stage, f"{JOINT}.physics:lowerLimit", 0.1)


def one_flipped_limit(stage: Usd.Stage) -> None:
    attribute(stage, f"{JOINT}.physics:upperLimit", -0.4)


def flipped_limits(stage: Usd.Stage) -> None:
    attribute(stage, f"{JOINT}.s2a:limits", Gf.Vec2d(-0.4, 0.0))
    attribute(stage, f"{JOINT}.physics:lowerLimit", -0.4)
    attribute(stage, f"{JOINT}.physics:upperLimit", 0.0)


def limits_in_degrees(stage: Usd.Stage) -> None:
    """A door whose range was written as radians where UsdPhysics wants degrees."""
    joint = UsdPhysics.RevoluteJoint.Define(stage, JOINT)
    for end, value in (("lower", 0.0), ("upper", 1.57)):
        joint.GetPrim().CreateAttribute(f"physics:{end}Limit", Sdf.ValueTypeNames.Float).Set(value)
    attribute(stage, f"{JOINT}.s2a:limits", Gf.Vec2d(0.0, 1.57))


def zero_mass(stage: Usd.Stage) -> None:
    attribute(stage, f"{TARGET}.physics:mass", 0.0)


def impossible_inertia(stage: Usd.Stage) -> None:
    attribute(stage, f"{TARGET}.physics:diagonalInertia", Gf.Vec3f(0.1, 0.1, 0.3))


def dented_piece(stage: Usd.Stage) -> None:
    points = stage.GetAttributeAtPath(f"{BAR}.points")
    values = list(points.Get())
    values[0] = Gf.Vec3f(*(sum(v[i] for v in values) / len(values) for i in range(3)))
    points.Set(Vt.Vec3fArray(values))


def open_piece(stage: Usd.Stage) -> None:
    indices = stage.GetAttributeAtPath(f"{BAR}.faceVertexIndices")
    counts = stage.GetAttributeAtPath(f"{BAR}.faceVertexCounts")
    indices.Set(Vt.IntArray(list(indices.Get())[6:]))
    counts.Set(Vt.IntArray(list(counts.Get())[2:]))


def missing_collision(stage: Usd.Stage) -> None:
    for name in ("PhysicsCollisionAPI", "NewtonCollisionAPI", "NewtonMeshCollisionAPI"):
        stage.GetPrimAtPath(BAR).RemoveAppliedSchema(name)


def nan_point(stage: Usd.Stage) -> None:
    points = stage.GetAttributeAtPath(f"{TARGET}/visual.points")
    points.Set(Vt.Vec3fArray([Gf.Vec3f(math.nan), *list(points.Get())[1:]]))


def shifted_grasp(stage: Usd.Stage) -> None:
    attribute(stage, f"{TARGET}/grasp.xformOp:translate", Gf.Vec3d(0.351, 0.1, 0.7267))


def missing_grasp(stage: Usd.Stage) -> None:
    stage.RemovePrim(f"{TARGET}/grasp")


def missing_grasp_size(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath(f"{TARGET}/grasp").RemoveProperty("s2a:size")


def missing_region(stage: Usd.Stage) -> None:
    stage.RemovePrim(f"{TARGET}/region")


def empty_region(stage: Usd.Stage) -> None:
    """As a scan without a surface there is written: a Mesh without faces would be refused by Newton."""
    missing_region(stage)
    UsdGeom.Points.Define(stage, f"{TARGET}/region")


def missing_base(stage: Usd.Stage) -> None:
    stage.GetDefaultPrim().RemoveProperty("s2a:basePosition")


def missing_base_turn(stage: Usd.Stage) -> None:
    stage.GetDefaultPrim().RemoveProperty("s2a:baseOrientation")


def external_reference(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/scene/static").GetReferences().AddReference("./other.usda", "/scene")


def payload(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/scene/static").GetPayloads().AddPayload("./other.usda", "/scene")


def instance(stage: Usd.Stage) -> None:
    prim = stage.OverridePrim("/scene/static/copy")
    prim.GetReferences().AddInternalReference("/scene/materials")
    prim.SetInstanceable(True)


def no_colliders(stage: Usd.Stage) -> None:
    stage.RemovePrim(f"{TARGET}/colliders")


STATIC_DEFECTS = {
    wrong_units: "units", external_reference: "self_contained", payload: "self_contained", instance: "self_contained",
    duplicate_target: "target", unknown_target: "target", nested_body: "bodies", left_over_anchor: "bodies",
    mirrored_body: "bodies",
    missing_root: "root_joint", carcass_not_fixed: "root_joint", stale_anchor: "target_joint",
    detached_joint: "target_joint", second_joint: "target_joint", limits_in_centimetres: "joint_limits",
    limits_without_zero: "joint_limits", one_flipped_limit: "joint_limits", limits_in_degrees: "joint_limits",
    mirrored_frame: "joint_frames", axis_disagrees: "joint_frames", origin_disagrees: "joint_frames",
    flipped_limits: "opens_outwards", zero_mass: "mass", impossible_inertia: "mass", dented_piece: "convex",
    open_piece: "convex", missing_collision: "collision", nan_point: "finite", shifted_grasp: "grasp_site",
    no_colliders: "collider_count", missing_grasp: "grasp_and_base", missing_grasp_size: "grasp_and_base",
    missing_region: "grasp_and_base", empty_region: "grasp_and_base", missing_base: "grasp_and_base",
    missing_base_turn: "grasp_and_base",
}  # fmt: skip


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
    assert set(failed) - {STATIC_DEFECTS[defect], "usd"} <= entangled


def test_a_stage_of_another_kind_gets_no_certificate(tmp_path: Path) -> None:
    save(new_stage(), tmp_path / "other.usda")
    with pytest.raises(InputError, match="not a simulation-ready stage"):
        contents.read(tmp_path / "other.usda")
    with pytest.raises(InputError, match="no such file"):
        contents.read(tmp_path / "missing.usd")


def quick(stage: Path, out: Path) -> list[str]:
    """Return arguments that certify without long waits."""
    times = ["certify.motion.settle_time=0.1", "certify.motion.open_time=0.1", "look.width=60", "look.height=40"]
    return ["certify", f"stage={stage}", f"out={out}", *times]


def test_the_command_writes_a_record_and_a_page_and_keeps_them(
    stage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "certificate"
    assert cli.main(quick(stage, out)) == 0
    assert "PASSED; drawer_2: graspable" in capsys.readouterr().out
    record = json.loads((out / "certificate.json").read_text())
    assert record["passed"] and {"name", "value", "bound", "prim", "remedy"} <= set(record["checks"][0])
    page = (out / "certificate.html").read_text()
    assert page.count("<img") == 4 and "finger_closure" in page and "<h1>drawer_2: passed</h1>" in page
    written = (out / "certificate.json").stat().st_mtime_ns
    assert cli.main(quick(stage, out)) == 0
    assert "kept from" in capsys.readouterr().out and (out / "certificate.json").stat().st_mtime_ns == written


def test_a_failed_check_is_a_result_with_exit_code_1(
    stage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    edit(stage, zero_mass)
    assert cli.main(quick(stage, tmp_path / "certificate")) == 1
    captured = capsys.readouterr()
    assert "FAILED" in captured.out and "mass at /scene/drawer_2" in captured.out and "a mass of 0 kg" in captured.out
    assert "bug" not in captured.err and (tmp_path / "certificate" / "certificate.html").exists()


@pytest.mark.parametrize("defect", [missing_grasp, missing_grasp_size, empty_region, missing_base])
def test_what_physics_would_ask_in_vain_is_a_failed_check_and_no_bug(
    defect: Callable[[Usd.Stage], None], stage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    edit(stage, defect)
    assert cli.main(quick(stage, tmp_path / "certificate")) == 1
    captured = capsys.readouterr()
    assert "grasp_and_base at /scene" in captured.out and "bug" not in captured.err


def test_a_sweep_ends_with_a_table_and_the_worst_exit_code(
    stage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.argv", ["s2a"])
    monkeypatch.setenv("HYDRA_FULL_ERROR", "1")
    first, second = stage.with_name("a.usda"), stage.with_name("b.usda")
    for path, defect in ((first, zero_mass), (second, missing_root)):
        write_cabinet(path)
        edit(path, defect)
    arguments = quick(stage, Path("certificate"))
    arguments[1] = f"stage={first},{second}"
    assert cli.main([*arguments, "-m", f"hydra.sweep.dir={tmp_path / 'sweep'}"]) == 1
    lines = capsys.readouterr().out.splitlines()
    last = lines.index("0 of 2 passed")
    assert " mass" in lines[last - 2] and " root_joint" in lines[last - 1]


def test_the_foundations_rules_hold_for_a_clean_stage(stage: Path) -> None:
    pytest.importorskip("simready.validate", reason="an optional extra")
    checks = foundation.foundation(stage, load(CertifyConfig, "certify/default").foundation)
    required = [check for check in checks if check.status != "reported"]
    assert [check.name for check in required if check.status == "pass"] == [
        f"simready:{name}" for name in ("FET_003_NEWTON", "FET_003_STANDARD", "FET_004_NEWTON", "FET_004_STANDARD")
    ]


def test_without_the_validator_its_rules_are_not_run(stage: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    (check,) = foundation.foundation(stage, load(CertifyConfig, "certify/default").foundation)
    assert check.status == "not run" and "s2a[simready]" in check.remedy
