"""A policy with depth cameras: what its cameras see, what an estimate replaces, its file, and its export."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch
from cabinet import HANDLE, write_cabinet
from part_worlds import make_env
from scipy.spatial.transform import Rotation
from settings import load

from s2a.commands.perceive import Replay, SightConfig, Trainer
from s2a.core.errors import InputError
from s2a.learn.perception import follow
from s2a.learn.perception.follow import EVERY, PRETRAINED_DEPTH, DepthPolicy, Follower
from s2a.learn.perception.sight import (
    TOOL,
    VECTORS,
    VIEWS,
    WIDTH,
    C,
    SightFrame,
    SightNetwork,
    moved_target,
    observed,
    turned,
    turned_estimate,
)
from s2a.robot.tool_path import matrices, matrix
from s2a.scene.geometry.mesh_query import nearest_faces, ray_mesh
from s2a.scene.scene import Joint
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import in_scene
from s2a.sim.depth_cameras import VIEWS as WINDOWS
from s2a.sim.depth_cameras import DepthCameraConfig, WorldCameras, _matrix, tool_poses
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import read_stage
from s2a.tasks.env import VecEnv

HINGE = Joint("revolute", (0.0, 0.0, 1.0), (HANDLE[0] - 0.02, 0.37, 0.7), (0.0, 1.2))
TINY = SightConfig(capacity=64, batch=16, updates=1, width=16)
EXACT = load(DepthCameraConfig, "depth_camera/default", noise=0.0, calibration_shift=0.0, calibration_turn=0.0)


SIZE = 32


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[VecEnv, WorldCameras]:
    """Return the worlds of a drawer and a door, and cameras that make no errors."""
    folder, joints = tmp_path_factory.mktemp("rooms"), {"slide": None, "hinge": HINGE}
    stages = [read_stage(write_cabinet(folder / f"{name}.usda", joint=joint)) for name, joint in joints.items()]
    sim = Simulation(stages, load(SimConfig, "sim/real"), 2)
    env = make_env(stages, sim=sim, describe_part=True, fine_grasp=True, episode_steps=40)
    return env, WorldCameras(sim, EXACT, 0, SIZE)


@pytest.fixture
def trainer(built: tuple[VecEnv, WorldCameras]) -> Iterator[Trainer]:
    """Yield a training at the start of episodes."""
    env, cameras = built
    env.reset_all(0)
    cameras.refit()
    places = cameras.places
    torch.manual_seed(0)
    yield Trainer(env, cameras, SightNetwork(16), TINY, torch.zeros(2, dtype=torch.bool), 0)
    cameras.config, cameras.places = EXACT, places


def test_told_the_truth_as_an_estimate_the_policy_observes_what_it_does_without(trainer: Trainer) -> None:
    env = trainer.env
    for opening in (0.0, 0.2):
        env.sim.joint_q[torch.arange(2), torch.tensor(env.sim.part_coord)] = opening
        env.step(torch.full((2, env.num_actions), 0.2))
        tool = tool_poses(env.sim, trainer.follower.cameras)
        exact = trainer.exact()
        believed = observed(exact, env.task.columns, tool, trainer.truth(), 0.0)
        hinge_is_still = {"velocity", "coordinate"}  # a door's own sign
        for name, column in env.task.columns.items():
            if name not in hinge_is_still:
                assert torch.allclose(believed[:, column], exact[:, column], atol=1e-4), name


def test_masked_points_lie_on_the_part_and_the_wrist_looks_along_the_fingers(trainer: Trainer) -> None:
    cameras = trainer.follower.cameras
    assert (cameras.visible >= 0.3).all()
    truth = trainer.truth()
    for name in ("wide", "narrow"):
        view = cameras.see(name, truth[:, C["point"]])
        for i, stage in enumerate(trainer.env.sim.stages):
            body = sim_stage.read(stage.path).bodies[stage.target]
            base = matrices(stage.base[None])[0]
            points = view.points[i][view.is_part[i]].numpy() @ base[:3, :3].T + base[:3, 3]
            assert len(points) >= 4
            assert nearest_faces(ray_mesh(in_scene(body, body.visual), body.visual.faces), points)[1].max() < 1e-3
    tool = tool_poses(trainer.env.sim, cameras)
    seen = cameras.see("wrist", truth[:, C["point"]])
    ahead = torch.einsum("nij,nhwj->nhwi", tool[:, :3, :3].transpose(1, 2), seen.points - tool[:, None, None, :3, 3])
    assert (ahead[seen.valid][:, 2] > -0.15).all(), "nothing behind the palm is seen"


def test_a_place_on_a_door_swings_with_it_and_one_on_a_drawer_slides(trainer: Trainer) -> None:
    closed, env = trainer.truth(), trainer.env
    spot = closed[:, C["point"]] + torch.tensor([[0.0, 0.1, 0.05]])
    env.sim.joint_q[torch.arange(2), torch.tensor(env.sim.part_coord)] = 0.3
    env.step(torch.zeros(2, env.num_actions))
    opened = trainer.truth()
    moved = moved_target(closed[:, C["point"]], opened)
    assert torch.allclose(moved, opened[:, C["point"]], atol=2e-3), "the grasp point itself"
    between = (moved_target(spot, opened) - moved).norm(dim=1)
    assert between.tolist() == pytest.approx([math.hypot(0.1, 0.05)] * 2, abs=1e-4), "distances stay"


def test_turned_back_an_estimate_is_what_it_was() -> None:
    torch.manual_seed(0)
    estimate = torch.rand(8, sum(c.stop - c.start for c in C.values()))
    angle, side = torch.rand(8, 1), torch.tensor([[1.0], [-1.0]]).repeat(4, 1)
    zero, one = torch.zeros_like(angle), torch.ones_like(angle)
    rows = [angle.cos(), -angle.sin() * side, zero, angle.sin(), angle.cos() * side, zero, zero, zero, one]
    turn, scale, hinge = torch.cat(rows, dim=1).view(8, 3, 3), 1.0 + 0.1 * torch.rand(8, 1), torch.rand(8, 1) < 0.5
    there = turned_estimate(estimate, turn, scale, side, hinge)
    back = turned_estimate(there, turn.transpose(1, 2), 1.0 / scale, side, hinge)
    assert torch.allclose(back, estimate, atol=1e-5)
    assert not torch.allclose(there, estimate, atol=1e-2)


def test_a_mirrored_door_turns_the_other_way(trainer: Trainer) -> None:
    """The axis times the way from the hinge to the handle is where the handle goes, in a mirror too."""
    truth = trainer.truth()
    mirror, one = -torch.ones(2, 1), torch.ones(2, 1)
    turn = torch.diag(torch.tensor([1.0, -1.0, 1.0])).repeat(2, 1, 1)
    points = torch.zeros(2, VIEWS, 16, 16, 3)
    frame = SightFrame(points, torch.zeros(2, 3), truth, torch.zeros(2, TOOL))
    _, varied = turned(frame, truth, turn, one, mirror)
    door, before = varied[1], truth[1]
    out = torch.linalg.cross(door[C["along"]], door[C["axis"]])
    assert torch.linalg.cross(door[C["axis"]], out).tolist() == pytest.approx(door[C["along"]].tolist(), abs=1e-5)
    assert float(door[C["axis"]][2]) == pytest.approx(-float(before[C["axis"]][2])), "it hangs on the other side"


def test_the_network_has_a_view_for_each_window() -> None:
    assert len(WINDOWS) == VIEWS


def test_directions_have_length_one_and_a_view_without_a_point_is_no_error() -> None:
    torch.manual_seed(0)
    points = 0.3 * torch.randn(2, VIEWS, 16, 16, 3)
    points[1] = torch.nan
    network = SightNetwork(16).eval()
    frame = SightFrame(points, torch.zeros(2, 3), torch.zeros(2, WIDTH), torch.zeros(2, TOOL))
    estimate, guess, mask = network(frame)
    assert estimate.isfinite().all() and guess.isfinite().all() and mask.shape == (2, VIEWS, 4, 4)
    for name in VECTORS:
        assert estimate[:, C[name]].norm(dim=1).tolist() == pytest.approx([1.0, 1.0], abs=1e-5)


def test_a_camera_looks_along_its_pose(trainer: Trainer) -> None:
    """The middle of a window about a point shows what is on the line from the camera to it."""
    cameras, point = trainer.follower.cameras, trainer.truth()[:, C["point"]]
    middle = cameras.see("close", point).points[:, 15:17, 15:17].mean(dim=(1, 2))
    eye = torch.einsum("nji,nj->ni", cameras.base_turn, cameras.places[:, 0, :3, 3] - cameras.base_place)
    toward = torch.nn.functional.normalize(point - eye, dim=1)
    assert torch.linalg.cross(middle - eye, toward).norm(dim=1).max() < 0.01
    pose = torch.tensor([[1.0, 2.0, 3.0, *Rotation.from_rotvec([0.3, -0.2, 0.9]).as_quat()]], dtype=torch.float32)
    assert np.allclose(_matrix(pose)[0], matrix(pose[0].double().numpy()), atol=1e-6)


def test_an_estimate_leaves_nothing_of_the_true_part_in_what_is_observed(trainer: Trainer) -> None:
    """Joints and the last action stay; every other column is the estimate's, so that a wrong pose or axis cannot leak."""
    env, tool = trainer.env, tool_poses(trainer.env.sim, trainer.follower.cameras)
    estimate = trainer.truth()
    garbage = torch.full_like(env.observation, 7.0)
    believed = observed(garbage, env.task.columns, tool, estimate, 0.0)
    kept = {name for name, column in env.task.columns.items() if (believed[:, column] == 7.0).all()}
    assert kept == {*follow.FINGERS, "actions"} & set(env.task.columns)


