"""What the network of the proposals is trained on: its truth is what the proposals make of it, and mirrors agree."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import plain_room
import proposal_images
import proposal_network
import pytest
import torch

from s2a.annotate.propose import fronts
from s2a.annotate.propose.fronts import CellBox
from s2a.annotate.propose.layers import ProposeConfig, layers, spread
from s2a.annotate.propose.network import MOTIONS, image
from s2a.annotate.surface import SplitSurface
from s2a.core import config

PROPOSE = config.load(ProposeConfig, config.file("annotate")["propose"])


@pytest.mark.parametrize("motion", MOTIONS)
def test_the_truth_of_a_motion_is_that_motion(motion) -> None:
    mesh = plain_room.room()
    (layer, *_) = layers(spread(SplitSurface.of(mesh.vertices, mesh.faces, mesh.colors), PROPOSE.density), PROPOSE)
    box = CellBox(10, 10, 70, 50)
    joint = fronts._joint(fronts._rectangle(layer, box), motion)
    found = proposal_images._motion(layer, joint, np.array([10, 10]), np.array([70, 50]))
    assert MOTIONS[found] == motion


def test_a_mirror_swaps_sides_and_motions_and_two_of_them_nothing() -> None:
    seen, handle = np.random.default_rng(0).random((9, 256, 256), np.float32), np.zeros((256, 256), np.float32)
    boxes = np.array([[20.0, 30, 100, 90, MOTIONS.index(("hinge", "left")), 1]])
    crop = (seen, *proposal_network._truth(boxes, 0.01), handle)
    mirrored = proposal_network._mirrored(Always(), *crop)
    boxes[:, [0, 2]], boxes[:, 4] = 256 - boxes[:, [2, 0]], MOTIONS.index(("hinge", "right"))
    expected = [torch.from_numpy(x) for x in (seen[..., ::-1].copy(), *proposal_network._truth(boxes, 0.01), handle)]
    for one, other in zip(mirrored, expected, strict=True):
        torch.testing.assert_close(one, other, atol=1e-5, rtol=0.0)


class Always:
    """A generator that always mirrors."""

    def random(self) -> float:
        return 0.0


def test_the_truth_says_where_the_sides_are() -> None:
    boxes = np.array([[20.0, 30, 100, 90, 0, 1], [150, 150, 200, 200, 0, 0]])
    front, weight, sides, motion = proposal_network._truth(boxes, 0.01)
    row, column = 30, 25  # of the network: 61 and 51 of the image
    np.testing.assert_allclose(sides[:, row, column], [0.31, 0.31, 0.49, 0.29], atol=1e-6)
    assert front[row, column] == 1 and motion[row, column] == 0 and front.sum() == pytest.approx(80 * 60 / 4, rel=0.1)
    assert weight[87, 87] == 0 and front[87, 87] == 0  # not asked for
    assert weight[5, 5] == 1 and front[5, 5] == 0


def test_a_harder_crop_shows_less_and_asks_for_less_where_it_does() -> None:
    torch.manual_seed(0)
    seen = torch.zeros(12, 1, 64, 64)
    seen[..., :48] = 1.0
    crops = torch.cat([seen, 0.3 * torch.rand(12, 8, 64, 64) * seen], dim=1)
    weight = torch.ones(12, 32, 32)
    changed, asked = proposal_network.harder(crops, weight)
    untouched = (changed == crops).flatten(1).all(dim=1)
    assert 0 < untouched.sum() < 12 and torch.isfinite(changed).all()
    assert (changed[:, 0] <= crops[:, 0]).all() and (changed[:, 1:5] * (changed[:, :1] == 0) == 0).all()
    torch.testing.assert_close(changed[:, 7:], crops[:, 7:])  # walls and the height over the floor
    lost = torch.nn.functional.avg_pool2d(crops[:, 0] - changed[:, 0], 2) > 0.5
    torch.testing.assert_close(asked, torch.where(lost, proposal_network.LOST, weight))


def test_a_planes_layer_gives_its_image_again() -> None:
    mesh = plain_room.room()
    for layer in layers(spread(SplitSurface.of(mesh.vertices, mesh.faces, mesh.colors), PROPOSE.density), PROPOSE):
        shown = image(layer, 0.0)
        np.testing.assert_allclose(image(proposal_network._layer(shown, layer.cell), 0.0), shown, atol=1e-4)


def test_a_coarse_copy_has_larger_triangles_near_to_those_of_the_scan() -> None:
    mesh = plain_room.room()
    surface = SplitSurface.of(mesh.vertices, mesh.faces, mesh.colors)
    random = np.random.default_rng(0)
    moved = proposal_images.bent(surface, random)
    left = proposal_images.intact(moved, random)
    rest = replace(moved, faces=moved.faces[left], source=moved.source[left])
    coarse = proposal_images.lit(proposal_images.merged(rest, random), random)
    # Three standard deviations of leaning over the room's half, and of bending along each axis.
    farthest = 3 * (proposal_images.LEAN * np.ptp(surface.vertices, axis=0).max() + 2 * proposal_images.BEND)
    assert np.linalg.norm(moved.vertices - surface.vertices, axis=1).max() < farthest
    assert coarse.areas.sum() == pytest.approx(rest.areas.sum(), rel=0.1)
    assert len(coarse.faces) <= len(rest.faces) and 0 <= coarse.colors.min() and coarse.colors.max() <= 255
    flat = np.abs(coarse.normals @ moved.normals[left][0]) > 0.99
    assert flat.any()
