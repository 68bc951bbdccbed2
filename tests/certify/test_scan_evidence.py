"""The scanned surface in a simulation-ready file speaks against what does not fit it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cabinet import HANDLE, box, write_cabinet
from settings import load

from s2a.certify import contents, portability
from s2a.certify.check_suite import CertifyConfig
from s2a.certify.contents import STRUCTURE
from s2a.certify.scan_evidence import Evidence, excess, obstacle, shift, uncovered, without
from s2a.scene.geometry.mesh_ops import keep, merge, normals, sample
from s2a.scene.geometry.mesh_query import ray_mesh
from s2a.scene.scene import Mesh
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import Base, SimRoom

SETTINGS: CertifyConfig = load(CertifyConfig, "certify/default")
CONFIG, SHAPES = SETTINGS.evidence, SETTINGS.shapes
READ_BY_OTHERS = {"at_rest", "collision_filters", "contact_material", "gravity", "passive_joints"}
"""Checks of what s2a's own simulation does not notice."""
AROUND = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]
"""Squares of floor around one that was not scanned."""


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    wall = box((1.0, 2.0, 1.0), (2.0, 0.02, 1.0))
    return write_cabinet(tmp_path / "sim.usda", beside=[wall], part_of_hull=True)


def failures(path: Path) -> dict[str, str]:
    return {c.name: c.remedy for c in Evidence(path).checks("drawer_2", CONFIG) if c.status == "fail"}


def test_a_clean_stage_has_the_surface_on_its_side(stage: Path) -> None:
    assert failures(stage) == {}
    checks = Evidence(stage).checks("drawer_2", CONFIG)
    assert len({check.name for check in checks}) == len(checks) >= 15
    assert {"up_axis", "scan_units"} <= {check.name for check in checks}
    structure = STRUCTURE.ask(contents.read(stage), SHAPES, "room")
    assert READ_BY_OTHERS < {check.name for check in structure if check.status == "pass"}


def test_a_floor_that_is_assumed_is_stored_and_reported(stage: Path, tmp_path: Path) -> None:
    room = sim_stage.read(stage)
    drawer = room.articulations["drawer_2"]
    x = drawer.bases["panda"].position[0]
    wall = box((-0.5, 0.0, 1.0), (0.02, 2.0, 1.0))
    sides = [box((x + 1.3 * i, 1.3 * j, -0.01), (1.0 if i else 0.3, 1.0 if j else 0.3, 0.01)) for i, j in AROUND]
    bases = {"panda": replace(drawer.bases["panda"], assumed_floor=True)}
    hole = replace(
        room,
        static_visual=merge([wall, *sides]),
        articulations={"drawer_2": replace(drawer, bases=bases)},
    )
    sim_stage.write(hole, tmp_path / "hole.usda")
    assert sim_stage.read(tmp_path / "hole.usda").articulations["drawer_2"].bases == bases
    checks = Evidence(tmp_path / "hole.usda").checks("drawer_2", CONFIG)
    (check,) = (check for check in checks if check.name == "base_on_floor")
    assert check.status == "info" and "assumed" in check.message and check.value == 1.0 and "stairs" in check.remedy


def _with_center(room: SimRoom, center: tuple[float, ...]) -> SimRoom:
    """Return a room whose drawer has another centre of mass [m]."""
    body = room.bodies["drawer_2"]
    return replace(room, bodies={**room.bodies, "drawer_2": replace(body, mass=replace(body.mass, center=center))})


@pytest.mark.parametrize(
    ("shift", "status"), [((-0.3, 0.0, 0.0), "pass"), ((0.3, 0.0, 0.0), "fail"), ((-0.3, 0.6, 0.0), "fail")]
)
def test_a_drawers_weight_may_lie_behind_its_front_alone(
    stage: Path, tmp_path: Path, shift: tuple[float, float, float], status: str
) -> None:
    room = sim_stage.read(stage)
    hulls = np.concatenate([hull.mesh.vertices for hull in room.bodies["drawer_2"].colliders])
    center = tuple((hulls.min(axis=0) + hulls.max(axis=0)) / 2 + shift)
    sim_stage.write(_with_center(room, center), tmp_path / "moved.usda")
    assert portability.mass_distribution(contents.read(tmp_path / "moved.usda"), SHAPES).status == status


