"""Assets of others: a clean one passes, a planted defect is named by its check, and a repair mends it without another look."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
import trimesh
from few import few
from pxr import Gf, Usd, UsdGeom, UsdPhysics

from s2a.certify import repair
from s2a.certify.asset import certify_asset
from s2a.commands import cli
from s2a.commands.certify import trimmed
from s2a.core.check import ValidationReport
from s2a.core.errors import InputError
from s2a.prepare.neighbours import split
from s2a.scene.scene import Mesh
from s2a.sim.asset import read

BOX = '<origin xyz="{at}"/><geometry><box size="{size}"/></geometry>'
MOMENTS = '<inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/>'
MASS = '<inertial><origin xyz="{at}"/><mass value="{mass}"/>' + MOMENTS + "</inertial>"
DOOR = {"at": "0.01 0.2 0", "size": "0.02 0.39 0.58"}  # beside its hinge


def cupboard(path: Path, **changed: str) -> Path:
    """Write a URDF of a block with a door before it, 3 mm apart; the hinge stands upright at the door's edge."""
    of = {
        "mass": "4", "i": "0.1", "origin": "0.203 -0.2 0.3", "axis": "0 0 1", "lower": "-2", "upper": "0",
        "damping": "0.1", **DOOR, **changed,
    }  # fmt: skip
    of = {"seen": BOX.format(**of), "hard": BOX.format(**of), **of}
    block, upright = BOX.format(at="0 0 0.3", size="0.4 0.4 0.6"), MASS.format(at="0 0 0.3", mass="20", i="0.6")
    inertial = MASS.format(**of)
    path.write_text(f"""<robot name="cupboard"><link name="world"/>
      <link name="block">{upright}<visual>{block}</visual><collision>{block}</collision></link>
      <link name="door">{inertial}<visual>{of["seen"]}</visual><collision>{of["hard"]}</collision></link>
      <joint name="fixed" type="fixed"><parent link="world"/><child link="block"/></joint>
      <joint name="hinge" type="revolute"><origin xyz="{of["origin"]}"/><parent link="block"/><child link="door"/>
        <axis xyz="{of["axis"]}"/><limit lower="{of["lower"]}" upper="{of["upper"]}" effort="10" velocity="10"/>
        <dynamics damping="{of["damping"]}"/></joint></robot>""")
    return path


def ring(path: Path) -> str:
    """Write a square ring, 0.3 m wide, of 0.04 m thick bars as OBJ; return its geometry in URDF."""
    bars = [trimesh.creation.box((0.04, 0.3, 0.04)), trimesh.creation.box((0.04, 0.04, 0.3))]
    moved = [bars[0].copy().apply_translation((0, 0, z)) for z in (-0.13, 0.13)]
    moved += [bars[1].copy().apply_translation((0, y, 0)) for y in (-0.13, 0.13)]
    trimesh.util.concatenate(moved).export(path)
    return f'<origin xyz="0.03 0.2 0"/><geometry><mesh filename="{path.name}"/></geometry>'


def failed(report: ValidationReport) -> set[str]:
    return {check.name for check in report.failed}


def repaired(path: Path, home: Path) -> tuple[ValidationReport, bool]:
    """Repair an asset into a folder; return the copy's report, and whether it looks the same."""
    first, subject = certify_asset(path)
    home.mkdir()
    repair.write(subject.asset, repair.plan(subject, first, trimmed, split), home, home)
    again, other = certify_asset(home / path.name)
    return again, repair.same_visuals(subject.asset, other.asset)


def test_a_clean_asset_passes_in_both_engines(tmp_path: Path) -> None:
    report, subject = certify_asset(cupboard(tmp_path / "clean.urdf"))
    assert report.failed == () and set(subject.asset.models) == {"MuJoCo", "Newton"}
    joint = subject.asset.joints["hinge"]
    assert joint.motion.limits == pytest.approx((-2.0, 0.0)) and joint.motion.origin == pytest.approx(
        (0.203, -0.2, 0.3)
    )


# It stands upright on its hinge and falls by a quarter of a turn; its moment is that of a plate 0.28 m high
FLAP = {"axis": "0 1 0", "lower": "0", "upper": "1.5708", "damping": "0", "origin": "0.203 -0.2 0.31", "i": "0.02627"}
FLAP |= {"at": "0.01 0.2 0.15", "size": "0.02 0.39 0.28"}
DEFECTS: dict[str, dict[str, str]] = {
    "rest_overlap": {"origin": "0.19 -0.2 0.3"},  # 10 mm in the block
    "range_overlap": {"lower": "-2", "upper": "0.4"},  # it turns on into the block
    "inertia": {"i": "50"},
    "structure": {"lower": "0", "upper": "-2"},
    "slam": FLAP,
    "units": {"seen": BOX.format(at="0.01 0.2 0", size="20 390 580")},
}


