"""A joint's dynamics from recordings: found, written over the stage, simulated; bad recordings."""

from __future__ import annotations

import json
from dataclasses import astuple
from pathlib import Path

import numpy as np
import pytest
from cabinet import HANDLE, write_cabinet
from pulled_bodies import DOOR, DRAWER, LID
from recorded_pulls import Truth, record
from settings import load

from s2a.commands import cli
from s2a.core.errors import InputError
from s2a.joints.commands.identify import write_layer
from s2a.joints.dynamics import PARAMETERS, Dynamics
from s2a.joints.identify import identify, minimize_together
from s2a.joints.pull import Noise, Pull, read
from s2a.joints.pulled import moving
from s2a.scene.scene import Joint
from s2a.scene.usd import sim_stage
from s2a.scene.usd.joints import Resistance, SoftClose
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import read_stage

NOISE = Noise(0.001, 0.5)
TRUTH = Truth(mass=0.7, damping=8.0, friction=3.0, spring=5.0)


def exact(mass: float = 1.0, **values: float) -> Dynamics:
    """Return dynamics that are known, 0 where none are given."""
    return Dynamics(
        np.array([mass, *(values.get(name, 0.0) for name in PARAMETERS[1:])]), np.zeros(len(PARAMETERS)), 1.0
    )


def write_csv(pull: Pull, path: Path) -> Path:
    """Write a recording as a user has it."""
    rows = np.column_stack([np.arange(len(pull.opening)) * pull.step, pull.opening, pull.force])
    np.savetxt(path, rows, delimiter=",", header="time,opening,force", comments="")
    return path


