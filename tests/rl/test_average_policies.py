"""The mean of policies' weights, as tools/average_policies.py writes it."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest
import torch

from s2a.errors import InputError

FILE = Path(__file__).parents[2] / "tools/average_policies.py"
SPEC = importlib.util.spec_from_file_location("average_policies", FILE)
assert SPEC and SPEC.loader
tool = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(tool)


def checkpoint(folder: Path, name: str, weight: torch.Tensor, mean: float = 0.5) -> Path:
    """Write an actor with one layer."""
    actor = {"obs_normalizer._mean": torch.tensor([mean]), "mlp.0.weight": weight}
    torch.save({tool.ACTOR: actor}, folder / name)
    return folder / name


def test_weights_are_averaged_and_the_normaliser_stays(tmp_path: Path) -> None:
    files = [checkpoint(tmp_path, "a.pt", torch.zeros(2, 2)), checkpoint(tmp_path, "b.pt", torch.ones(2, 2))]
    mean = tool.average(files, [1.0, 3.0])
    assert torch.equal(mean["mlp.0.weight"], torch.full((2, 2), 0.75))
    assert torch.equal(mean["obs_normalizer._mean"], torch.tensor([0.5]))


@pytest.mark.parametrize(
    ("other", "mean", "weights", "says"),
    [
        (torch.ones(2, 2), 0.6, [1.0, 1.0], "another normaliser"),
        (torch.ones(3, 2), 0.5, [1.0, 1.0], "another network"),
        (torch.ones(2, 2), 0.5, [1.0], "give a weight to each"),
        (torch.ones(2, 2), 0.5, [0.0, 0.0], "sum positive"),
    ],
)
def test_policies_that_do_not_fit_are_refused(
    tmp_path: Path, other: torch.Tensor, mean: float, weights: list[float], says: str
) -> None:
    files = [checkpoint(tmp_path, "a.pt", torch.zeros(2, 2)), checkpoint(tmp_path, "b.pt", other, mean)]
    with pytest.raises(InputError, match=says):
        tool.average(files, weights)