def test_estimates_are_used_as_late_as_the_camera_is(trainer: Trainer) -> None:
    follower, env = trainer.follower, trainer.env
    follower.cameras.config = replace(EXACT, delay=1)
    late = []
    for _ in range(2 * EVERY + 1):
        action = follower(env.observation.clone())
        late.append(bool(action.any()))
        env.step(action)
    assert late == [False] * EVERY + [True] * (EVERY + 1), "the first estimate is used a frame later"
    follower.forget(torch.tensor([True, False]))
    acts = follower.act(env.observation.clone()).any(dim=1)
    assert acts.tolist() == [False, True], "an episode that begins does not act by the last one's estimate"


def test_the_pixel_selects_the_place_and_one_that_shows_nothing_selects_none(trainer: Trainer) -> None:
    follower, cameras = trainer.follower, trainer.follower.cameras
    about = follower.observe().about
    view = cameras.see("wide", about)
    far = (view.points - about[:, None, None]).norm(dim=-1).flatten(1)
    nearest = far.argmin(dim=1)
    assert far.amin(dim=1).max() < 1e-4 and view.is_part.flatten(1).gather(1, nearest[:, None]).all()
    column, row = SIZE // 2, SIZE // 2 + 3
    cameras.config = replace(EXACT, pixel=(column, row))
    follower.forget(torch.tensor([True, True]))
    about = follower.observe().about
    assert torch.allclose(about, cameras.see("wide", about).points[:, row, column], atol=1e-4)
    cameras.config, cameras.places = EXACT, cameras.places.clone()
    cameras.places[:, :, :3, 3] += 50.0
    blind = Follower(trainer.env, cameras, trainer.acting, trainer.policy, 0)
    assert not blind(trainer.env.observation.clone()).any() and not blind.started.any(), "nothing is in view"
    with pytest.raises(InputError, match="from 0 to 31"):
        WorldCameras(trainer.env.sim, replace(EXACT, pixel=(5, SIZE)), 0, SIZE)
    with pytest.raises(InputError, match="one part, and there are 2"):
        WorldCameras(trainer.env.sim, replace(EXACT, pixel=(5, 5)), 0, SIZE)
    one = Simulation(trainer.env.sim.stages[:1], trainer.env.sim.config, 2)
    places = WorldCameras(one, replace(EXACT, pixel=(5, 5)), 0, SIZE).places
    assert torch.equal(places[0], places[1]), "a pixel is one of the same view in all worlds"


