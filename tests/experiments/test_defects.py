"""Defects that the experiments seed into a room or its file: each is named by one check."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cabinet import box, write_cabinet
from defects_of_files import EDITS
from defects_of_rooms import CHANGES
from few import few
from pxr import Usd
from settings import load
from wrong_annotations import transformed

from s2a.certify import contents, portability
from s2a.certify.check_suite import CertifyConfig
from s2a.certify.contents import STRUCTURE
from s2a.certify.scan_evidence import Evidence, as_scene
from s2a.scan.evidence.surface import ScanSurface
from s2a.scene.usd import sim_stage

SETTINGS: CertifyConfig = load(CertifyConfig, "certify/default")
CONFIG, SHAPES = SETTINGS.evidence, SETTINGS.shapes
NAMED = {
    "axis_flipped": "opens_outward", "limits_negated": "opens_outward", "axis_tilted_15_deg": "slide_axis",
    "limits_doubled": "slide_travel", "wrong_kind": "kind",
    "colliders_8mm_out": "collider_shift", "colliders_8mm_up": "handle_shift",
    "no_front_colliders": "cover_part", "no_room_colliders": "cover_room", "no_cabinet_colliders": "cover_cabinet",
    "plate_114mm_off": "collider_excess", "visual_20mm_off": "collider_shift", "base_100m_off": "base_on_floor",
    "base_turned_round": "base_pose", "base_in_furniture": "base_pose", "base_1m_aside": "base_pose",
    "base_not_free": "base_pose", "grasp_rolled_90": "grasp_roll", "grasp_10cm_off": "grasp_on_region",
    "grasp_and_region_10cm_off": "region_on_part",
}  # fmt: skip
"""Defect of a room -> the check that names it."""
READ_BY_OTHERS = {
    "drive_to_0": "passive_joints", "drive_to_0.2": "passive_joints", "break_force": "passive_joints",
    "break_torque": "passive_joints", "joint_friction_500": "passive_joints", "armature_1e3": "passive_joints",
    "excluded": "passive_joints", "collision_group": "collision_filters", "filtered_with_static": "collision_filters",
    "filtered_with_another_body": "collision_filters", "gravity_0": "gravity", "gravity_981": "gravity",
    "friction_0": "contact_material", "friction_10": "contact_material", "restitution_1": "contact_material",
    "no_material": "contact_material", "initial_velocity": "at_rest", "initial_turn": "at_rest",
}  # fmt: skip
"""Defect of a file that s2a's own simulation does not notice -> the check that names it."""


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    wall = box((1.0, 2.0, 1.0), (2.0, 0.02, 1.0))
    return write_cabinet(tmp_path / "sim.usda", beside=[wall], part_of_hull=True)


def failures(path: Path) -> dict[str, str]:
    return {c.name: c.remedy for c in Evidence(path).checks("drawer_2", CONFIG) if c.status == "fail"}


def test_a_room_in_decimetres_is_named(stage: Path) -> None:
    found = Evidence(stage)
    found.surface = ScanSurface(transformed(as_scene(found.room), 10.0 * np.eye(3), labelled=True))
    check = next(check for check in found.checks("drawer_2", CONFIG) if check.name == "scan_units")
    assert check.status == "fail" and check.remedy and check.value == pytest.approx(20.2, abs=0.1)


@pytest.mark.parametrize("defect", few(NAMED, 6))
def test_what_does_not_fit_the_surface_is_named(stage: Path, tmp_path: Path, defect: str) -> None:
    broken = tmp_path / "broken.usda"
    sim_stage.write(CHANGES[defect](sim_stage.read(stage), "drawer_2"), broken)
    found = failures(broken)
    assert NAMED[defect] in found and found[NAMED[defect]], found


@pytest.mark.parametrize("defect", READ_BY_OTHERS)
def test_what_another_simulator_would_read_is_named(stage: Path, defect: str) -> None:
    opened = Usd.Stage.Open(str(stage))
    EDITS[defect](opened, "drawer_2")
    opened.GetRootLayer().Save()
    checks = {check.name: check for check in STRUCTURE.ask(contents.read(stage), SHAPES, "room")}
    failed = {name for name, check in checks.items() if check.status == "fail"}
    assert failed & set(READ_BY_OTHERS.values()) == {READ_BY_OTHERS[defect]}
    assert checks[READ_BY_OTHERS[defect]].prim.startswith("/scene")


@pytest.mark.parametrize(
    ("defect", "said"),
    [
        ("mass_1e4", "kg/m^3"),
        ("mass_1g", "kg/m^3"),
        ("inertia_1e4", "radius of gyration"),
        ("center_5m_off", "outside"),
    ],
)
def test_a_mass_that_no_body_of_this_size_has_is_named(stage: Path, tmp_path: Path, defect: str, said: str) -> None:
    sim_stage.write(CHANGES[defect](sim_stage.read(stage), "drawer_2"), tmp_path / "heavy.usda")
    check = portability.mass_distribution(contents.read(tmp_path / "heavy.usda"), SHAPES)
    assert check.status == "fail" and said in check.message
