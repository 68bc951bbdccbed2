"""The YAML tree and its strict loader."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass, make_dataclass
from pathlib import Path
from typing import Any, Literal, get_args, get_type_hints

import pytest
import satellites

from s2a import tasks
from s2a.commands import cli, train, usage
from s2a.commands.cli import commands
from s2a.core import config
from s2a.core.errors import InputError


def files(group: str) -> set[str]:
    """Return the names of a group's files."""
    return {path.stem for path in (config.folder() / group).glob("*.yaml")}


@dataclass(frozen=True)
class Lamp:
    """A lamp.

    Attributes:
        power: of the bulb [W],
            when it is on.
        place: where it hangs [m].
        color: of its light [K].
    """

    power: float
    place: tuple[float, float, float]
    color: float = 2700.0


@dataclass(frozen=True)
class Room:
    """A room.

    Attributes:
        kind: what it is for.
        seed: of its dice.
        out: where to write it.
        plan: its drawing, or null.
        lamp: the one in it.
        weights: of the walls.
        doors: their ids.
    """

    kind: Literal["office", "kitchen"]
    seed: int
    out: Path
    plan: Path | None
    lamp: Lamp
    weights: dict[str, float]
    doors: tuple[str, ...]


def room(**changes: Any) -> dict[str, Any]:
    """Return the values of a room as YAML gives them; `lamp__power=1` changes a nested one."""
    values = dict(kind="office", seed=3, out="a/b", plan=None, weights={"left": 1}, doors=[])
    values |= {"lamp": {"power": 60, "place": [1, 2.5, 3]}}
    for key, value in changes.items():
        outer, _, inner = key.rpartition("__")
        (values[outer] if outer else values)[inner] = value
    return values


def test_values_take_the_types_that_the_dataclass_says():
    loaded = config.load(Room, room(seed=4, out="~/x"))
    assert loaded == Room("office", 4, Path.home() / "x", None, Lamp(60.0, (1.0, 2.5, 3.0)), {"left": 1.0}, ())
    assert isinstance(loaded.lamp.power, float) and isinstance(loaded.lamp.place[0], float)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"kind": "ofice"}, ["'kind'", "'ofice'", "one of: office, kitchen"]),
        ({"seed": 1.5}, ["'seed'", "1.5", "whole number"]),
        ({"seed": True}, ["'seed'", "True", "whole number"]),
        ({"out": 1.5}, ["'out'", "1.5", "path"]),
        ({"plan": [1]}, ["'plan'", "[1]", "a path, or null"]),
        ({"lamp__power": "bright"}, ["'lamp.power'", "'bright'", "number"]),
        ({"lamp__power": False}, ["'lamp.power'", "False", "number"]),
        ({"lamp__place": [1, 2]}, ["'lamp.place'", "[1, 2]; ", "a list of 3 numbers"]),
        ({"lamp__place": [1, 2, 3, 4]}, ["'lamp.place'", "a list of 3 numbers"]),
        ({"lamp__place": [1, 2, "x"]}, ["'lamp.place'", "'x'"]),
        ({"doors": "door_2"}, ["'doors'", "'door_2'", "a list [a text, ...]"]),
        ({"weights": {"left": "heavy"}}, ["'weights'", "'heavy'"]),
        ({"lamp": 7}, ["'lamp'", "7"]),
        ({"sede": 1}, ["'sede'", "unknown", "seed"]),
        ({"lamp__powr": 1}, ["'powr'", "unknown", "lamp.power"]),
        ({"out": "???"}, ["'out'", "no value", "out=..."]),
        ({"lamp__power": "???"}, ["'lamp.power'", "no value", "lamp.power=..."]),
    ],
)
def test_a_wrong_value_is_named_with_its_key_and_what_is_possible(changes: dict[str, Any], words: list[str]):
    with pytest.raises(InputError) as error:
        config.load(Room, room(**changes))
    assert "\n" not in str(error.value)
    assert [word for word in words if word not in str(error.value)] == []