@pytest.mark.parametrize("check", few(DEFECTS))
def test_a_planted_defect_is_named_and_repaired(check: str, tmp_path: Path) -> None:
    path = cupboard(tmp_path / "asset.urdf", **DEFECTS[check])
    before = path.read_bytes()
    report, _ = certify_asset(path)
    assert check in failed(report)
    if check != "units":  # of which nobody but its maker knows which number is wrong
        again, same = repaired(path, tmp_path / "repaired")
        assert again.failed == () and same
    assert path.read_bytes() == before


def test_depths_speeds_and_moments_are_those_of_mechanics(tmp_path: Path) -> None:
    checks = {c.name: c for c in certify_asset(cupboard(tmp_path / "deep.urdf", **DEFECTS["rest_overlap"]))[0].checks}
    assert checks["rest_overlap"].value == pytest.approx(0.01, abs=2e-4)
    slam = next(c for c in certify_asset(cupboard(tmp_path / "flap.urdf", **FLAP))[0].checks if c.name == "slam")
    # From 0.02 of its range on, m g h of its centre becomes the energy of its turn
    start, moment = 0.02 * np.pi / 2, 0.02627 + 4.0 * (0.15**2 + 0.01**2)
    height = 0.15 * np.cos(start) - 0.01 * np.sin(start) + 0.01
    assert slam.value == pytest.approx(np.hypot(0.29, 0.02) * np.sqrt(2 * 4.0 * 9.81 * height / moment), rel=0.03)


def test_a_filled_opening_is_found_and_opened_and_a_ghost_gets_hulls(tmp_path: Path) -> None:
    frame = ring(tmp_path / "ring.obj")
    origin = {"origin": "0.3 -0.2 0.3"}
    path = cupboard(tmp_path / "filled.urdf", seen=frame, hard=frame, **origin)
    assert "filled_air" in failed(certify_asset(path)[0])
    again, same = repaired(path, tmp_path / "opened")
    assert again.failed == () and same
    hole = np.array([0.33, 0.0, 0.3])
    body = read(tmp_path / "opened/filled.urdf").sim_bodies()["door"]
    assert len(body.colliders) >= 4
    assert all(np.abs(c.mesh.vertices - hole).max(axis=1).min() > 0.1 for c in body.colliders)


MJCF = """<mujoco><worldbody><geom name="block" type="box" size="0.2 0.2 0.3" pos="0 0 0.3"/>
  <body name="drawer" pos="0.405 0 0.3"><joint name="slide" type="slide" axis="1 0 0" range="0 0.3" damping="5"/>
  <inertial pos="0 0 0" mass="4" diaginertia="{i} {i} {i}"/><geom type="box" size="0.2 0.15 0.1"/></body></worldbody>
  <contact><exclude body1="world" body2="drawer"/></contact></mujoco>"""


