"""Tasks are found by their names."""

from __future__ import annotations

import ast
from dataclasses import is_dataclass
from pathlib import Path
from types import SimpleNamespace

import pytest

from s2a import tasks
from s2a.commands import train
from s2a.core import config
from s2a.core.errors import InputError
from s2a.tasks.base import MdpConfig, Task, meanings, weights_of
from s2a.tasks.state import ERRORS


@pytest.mark.parametrize("name", tasks.names())
def test_every_task_says_all_that_the_environment_asks_and_has_its_values(name: str) -> None:
    task = tasks.task(name)
    assert issubclass(task, Task) and issubclass(task.Config, MdpConfig) and is_dataclass(task.Metrics)
    results = task.RESULTS
    assert {*results.logged, results.success} <= set(results.rates)
    assert len(set(results.names)) == len(results.names) and not set(results.names) & set(ERRORS)
    assert results.version >= 1
    assert all(text.startswith("Weight of ") for text in meanings(task.REWARDS).values())
    assert config.load(task.Config, config.compose(f"task/{name}")["task"]).name == name
    config.load(task.Metrics, config.compose(f"metrics/{name}")["metrics"])


PACKAGE = Path(tasks.__file__).parents[1]


def test_nothing_else_in_the_package_knows_a_tasks_name() -> None:
    names, modules = set(tasks.names()), {f"s2a.tasks.{name}" for name in tasks.names()}
    for path in PACKAGE.rglob("*.py"):
        if PACKAGE / "tasks" in path.parents:
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            assert not (isinstance(node, ast.Constant) and node.value in names), f"{path}:{node.lineno} {node.value}"
            assert not (isinstance(node, ast.ImportFrom) and node.module in modules), f"{path}:{node.lineno}"


def test_one_predicate_says_what_a_grasp_is() -> None:
    """The directions of the fingers' forces are read in one module alone."""
    readers = [path for path in (PACKAGE / "tasks").rglob("*.py") if ".normal[" in path.read_text()]
    assert [path.name for path in readers] == ["grasp.py"]


def test_opening_is_a_task() -> None:
    assert "open_part" in tasks.names()


def test_an_unknown_task_is_one_line_with_the_known_ones() -> None:
    with pytest.raises(
        InputError,
        match="^task 'open_parts' is unknown; did you mean: open_part, close_part; or give a file, task=FILE.py$",
    ):
        tasks.task("open_parts")
    values = config.compose("train", ["stage=x", "out=y", "task.name=open_parts"])
    with pytest.raises(InputError, match="task 'open_parts' is unknown"):
        config.load(train.Config, values)


def test_a_term_that_is_not_listed_weighs_nothing_and_an_unknown_one_is_refused() -> None:
    terms = tasks.task("open_part").REWARDS
    weights = dict(zip(terms, weights_of(terms, {"bonus": 2, "action": -1.0}), strict=True))
    assert {name: weight for name, weight in weights.items() if weight} == {"bonus": 2.0, "action": -1.0}
    with pytest.raises(InputError, match="reward term 'fingers' does not exist; possible: distance, rotation, opening"):
        weights_of(terms, {"fingers": 1.0})


def test_metrics_of_another_task_are_refused() -> None:
    with pytest.raises(InputError, match="give task=open_part"):
        tasks.make_env(None, SimpleNamespace(name="open_part"), SimpleNamespace(), {}, 0)
