"""The network that tells a part from its points: what it returns, how frames are varied for it, and that it learns."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import torch
from settings import load

from s2a.core.errors import InputError
from s2a.learn.perception import network as estimate
from s2a.learn.perception.depth_camera import PartPoints
from s2a.learn.perception.network import NetworkConfig, PartNetwork, augmented, features, loss, train
from s2a.tasks.mdp.seen import NUMBERS, SIDEWAYS

HINGE = torch.tensor(
    [[0.1, 0.2, 0.3, 0, 0, 1, 1, 0, 0, 0, 0, 1, -1, 0, 0, 0.1, 0.02, 0.03, 0.0, 0.4, 0.6]], dtype=torch.float32
)
"""A door whose hinge is vertical: point, across, inwards, axis, along, size, kind, lever arm, travel."""


def config(**changes: object) -> NetworkConfig:
    return load(NetworkConfig, "network/default", **{"points": 64, "batch": 8, "width": 16, **changes})


def test_directions_have_length_one_and_the_gripper_is_never_upside_down() -> None:
    torch.manual_seed(0)
    found, guess = PartNetwork(16)(torch.randn(12, 128, 5) * 0.1)
    assert found.shape == (12, NUMBERS) and guess.shape == (12, 3)
    vectors = found[:, 3:15].reshape(12, 4, 3)
    assert vectors.norm(dim=2).flatten().tolist() == pytest.approx([1.0] * 48, abs=1e-5)
    assert (vectors[:, 0] * vectors[:, 1]).sum(dim=1).abs().max() < 1e-5, (
        "across the handle is at right angles to inwards"
    )
    assert (vectors[:, 0] @ torch.tensor(SIDEWAYS, dtype=torch.float32)).min() >= 0.0
    assert found[:, 15:18].min() >= 0.0 and 0.0 <= found[:, 18].min() and found[:, 18].max() <= 1.0


def test_the_order_of_the_points_does_not_matter() -> None:
    torch.manual_seed(0)
    network, points = PartNetwork(16).eval(), torch.randn(2, 128, 5) * 0.1
    one, other = network(points)[0], network(points[:, torch.randperm(128)])[0]
    assert torch.allclose(one, other, atol=1e-5)


@pytest.mark.parametrize("kind", ["hinge", "slide"])
def test_a_varied_frame_is_one_of_a_part_that_moves_as_its_description_says(kind: str) -> None:
    """Turned, scaled and mirrored, a handle's point moved by the joint is what the moved joint does with the moved point."""
    truth = HINGE.repeat(64, 1)
    if kind == "slide":
        truth[:, 9:12], truth[:, 18], truth[:, 19] = truth[:, 12:15], 1.0, 0.0
    points = torch.zeros(64, 64, 5)
    points[:, :, :3] = truth[:, None, :3]
    moved, wanted = augmented(points, truth, config(), torch.Generator().manual_seed(0))
    assert torch.allclose(moved[:, 0, :3], wanted[:, :3], atol=1e-6), "the point goes with the cloud"
    axis, along, arm = wanted[:, 9:12], wanted[:, 12:15], wanted[:, 19:20]
    if kind == "slide":
        assert torch.allclose(axis, along, atol=1e-6)
        return
    # The hinge of the original stands 0.4 m to the side, where axis x (point - hinge) is along.
    to_hinge = -torch.cross(truth[:, 12:15], truth[:, 9:12], dim=1) * 0.4
    assert to_hinge[0].tolist() == pytest.approx([0.0, -0.4, 0.0], abs=1e-6)
    out = torch.cross(along, axis, dim=1) * arm
    assert torch.allclose(torch.cross(axis, out, dim=1), along * arm, atol=1e-6)
    sides = out[:, 1].sign()
    assert set(sides.tolist()) == {-1.0, 1.0}, "some doors hang on the other side"
    assert axis[:, 2].sign().tolist() == sides.tolist(), "and then turn the other way"


def test_a_gripper_turned_by_half_is_no_error_and_a_centimetre_is() -> None:
    turned, off = HINGE.clone(), HINGE.clone()
    turned[:, 3:6] *= -1.0
    off[:, 0] += 0.01
    exact = loss(HINGE, HINGE[:, :3], HINGE)
    assert loss(turned, turned[:, :3], HINGE) == pytest.approx(float(exact))
    assert loss(off, HINGE[:, :3], HINGE) > exact + 0.4


def clouds(count: int, random: np.random.Generator) -> tuple[list[PartPoints], torch.Tensor]:
    """Return flat fronts with a small handle somewhere on them, and where it is."""
    made, where = [], []
    for _ in range(count):
        handle = np.array([-0.03, *random.uniform(-0.2, 0.2, 2)])
        front = np.column_stack([np.zeros(96), random.uniform(-0.3, 0.3, (96, 2))])
        points = np.concatenate([front, handle + random.normal(0.0, 0.01, (32, 3)) * [0.2, 1.0, 1.0]])
        height = -points[:, 0]
        made.append(
            PartPoints(
                np.zeros(3, np.float32), points.astype(np.float16), np.ones(128, bool), height.astype(np.float16)
            )
        )
        where.append(handle)
    truth = HINGE.repeat(count, 1)
    truth[:, :3] = torch.tensor(np.array(where))
    return made, truth


@pytest.mark.slow
def test_it_learns_where_the_handle_is_on_fronts_that_it_has_not_seen() -> None:
    random = np.random.default_rng(0)
    seen, truth = clouds(128, random)
    settings = config(steps=250, batch=32, learning_rate=3e-3, turn=0.1, scale=1.05, points=128)
    network, curve = train(features(seen), truth, settings, seed=0)
    others, known = clouds(32, random)
    error = (network(features(others))[0][:, :3] - known[:, :3]).norm(dim=1).median()
    assert curve[-1] < 0.3 * curve[0]
    assert error < 0.02, "where handles are spread over 0.4 m"


def test_a_network_is_read_as_it_was_written_and_other_files_are_refused(tmp_path: Path) -> None:
    torch.manual_seed(1)
    some, _ = clouds(3, np.random.default_rng(1))
    network = PartNetwork(16)
    estimate.save(network, tmp_path / "perception.pt")
    before = estimate.Perception(network, "cpu").estimate(some)
    assert (estimate.load(tmp_path / "perception.pt", "cpu").estimate(some) == before).all()
    assert math.isfinite(float(np.abs(before).max()))
    (tmp_path / "other.pt").write_bytes(b"no network")
    with pytest.raises(InputError, match="not a network"):
        estimate.load(tmp_path / "other.pt", "cpu")
    with pytest.raises(InputError, match="no such file"):
        estimate.load(tmp_path / "none.pt", "cpu")


def test_several_frames_make_one_estimate_by_their_median() -> None:
    each = np.tile(HINGE.numpy(), (7, 1))
    each[:, 0] = [0.1, 0.1, 0.9, 0.2, 0.3, 0.2, 5.0]
    each[0, 3:6] = [0.6, 0.0, 0.8]
    found = estimate.fused(each, 3)
    assert found is not None and found.shape == (2, NUMBERS)
    assert found[:, 0].tolist() == pytest.approx([0.1, 0.2])
    assert np.linalg.norm(found[:, 3:15].reshape(2, 4, 3), axis=2) == pytest.approx(1.0)
    assert estimate.fused(each[:2], 3).shape == (1, NUMBERS), "what there is, where there are fewer"
    assert (estimate.fused(each, 1) == each).all()
