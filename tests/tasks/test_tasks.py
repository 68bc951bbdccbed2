"""Tasks are found by their names."""

from __future__ import annotations

from dataclasses import is_dataclass

import pytest

from s2a import tasks
from s2a.commands import train
from s2a.core import config
from s2a.core.errors import InputError
from s2a.env.kernels import ERRORS
from s2a.env.task import MdpConfig, Task, meanings, weights_of


@pytest.mark.parametrize("name", tasks.names())
def test_every_task_says_all_that_the_environment_asks_and_has_its_values(name: str) -> None:
    task = tasks.task(name)
    assert issubclass(task, Task) and issubclass(task.Config, MdpConfig) and is_dataclass(task.Metrics)
    assert set(task.LOGGED) | set(task.VALUES) <= set(task.METRICS)
    assert len(set(task.METRICS)) == len(task.METRICS) and not set(task.METRICS) & set(ERRORS)
    assert task.METRICS_VERSION >= 1
    assert all(text.startswith("Weight of ") for text in meanings(task.REWARDS).values())
    assert {term.key for term in task.REWARDS} == set(meanings(task.REWARDS))
    assert config.load(task.Config, config.compose(f"task/{name}")["task"]).name == name
    config.load(task.Metrics, config.compose(f"metrics/{name}")["metrics"])


def test_opening_is_a_task() -> None:
    assert "open_part" in tasks.names()


def test_an_unknown_task_is_one_line_with_the_known_ones() -> None:
    with pytest.raises(InputError, match="^task 'open_parts' is unknown; did you mean: open_part, close_part$"):
        tasks.task("open_parts")
    values = config.compose("train", ["stage=x", "out=y", "task.name=open_parts"])
    with pytest.raises(InputError, match="task 'open_parts' is unknown"):
        config.load(train.Config, values)


def test_a_term_that_is_not_listed_weighs_nothing_and_an_unknown_one_is_refused() -> None:
    terms = tasks.task("open_part").REWARDS
    weights = dict(zip([term.key for term in terms], weights_of(terms, {"bonus": 2, "action": -1.0}), strict=True))
    assert {name: weight for name, weight in weights.items() if weight} == {"bonus": 2.0, "action": -1.0}
    with pytest.raises(InputError, match="reward term 'fingers' does not exist; known: distance, rotation, opening"):
        weights_of(terms, {"fingers": 1.0})