def usd(path: Path, inertia: float) -> Path:
    """Write a USD of a drawer that slides out of nothing."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, "Z")
    root = UsdGeom.Xform.Define(stage, "/asset")
    stage.SetDefaultPrim(root.GetPrim())
    UsdPhysics.ArticulationRootAPI.Apply(root.GetPrim())
    body = UsdGeom.Xform.Define(stage, "/asset/drawer").GetPrim()
    UsdPhysics.RigidBodyAPI.Apply(body)
    mass = UsdPhysics.MassAPI.Apply(body)
    mass.CreateMassAttr(4.0)
    mass.CreateDiagonalInertiaAttr(Gf.Vec3f(inertia))
    cube = UsdGeom.Cube.Define(stage, "/asset/drawer/cube")
    cube.CreateSizeAttr(0.3)
    UsdPhysics.CollisionAPI.Apply(cube.GetPrim())
    joint = UsdPhysics.PrismaticJoint.Define(stage, "/asset/slide")
    joint.CreateBody1Rel().SetTargets([body.GetPath()])
    joint.CreateAxisAttr("X")
    joint.CreateLowerLimitAttr(0.0)
    joint.CreateUpperLimitAttr(0.3)
    stage.Save()
    return path


def test_mjcf_and_usd_are_certified_and_repaired_in_their_own_format(tmp_path: Path) -> None:
    drawer = tmp_path / "drawer.xml"
    drawer.write_text(MJCF.format(i="40"))
    slide = usd(tmp_path / "drawer.usda", 40.0)
    for path in (drawer, slide):
        report, subject = certify_asset(path)
        assert failed(report) == {"inertia"} and subject.asset.joints
        again, same = repaired(path, tmp_path / f"{path.suffix[1:]}_repaired")
        assert again.failed == () and same


def test_a_repair_writes_hulls_in_metres_and_damping_per_radian_whatever_the_file_scales(tmp_path: Path) -> None:
    made = trimesh.creation.box((0.1, 0.2, 0.3))
    piece = Mesh(made.vertices, made.faces)
    drawer = tmp_path / "drawer.xml"
    drawer.write_text(
        MJCF.format(i="0.06").replace("<worldbody>", '<default><mesh scale="0.1 0.1 0.1"/></default><worldbody>')
    )
    stage = Usd.Stage.Open(str(usd(hinge := tmp_path / "hinge.usda", 0.06)))
    stage.RemovePrim("/asset/slide")
    UsdGeom.Xformable(stage.GetPrimAtPath("/asset/drawer")).AddScaleOp().Set(Gf.Vec3f(2.0))
    wall = UsdGeom.Cube.Define(stage, "/asset/wall")
    UsdPhysics.CollisionAPI.Apply(wall.GetPrim())
    joint = UsdPhysics.RevoluteJoint.Define(stage, "/asset/hinge")
    joint.CreateBody1Rel().SetTargets(["/asset/drawer"])
    stage.Save()
    for path in (drawer, hinge):
        asset, home = read(path), tmp_path / path.suffix[1:]
        (name,), (turn,) = set(asset.bodies) - {"world"}, asset.joints
        edits = repair.Edits(colliders={name: [piece], "world": [piece]}, damping={turn: 2.0})
        home.mkdir()
        repair.write(asset, edits, home, home)
        again = read(home / path.name)
        assert again.joints[turn].damping == pytest.approx(2.0)
        for body in again.bodies.values():
            (collider,) = body.colliders
            assert np.ptp(collider.bounds, axis=0) == pytest.approx([0.1, 0.2, 0.3])


def test_the_command_reports_in_four_formats_and_ends_with_the_verdict(tmp_path: Path, capsys) -> None:
    path = cupboard(tmp_path / "deep.urdf", **DEFECTS["rest_overlap"])
    out = tmp_path / "report"
    small = ["camera.width=60", "camera.height=40"]
    assert cli.main(["certify", f"asset={path}", f"out={out}", f"repair={tmp_path / 'mended'}", *small]) == 0
    shown = capsys.readouterr().out
    assert "as given: FAILED" in shown and "repaired: PASSED" in shown
    first, second = json.loads((out / "report.json").read_text())["reports"]
    assert not first["passed"] and second["passed"]
    (run,) = json.loads((out / "report.sarif").read_text())["runs"]
    assert {"rest_overlap", "range_overlap"} == {each["ruleId"] for each in run["results"] if each["level"] == "error"}
    suites = ElementTree.parse(out / "report.junit.xml").getroot()
    assert [int(suite.get("failures", "")) for suite in suites] == [2, 0]
    assert len(list(suites.iter("testcase"))) == len(first["checks"]) + len(second["checks"])


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("<robot name='a'><link name='b'>", "not XML"),
        ("<scene/>", "expected <robot> of a URDF or <mujoco>"),
        ("<robot name='a'><link name='b'><visual><geometry><mesh filename='no.stl'/></geometry></visual></link></robot>",
         "no.stl"),
        ("<robot name='a'></robot>", "holds no body"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_one_line(content: str, words: str, tmp_path: Path, capsys) -> None:
    path = tmp_path / "asset.urdf"
    path.write_text(content)
    with pytest.raises(InputError, match=words):
        read(path)
    assert cli.main(["certify", f"asset={path}", f"out={tmp_path / 'out'}"]) == 2
    error = capsys.readouterr().err.strip()
    assert words in error and "\n" not in error and not (tmp_path / "out").exists()


def test_stage_and_asset_exclude_each_other(tmp_path: Path, capsys) -> None:
    assert cli.main(["certify", f"out={tmp_path / 'out'}"]) == 2
    assert cli.main(["certify", "asset=a.urdf", "stage=b.usd", f"out={tmp_path / 'out'}"]) == 2
    assert cli.main(["certify", "asset=a.urdf", "part=lid", f"out={tmp_path / 'out'}"]) == 2
    assert capsys.readouterr().err.count("give stage=FILE") == 3


def test_no_output_replaces_the_original_or_the_other_output(tmp_path: Path, capsys) -> None:
    path, out = cupboard(tmp_path / "asset.urdf"), tmp_path / "out"
    (tmp_path / "hulls").mkdir()
    copies = tmp_path / "copies"
    copies.mkdir()
    cupboard(copies / path.name)
    for folder, place in ((tmp_path, out), (copies, out), (out, out), (out / "repaired", out)):
        assert cli.main(["certify", f"asset={path}", f"repair={folder}", f"out={place}"]) == 2
    assert path.is_file() and (copies / path.name).is_file() and not out.exists()
    assert len(capsys.readouterr().err.strip().splitlines()) == 4