def test_a_missing_key_is_named():
    values = room()
    del values["lamp"]["place"]
    with pytest.raises(InputError, match="'lamp.place' is missing"):
        config.load(Room, values)


def test_the_meaning_of_every_key_comes_from_the_docstrings_nested_ones_too():
    meanings = usage.attributes(Room)
    assert meanings["seed"] == "of its dice."
    assert meanings["lamp.power"] == "of the bulb [W], when it is on."
    assert usage.attributes(make_dataclass("Cellar", [("lamp", Lamp | None)]))["lamp.power"] == meanings["lamp.power"]


@pytest.mark.parametrize("command", commands())
def test_every_command_composes_loads_and_documents_each_of_its_keys(command: str):
    cls = cli._module(command).Config
    values = config.compose(command)
    required = [f"{key}=given" for key, value in config.leaves(values) if value == config.REQUIRED]
    config.load(cls, config.compose(command, required))
    meanings = usage.meanings(cls, values)
    assert [key for key in config.keys(values) if not usage.meaning_of(key, meanings)] == []


def doubled(cls: type, values: Mapping[str, Any], prefix: str = "") -> list[str]:
    """Return the keys whose fields have a default too; those of entries of a dictionary may."""
    found = []
    hints = get_type_hints(cls)
    for field in fields(cls):
        value, key = values.get(field.name), f"{prefix}{field.name}"
        if is_dataclass(hints[field.name]) and isinstance(value, Mapping):
            found += doubled(hints[field.name], value, f"{key}.")
        elif field.name in values and not (field.default is field.default_factory is MISSING):
            found.append(key)
    return found


@pytest.mark.parametrize("command", commands())
def test_a_value_is_a_key_or_a_default_never_both(command: str):
    assert doubled(cli.settings_of(command), config.compose(command)) == []


@pytest.mark.parametrize("name", sorted(files("task")))
def test_a_value_of_a_task_is_a_key_or_a_default_never_both(name: str):
    kind = tasks.task(name)
    assert doubled(kind.Config, config.compose(f"task/{name}")["task"]) == []
    assert doubled(kind.Metrics, config.compose(f"metrics/{name}")["metrics"]) == []


def test_a_field_without_a_default_needs_a_key_and_one_with_a_default_may_be_given_by_python_alone(tmp_path: Path):
    assert config.load(Lamp, {"power": 60, "place": [0, 0, 2]}).color == 2700.0
    assert config.load(Lamp, {"power": 60, "place": [0, 0, 2], "color": 4000}).color == 4000.0
    with pytest.raises(InputError, match="'place' is missing"):
        config.load(Lamp, {"power": 60, "color": 4000})
    with pytest.raises(InputError, match="'certify.grip.force' is unknown"):
        config.compose("certify", ["certify.grip.force=20"])
    assert doubled(Lamp, {"power": 60, "place": [0, 0, 2], "color": 4000}) == ["color"]


def test_keys_are_few_enough_to_have_a_reason_each():
    assert len({key for command in commands() for key in config.keys(config.compose(command))}) <= 450


@pytest.mark.parametrize("command", commands())
def test_the_examples_in_the_help_of_every_command_are_understood(command: str):
    lines = [line.rstrip() + " " for line in usage.examples(command)]
    calls = [shlex.split(line.partition(f"s2a {command} ")[2]) for line in lines if f"s2a {command} " in line]
    cls = cli._module(command).Config
    for call in calls:  # of a sweep, the values apart from Hydra's own
        config.load(cls, cli.compose(command, [each for each in call if each != "-m" and not each.startswith("hydra")]))
    assert calls


def test_the_help_shows_values_as_they_are_typed_and_every_choice():
    assert [usage.typed(value) for value in (None, True, [1, None, "a"], 0.5)] == ["null", "true", "[1,null,a]", "0.5"]
    meanings = usage.attributes(Room)
    assert meanings["kind"] == "what it is for; one of: office, kitchen."
    assert usage.meaning_of("weights.left", meanings) == "of the walls."


