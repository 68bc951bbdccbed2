"""`s2a collect` of every task: what is seen of it, and that demonstrations of it can be played again."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from cabinet import free_cube, write_cabinet
from drawer_room import FLOOR, drawer_room

from s2a.commands import cli
from s2a.learn.collect.episodes import read_stage, write_stage
from s2a.motion.correction import Correction, lead_object
from s2a.motion.policy import Planner
from s2a.motion.put_in import PutStage
from s2a.robot.kinematics import kinematics
from s2a.robot.tool_path import matrix
from s2a.scene.scene import Mesh
from s2a.tasks.pick_place import PickPlaceConfig, PickPlaceMetrics

QUICK = ["device=cpu", "num_envs=2", "every=20", "views.width=32", "views.height=32"]
START, GOAL = "0.2 0.1 0.828", "0.2 -0.2 0.828"
SHIFT, TURN = 0.02, 0.2


def table(out: Path, episode: int) -> dict[str, np.ndarray]:
    values = pq.read_table(out / f"data/chunk-000/file-00{episode}.parquet").to_pydict()
    return {name: np.array(each) for name, each in values.items()}


@pytest.fixture(scope="module")
def picked(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Two demonstrations of a cube that is picked and placed, and the room."""
    folder = tmp_path_factory.mktemp("pick")
    stage = write_cabinet(folder / "sim.usda", free=[free_cube("cube_9", (0.2, 0.1, 0.828), 0.05, 0.2)])
    keys = [f"stage={stage}", "part=cube_9", "task=pick_place", "sim=pick_place", f"out={folder / 'set'}"]
    ends = [f"task.start='{START}'", f"task.place='{GOAL}'", f"task.start_shift={SHIFT}", f"task.start_turn={TURN}"]
    assert cli.main(["collect", *keys, *ends, *QUICK, "episodes=2"]) == 0
    return stage, folder / "set"


@pytest.mark.slow
def test_the_object_stands_elsewhere_in_every_episode_and_ends_at_its_place(picked: tuple[Path, Path]) -> None:
    tables = [table(picked[1], i) for i in range(2)]
    starts = np.array([each["observation.objects"][0] for each in tables])
    assert np.abs(starts[:, :2] - [0.2, 0.1]).max() <= SHIFT + 1e-3
    assert np.abs(starts[0, :2] - starts[1, :2]).max() > 1e-3 and abs(starts[0, 5] - starts[1, 5]) > 1e-3
    assert (np.abs(2 * np.arcsin(starts[:, 5])) <= TURN + 0.01).all()
    for each in tables:
        np.testing.assert_allclose(each["observation.objects"][-1, :2], [0.2, -0.2], atol=0.02)
        assert each["observation.objects"][:, 2].max() > 0.86, "it is lifted"
        assert "observation.part" not in each
    assert len({len(each["timestamp"]) for each in tables}) <= 2, "episodes end when they are done"
    info = json.loads((picked[1] / "meta/s2a.json").read_text())
    assert info["instruction"] == "pick up the cube and put it down at its place"
    assert {"nothing", "panda", "cube_9", "cabinet_1", "drawer_2"} <= set(info["instances"])