def test_a_shift_is_measured_along_the_directions_that_the_surface_tells() -> None:
    cube = box((0.0, 0.0, 0.0), (0.1, 0.1, 0.1))
    front = keep(cube, np.flatnonzero(normals(cube)[:, 0] > 0.9))
    for way, seen in (((0.008, 0.0, 0.0), 0.008), ((0.0, 0.008, 0.0), 0.0)):
        moved = Mesh(cube.vertices + np.float32(way), cube.faces)
        assert shift(front, [moved]) == pytest.approx(seen, abs=1e-4)
        assert shift(cube, [moved]) == pytest.approx(0.008, abs=5e-4)
    # A mesh whose faces look inwards is the same surface.
    assert shift(Mesh(front.vertices, front.faces[:, ::-1]), [Mesh(cube.vertices + np.float32(way), cube.faces)]) < 1e-4


def test_cover_and_excess_are_measured_against_hulls() -> None:
    low, high = box((0.0, 0.0, 0.0), (0.1, 0.1, 0.1)), box((0.0, 0.0, 1.0), (0.1, 0.1, 0.1))
    points = sample(low, 1000, seed=0)
    assert uncovered(points, [low], 0.01) == 0.0
    assert uncovered(sample(merge([low, high]), 1000, seed=0), [low], 0.01) == pytest.approx(0.5, abs=0.05)
    assert uncovered(points, [box((0.0, 0.0, 0.0), (0.2, 0.2, 0.2))], 0.01) == 0.0, "inside of a hull is covered"
    assert uncovered(points, [], 0.01) == 1.0
    assert excess(low, [low, high]) == (pytest.approx(1.0, abs=1e-5), 1)


@pytest.mark.parametrize("away", [0.2, 50.0])
def test_what_is_far_from_the_surface_is_named_however_far(stage: Path, tmp_path: Path, away: float) -> None:
    room, broken = sim_stage.read(stage), tmp_path / "far.usda"
    body, found = room.bodies["drawer_2"], room.articulations["drawer_2"]
    extra = replace(
        body.colliders[0],
        mesh=Mesh(body.colliders[0].mesh.vertices + np.float32([0, 0, away]), body.colliders[0].mesh.faces),
    )
    point = (HANDLE[0], HANDLE[1], HANDLE[2] + away)
    room = replace(room, bodies={**room.bodies, "drawer_2": replace(body, colliders=(*body.colliders, extra))})
    moved = replace(found, grasp=replace(found.grasp, point=point))
    sim_stage.write(replace(room, articulations={**room.articulations, "drawer_2": moved}), broken)
    assert {"collider_excess", "grasp_on_region"} <= set(failures(broken))


def test_a_base_does_not_stand_in_furniture() -> None:
    floor, post = box((0.0, 0.0, -0.01), (1.0, 1.0, 0.01)), box((0.5, 0.0, 0.5), (0.05, 0.05, 0.5))
    whole = merge([floor, post])
    surface = ray_mesh(whole.vertices, whole.faces)
    base = Base((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), radius=0.12)
    at = np.array([0.0, 0.0, 0.0])
    assert obstacle(at, base, surface, CONFIG.base) == np.inf
    assert obstacle(at + [0.35, 0.0, 0.0], base, surface, CONFIG.base) == pytest.approx(0.10, abs=0.01)


def test_the_region_is_taken_out_of_its_parts_surface_bit_for_bit() -> None:
    front, bar = box((0.0, 0.0, 0.0), (0.01, 0.3, 0.1)), box(tuple(HANDLE), (0.01, 0.1, 0.01))
    rest = without(merge([front, bar]), bar)
    assert len(rest.faces) == len(front.faces) and np.allclose(rest.bounds, front.bounds)