def options(command: str) -> dict[str, set[str]]:
    """Return what the help of a command lists by group, which are the files that it can load."""
    lines = usage.options(command, cli._module(command).Config)[1:]
    found = (re.fullmatch(r"  ([\w/]+)=...  one of: (.*)", line).groups() for line in lines)  # type: ignore[union-attr]
    return {group: set(names.split(", ")) for group, names in found}


@pytest.mark.slow
def test_every_file_of_every_group_is_an_option_of_a_command():
    listed: dict[str, set[str]] = {}
    for command in commands():
        for group, names in options(command).items():
            listed[group] = listed.get(group, set()) | names
    for name in files("task"):  # what belongs to another task than a command begins with is loaded with that task alone
        known = [group for group in ("task", "metrics", "reward") if name in files(group)]
        overrides = ["stage=a.usd", "out=b", *(f"{group}={name}" for group in known)]
        config.load(train.Config, config.compose("train", overrides))
        for group in known:
            listed[group].add(name)
    assert {group: files(group) for group in listed} == listed


@pytest.mark.parametrize("path", sorted((config.folder() / "experiment").glob("*.yaml")), ids=lambda path: path.stem)
def test_every_experiment_is_one_that_train_loads(path: Path):
    loaded = config.load(train.Config, config.compose("train", ["stage=a.usd", "out=b", f"+experiment={path.stem}"]))
    assert loaded.reward


@pytest.mark.parametrize("command", commands())
def test_no_key_shares_its_name_with_a_folder_because_hydra_would_look_for_the_value_there(command: str):
    folders = {path.name for path in config.folder().iterdir() if path.is_dir()} - set(usage.groups(command))
    assert folders.isdisjoint(config.compose(command))


def test_overrides_reach_nested_values_and_options_of_groups():
    values = config.compose("train", ["reward=handle", "ppo.iterations=7", "reward.closing=3"])
    assert values["ppo"]["iterations"] == 7
    assert values["reward"]["closing"] == 3, "a term that no file of the group lists"
    assert values["reward"]["distance"] == 50.5


@pytest.mark.slow
def test_the_help_tells_what_each_reward_term_and_each_number_of_the_task_is(capsys: pytest.CaptureFixture[str]):
    assert cli.main(["train", "--help-all"]) == 0
    text = capsys.readouterr().out
    assert (
        "reward=...  one of: close_part, grasped, handle, open_part, paper" in text
        and "sim=...  one of: paper, pick_place, planner" in text
    )
    for key, words in (
        ("reward.distance=1.5", "1 / (1 + d"),
        ("task.termination_opening=0.39", "ends the episode"),
        ("metrics.grasp_fraction=0.8", "a grasp must have held"),
    ):
        assert words in " ".join(text.partition(f"  {key}")[2].split()[:60]), key


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("task.episode_steps=1", "key 'task.episode_steps' is 1; give 2 or more"),
        ("task.close_distance=near", "key 'task.close_distance' is 'near'; expected a number"),
        ("metrics.grasp_fraction=2", "key 'metrics.grasp_fraction' is 2.0; give a number from 0 to 1"),
        ("reward.fingers=1", "key 'reward.fingers' is unknown; did you mean: reward.finger"),
    ],
)
def test_keys_that_depend_on_the_task_are_told_by_their_whole_names(override: str, message: str):
    with pytest.raises(InputError) as error:
        config.load(train.Config, config.compose("train", ["stage=x", "out=y", override]))
    assert str(error.value).startswith(message)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("job=4", "key 'job' is unknown; did you mean: jobs"),
        ("voxel=0.01", "key 'voxel' is unknown; did you mean: detail.fusion.voxel"),
        (
            "prepare.free.mass.qqq=1",
            "key 'prepare.free.mass.qqq' is unknown; possible: prepare.free.mass.families.*, prepare.free.mass.default.*, ",
        ),
        (
            "zzz=1",
            "key 'zzz' is unknown; possible: detail.*, annotator.*, prepare.*, sim.*, task.*, planner.*, rooms, ",
        ),
    ],
)
def test_an_unknown_key_is_answered_by_a_line_that_can_be_read(override: str, message: str) -> None:
    with pytest.raises(InputError) as error:
        config.compose("pool", [override])
    assert str(error.value).startswith(message) and len(str(error.value)) < 250