@pytest.mark.slow
def test_demonstrations_of_shifted_objects_can_be_played_again(
    picked: tuple[Path, Path], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("s2a.motion.pick.plan_pick", None)  # nothing is planned again
    assert cli.main(["replay", f"stage={picked[0]}", f"dataset={picked[1]}", "device=cpu"]) == 0
    assert "2 of 2 episodes succeed when played again" in capsys.readouterr().out


@pytest.mark.slow
def test_the_grasp_moves_with_the_object(picked: tuple[Path, Path]) -> None:
    """At the steps of the grasp the tool is at S P^-1 T; before the arm sets off and above the place, nothing is added."""
    import torch
    from settings import load

    from s2a import tasks
    from s2a.motion.pick import PickStage
    from s2a.motion.trajectory import PlannerConfig
    from s2a.sim.simulation import SimConfig, Simulation

    stage = read_stage(PickStage, picked[0], picked[1])
    sim = Simulation(stage, load(SimConfig, "sim/pick_place"), 2)
    config = load(PickPlaceConfig, "task/pick_place", start_shift=SHIFT, start_turn=TURN)
    env = tasks.make_env(sim, config, load(PickPlaceMetrics, "metrics/pick_place"), {}, 0, graph=False)
    planner = Planner(env, load(PlannerConfig, "planner/default"))
    trajectory = planner.trajectories[0]
    marks = trajectory.anchor("object")
    shifted = Correction(sim, [trajectory], [marks])
    lead_object(shifted, sim, torch.ones(2, dtype=torch.bool))
    kin, base = kinematics(sim.robot), matrix(stage.base)
    first = sim.layout.part_coord
    pose = matrix(sim.joint_q[1, first : first + 7].numpy().astype(float))
    for step in (marks.first, trajectory.closed, marks.last):
        arm = trajectory.targets[step, :7]
        added = shifted(torch.tensor([step, step]))[1].numpy()
        expected = pose @ np.linalg.inv(matrix(stage.start)) @ base @ kin.tool(arm[None])[0]
        np.testing.assert_allclose(base @ kin.tool((arm + added)[None])[0], expected, atol=5e-4)
    for step in (marks.begin, marks.end, len(trajectory.targets) - 1):
        assert np.abs(shifted(torch.tensor([step, step])).numpy()).max() < 1e-6


def test_a_stage_comes_back_from_its_file(tmp_path: Path) -> None:
    from s2a.motion.pick_plan import PickPlan
    from s2a.motion.places import inside_of
    from s2a.motion.put_in import PutPlan
    from s2a.scene.scene import Joint

    room = drawer_room(tmp_path / "sim.usda")
    random = np.random.default_rng(0)
    pick = PickPlan(random.random(7), 0.2, *random.random((7, 5, 7)), np.eye(4), 0.08)
    inside = inside_of(room, "drawer_2", 0.3, np.array([0.45, 0.0, FLOOR]))
    put = PutPlan(pick, random.random(7), inside, *random.random((2, 4, 7)), (1, 2), *random.random((3, 4, 7)))
    cube = room.free["cube_9"].colliders[0].mesh
    stage = PutStage(
        path=tmp_path / "sim.usda", target="cube_9", joint=Joint("prismatic", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 1.0)),
        base=pick.base, grasp=random.random(7), grasp_size=np.full(3, 0.04), region=cube, also=("drawer_2",), room=room,
        start=random.random(7), goal=put.goal, plan=pick, part="drawer_2", opened=0.3, put=put,
    )  # fmt: skip
    for known in (stage, replace(stage, plan=replace(pick, again=None))):
        write_stage(known, tmp_path / "set")
        assert_alike(known, read_stage(PutStage, tmp_path / "sim.usda", tmp_path / "set"))


def assert_alike(one: object, other: object) -> None:
    """Compare dataclasses of arrays."""
    assert type(one) is type(other)
    for each in fields(one):  # type: ignore[arg-type]
        mine, its = getattr(one, each.name), getattr(other, each.name)
        if each.name == "room":
            continue
        if hasattr(mine, "__dataclass_fields__") and not isinstance(mine, Mesh):
            assert_alike(mine, its)
        elif isinstance(mine, Mesh):
            np.testing.assert_array_equal(mine.vertices, its.vertices)
        elif isinstance(mine, np.ndarray):
            np.testing.assert_array_equal(mine, its)
        else:
            assert mine == its, each.name


@pytest.mark.slow
def test_a_part_that_is_closed_is_seen_closing(tmp_path: Path) -> None:
    stage, out = write_cabinet(tmp_path / "sim.usda"), tmp_path / "set"
    keys = ["task=close_part", "sim=put_in", f"stage={stage}", f"out={out}", "episodes=1", "format=robomimic"]
    assert cli.main(["collect", *keys, *QUICK]) == 0
    h5py = pytest.importorskip("h5py")
    with h5py.File(out / "demos.hdf5") as file:
        demo = file["data/demo_0"]
        assert demo.attrs["instruction"] == "close the drawer"
        part = demo["obs/part"][:, 0]
        assert part[0] > 0.19 and part[-1] < 0.01
        numbers = json.loads((out / "meta/s2a.json").read_text())["instances"]
        seen = demo["obs/scene_segmentation_instance"][:]
        assert (seen == numbers.index("drawer_2")).any() and (seen == numbers.index("panda")).any()


@pytest.mark.slow
def test_an_object_that_is_put_into_a_drawer(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    drawer_room(tmp_path / "sim.usda")
    keys = [f"stage={tmp_path / 'sim.usda'}", f"out={tmp_path / 'set'}", "part=cube_9", "task=put_in", "sim=put_in"]
    assert cli.main(["collect", *keys, "task.place=drawer_2", "episodes=1", *QUICK]) == 0
    found = table(tmp_path / "set", 0)
    assert found["observation.part"].max() > 0.28 and found["observation.part"][-1] < 0.02
    names = json.loads((tmp_path / "set/meta/info.json").read_text())["features"]["observation.objects"]["names"]
    cube = found["observation.objects"][:, [names.index(f"cube_9.{axis}") for axis in "xyz"]]
    assert cube[-1, 2] == pytest.approx(FLOOR + 0.02, abs=0.005)
    assert cli.main(["replay", f"stage={tmp_path / 'sim.usda'}", f"dataset={tmp_path / 'set'}", "device=cpu"]) == 0
    assert "1 of 1 episodes succeed when played again" in capsys.readouterr().out