def test_a_file_is_read_as_it_was_written_and_others_are_refused(tmp_path: Path) -> None:
    torch.manual_seed(0)
    network = SightNetwork(16)
    follow.write_network(network, tmp_path / "own.depth")
    again = follow.read_network(tmp_path / "own.depth")
    for mine, other in zip(network.parameters(), again.parameters(), strict=True):
        assert torch.allclose(mine, other, rtol=1e-3, atol=1e-6), "half precision"
    (tmp_path / "other.depth").write_bytes(b"no network")
    saved = torch.load(tmp_path / "own.depth", weights_only=True)
    torch.save({**saved, "state_policy": "0"}, tmp_path / "old.depth")
    for name, why in (("other", "not a policy of s2a perceive"), ("none", "no such file"), ("old", "another bundled")):
        with pytest.raises(InputError, match=why):
            follow.read_network(tmp_path / f"{name}.depth")


def test_an_image_changes_nothing_of_what_is_seen_later(trainer: Trainer) -> None:
    cameras, about = trainer.follower.cameras, trainer.truth()[:, C["point"]]
    cameras.config = replace(EXACT, noise=0.01)
    before = cameras.random.get_state()
    first = cameras.see("wide", about).points
    cameras.random.set_state(before)
    trainer.follower.image(torch.arange(2))
    assert torch.equal(cameras.see("wide", about).points, first)