def test_numbers_that_the_tree_says_twice_are_equal():
    prepare, certify, plan = (config.compose(name) for name in ("prepare", "certify", "planner/default"))
    base, planner = prepare["prepare"]["base"], plan["planner"]
    sims = [config.compose(f"sim/{name}")["sim"] for name in ("paper", "planner")]
    assert [sim["dt"] for sim in sims] == 2 * [certify["certify"]["physics"]["dt"]]
    assert base["opening"] == planner["opening"]


TEXTS = (
    "20241127_120000", "2024_11_27", "1_000", "61e5", "007", "1.50", "nan", "true", "on the desk, left of the keyboard",
    "Anna's desk", 'the 5" screen', '"quoted"', "room (1)", "Café", "Büro/été", "${out}", "???x", "a=b", "{a: 1}", "[x",
    "x]", "[a,b]", " a ", "a\\b", "a\\", "$HOME", "#1", "~~", "@", "*?", "日本", "a:b", "TEXT_0_", "", "%20", "x\ny", "é" * 127,
)  # fmt: skip
"""What people name folders and things, and a grammar reads as something else."""


@pytest.mark.parametrize("command", ["insert", "prepare", "train", "do"])
def test_a_text_and_a_path_arrive_as_they_were_given(command: str):
    satellites.need(command)
    settings = cli.settings_of(command)
    names = [
        name
        for name, kind in get_type_hints(settings).items()
        if {str, Path}.intersection(get_args(kind) or [kind]) and not re.search("tuple|dict", str(kind))
    ]
    assert len(names) > 1
    for first in range(0, len(TEXTS), len(names)):
        given = dict(zip(names, TEXTS[first:], strict=False))
        values = cli.compose(command, [f"{name}={text}" for name, text in given.items()])
        assert {name: values[name] for name in given} == given


def test_none_lists_and_other_keys_keep_their_grammar():
    values = cli.compose("view", ["part=null", "image='null'", "max_faces=1_000"])
    assert values["part"] is None and values["image"] == "'null'" and values["max_faces"] == 1000
    for given, texts in {
        "[1_000,Café (2)]": ["1_000", "Café (2)"],
        """["a,b", 'c"d' ,e's]""": ["a,b", 'c"d', "e's"],
        r'["a\"b"]': ['a"b'],
        "[]": [],
        "drawer_7": "drawer_7",
        "1,2": "1,2",
    }.items():
        assert cli.compose("prepare", [f"targets={given}"])["targets"] == texts
    assert cli.compose("import", ["up=[0,0,1]"])["up"] == [0, 0, 1]
    assert cli.compose("import", ["up=-y"])["up"] == "-y"


def test_an_error_names_the_text_that_was_given():
    with pytest.raises(InputError, match=r"'free' is '1,2'; expected a list \[a text, ...\]"):
        cli.run("prepare", cli.compose("prepare", ["stage=x", "out=y", "targets=all", "free=1,2"]))


def test_a_sweep_does_not_rewrite_numbers_that_are_texts():
    given = ["out=20241127_120000,61e5,b", "seed=1_000,2", "policy=true"]
    assert config.quoted(given, cli.settings_of("bench")) == [
        'out="20241127_120000","61e5",b', "seed=1_000,2", 'policy="true"',
    ]  # fmt: skip


def test_a_home_that_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch):
    with pytest.raises(InputError, match="'~nobody-here/x': no such home directory"):
        config.load(Room, room(out="~nobody-here/x"))
