"""What the network of the proposals is trained on: its truth is what the proposals make of it, and mirrors agree."""

from __future__ import annotations

import numpy as np
import plain_room
import proposal_images
import proposal_network
import pytest
import torch

from s2a.annotate.propose import fronts
from s2a.annotate.propose.fronts import CellBox
from s2a.annotate.propose.layers import ProposeConfig, layers, spread
from s2a.annotate.propose.network import MOTIONS
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
    image, handle = np.random.default_rng(0).random((9, 256, 256), np.float32), np.zeros((256, 256), np.float32)
    boxes = np.array([[20.0, 30, 100, 90, MOTIONS.index(("hinge", "left")), 1]])
    crop = (image, *proposal_network._truth(boxes, 0.01), handle)
    mirrored = proposal_network._mirrored(Always(), *crop)
    boxes[:, [0, 2]], boxes[:, 4] = 256 - boxes[:, [2, 0]], MOTIONS.index(("hinge", "right"))
    expected = [torch.from_numpy(x) for x in (image[..., ::-1].copy(), *proposal_network._truth(boxes, 0.01), handle)]
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