def test_more_frames_than_there_is_room_for_stay_in_step() -> None:
    replay, rows = Replay(4), torch.arange(10.0)[:, None]
    replay.add({"truth": rows, "tool": rows})
    row = replay.sample(32)
    assert torch.equal(row["truth"], row["tool"]) and set(row["truth"].flatten().tolist()) == {6.0, 7.0, 8.0, 9.0}


def test_the_exported_policy_mirrors_the_fingers_where_it_holds_from_within(trainer: Trainer) -> None:
    tool, estimate = tool_poses(trainer.env.sim, trainer.follower.cameras), trainer.truth()
    estimate[:, C["within"]] = 1.0
    columns, seen = trainer.env.task.columns, trainer.env.observation
    graph = follow._ActGraph(trainer.policy, columns)
    actions = graph(follow.felt(seen, columns, -torch.ones(2, 1)), tool, estimate, torch.zeros(2, 1))
    mirrored = trainer.policy(observed(seen, columns, tool, estimate, 0.0).clamp(-5.0, 5.0)).clamp(-1.0, 1.0)
    assert torch.equal(actions[:, :-2], mirrored[:, :-2]) and torch.equal(actions[:, -2:], -mirrored[:, -2:])


@pytest.mark.slow
def test_exported_the_bundled_policy_is_small_and_acts_as_torch_does_on_recorded_frames(
    trainer: Trainer, tmp_path: Path
) -> None:
    policy = DepthPolicy(Path(PRETRAINED_DEPTH), EXACT)
    look, act = follow.export(policy.network, tmp_path / "open.onnx")
    assert look.stat().st_size + act.stat().st_size < 10e6
    env = trainer.env
    cameras = WorldCameras(env.sim, EXACT, 0)
    follower = Follower(env, cameras, policy.network, trainer.policy, 0)
    eyes, arm = (onnxruntime.InferenceSession(str(file), providers=["CPUExecutionProvider"]) for file in (look, act))
    for _ in range(3):
        seen = follower.observe()
        inputs = {name: getattr(seen.frame, name).numpy() for name in ("points", "target", "before", "tool")}
        estimate = torch.from_numpy(eyes.run(None, inputs)[0])
        estimate[:, C["point"]] += seen.about
        assert torch.allclose(estimate, follower.estimate, atol=1e-4)
        for step in range(EVERY):
            observation = env.observation.clone()
            pose, later = tool_poses(env.sim, follower.cameras), torch.full((2, 1), step * env.sim.config.control_dt)
            given = {"obs": observation, "pose": pose, "estimate": estimate, "later": later}
            actions = arm.run(None, {name: value.numpy() for name, value in given.items()})[0]
            expected = follower.act(observation)
            assert np.allclose(actions, expected.numpy(), atol=2e-3)
            env.step(expected)