def test_minima_are_found_together_and_those_left_out_stay() -> None:
    centers = np.array([[1.0, -2.0], [0.5, 3.0], [9.0, 9.0]])

    def evaluate(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        away = (x - centers) * [1.0, 10.0]
        return (away**2).sum(axis=1) / 2, away * [1.0, 10.0]

    low, high = np.array([-5.0, -1.0]), np.array([5.0, 5.0])
    found = minimize_together(evaluate, np.zeros((3, 2)), low, high, 50, np.array([True, True, False]))
    assert found.points == pytest.approx(np.array([[1.0, -1.0], [0.5, 3.0], [0.0, 0.0]]), abs=1e-4)
    assert np.isinf(found.values[2]) and found.rounds < 20


def test_what_was_found_is_a_layer_that_the_simulation_uses(tmp_path: Path) -> None:
    stage, layer = write_cabinet(tmp_path / "room.usda"), tmp_path / "identified.usda"
    found = exact(mass=0.7, damping=8.0, friction=3.0, breakaway=1.0, spring=5.0, pull_in=4.0, closing=30.0)
    before = sim_stage.read(stage)
    write_layer(stage, layer, layer, "drawer_2", found, moving(before, "drawer_2"))
    after = sim_stage.read(layer)
    assert after.bodies["drawer_2"].mass.mass == pytest.approx(0.7 * 5.32)
    inertia = np.array(before.bodies["drawer_2"].mass.inertia)
    assert np.array(after.bodies["drawer_2"].mass.inertia) == pytest.approx(0.7 * inertia)
    part = after.articulations["drawer_2"]
    assert part.friction == pytest.approx(3.0)
    assert part.resistance == Resistance(8.0, 5.0, 1.0, SoftClose(4.0, 30.0, 0.04))
    assert before.articulations["drawer_2"].resistance is None
    sim = Simulation(read_stage(layer), load(SimConfig, "sim/planner"), 1)
    dof = sim.layout.part_dof
    assert float(sim.model.joint_target_kd.numpy()[dof]) == pytest.approx(8.0)
    assert float(sim.model.joint_target_ke.numpy()[dof]) == pytest.approx(5.0)
    again = tmp_path / "again.usda"
    sim_stage.write(after, again)
    assert sim_stage.read(again).articulations["drawer_2"] == part


def test_at_the_grasp_point_of_a_door_the_lever_arm_counts(tmp_path: Path) -> None:
    door = Joint("revolute", (0.0, 0.0, 1.0), (HANDLE[0], HANDLE[1] + 0.4, 0.0), (-1.5, 0.0))
    stage, layer = write_cabinet(tmp_path / "room.usda", joint=door), tmp_path / "identified.usda"
    found = exact(damping=8.0, friction=3.0, breakaway=1.0, spring=5.0, pull_in=4.0, closing=30.0)
    write_layer(stage, layer, layer, "drawer_2", found, moving(sim_stage.read(stage), "drawer_2"))
    part = sim_stage.read(layer).articulations["drawer_2"]
    assert part.friction == pytest.approx(3.0 * 0.4)
    assert part.resistance is not None
    assert (part.resistance.damping, part.resistance.stiffness) == pytest.approx((8.0 * 0.16, 5.0 * 0.16))
    assert part.resistance.breakaway == pytest.approx(0.4) and part.resistance.soft_close is not None
    # 4 N at 0.4 m, 30 N s/m at 0.4 m, 0.04 m of the way on a radius of 0.4 m.
    assert astuple(part.resistance.soft_close) == pytest.approx((1.6, 4.8, 0.1))


@pytest.mark.slow
def test_a_drawer_is_identified(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stage, layer, found = (
        write_cabinet(tmp_path / "room.usda"),
        tmp_path / "out/identified.usda",
        tmp_path / "found.json",
    )
    body = moving(sim_stage.read(stage), "drawer_2")
    file = write_csv(record(body, TRUTH, NOISE, 0, 1.5), tmp_path / "pull.csv")
    assert (
        cli.main(["identify", f"stage={stage}", f"pulls=[{file}]", f"out={layer}", f"record={found}", "device=cpu"])
        == 0
    )
    assert "joint of drawer_2" in capsys.readouterr().out
    rows = json.loads(found.read_text())["dynamics"]
    for name in ("mass", "damping", "friction", "spring"):
        value, truth = rows[name]["value"], getattr(TRUTH, name)
        assert abs(value - truth) < max(4.0 * rows[name]["deviation"], 0.05 * truth), name
    mass = sim_stage.read(layer).bodies["drawer_2"].mass
    assert mass.mass == pytest.approx(rows["mass"]["value"] * 5.32) and mass.source == "identified"


@pytest.mark.slow
def test_intervals_hold_the_truth_of_drawers_doors_and_lids() -> None:
    rng = np.random.default_rng(5)
    bodies = [DRAWER, DOOR, LID] * 4
    values = [np.exp(rng.uniform(np.log([0.5, 1, 0.5, 1]), np.log([2, 15, 5, 20]))) for _ in bodies]
    truths = [Truth(*each[:3], spring=each[3]) for each in values]
    pulls = [
        [record(b, t, NOISE, 10 * i + k) for k in range(4)] for i, (b, t) in enumerate(zip(bodies, truths, strict=True))
    ]
    found = identify(bodies, pulls, NOISE)
    for name in ("mass", "damping", "friction", "spring"):
        i = PARAMETERS.index(name)
        truth = np.array([getattr(t, name) for t in truths])
        value, deviation = (np.array([getattr(each, key)[i] for each in found]) for key in ("values", "deviations"))
        assert np.median(np.abs(value / truth - 1.0)) < 0.06, name
        assert (np.abs(value - truth) < 4.0 * deviation).all(), name


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("time,opening\n" + "0,0\n" * 20, "no column 'force' among time, opening"),
        ("time,opening,force\n" + "0,0,1\n" * 20, "samples 0 to 0 s apart"),
        ("time,opening,force\n" + "\n".join(f"{i},0,x" for i in range(20)), "one that is not a number"),
        ("time,opening,force\n0,0,0\n1,0,0\n", "2 samples"),
        ("", "empty; give the columns time, opening, force"),
        ("\n\n", "empty; give the columns time, opening, force"),
        ("\x00\xff", "time, opening, force"),
    ],
)
def test_a_recording_that_is_none_is_refused(tmp_path: Path, text: str, told: str) -> None:
    path = tmp_path / "pull.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=told.replace("(", r"\(")):
        read(path)


def test_bad_keys_are_one_line_and_leave_the_output(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stage, out = write_cabinet(tmp_path / "room.usda"), tmp_path / "identified.usda"
    out.write_text("earlier")
    pull = write_csv(Pull(np.linspace(0, 0.1, 20), np.ones(20), 0.01), tmp_path / "pull.csv")
    slower = write_csv(Pull(np.linspace(0, 0.1, 20), np.ones(20), 0.05), tmp_path / "slower.csv")
    for pulls, told in (
        ("[]", "'pulls' is empty"),
        (f"[{tmp_path / 'none.csv'}]", "no recording"),
        (f"[{pull},{slower}]", "resample them at one rate"),
    ):
        assert cli.main(["identify", f"stage={stage}", f"pulls={pulls}", f"out={out}", "device=cpu"]) == 2
        error = capsys.readouterr().err
        assert told in error and error.count("\n") == 1
    assert out.read_text() == "earlier"
