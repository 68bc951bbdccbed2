"""Write the tables of observations and actions in docs/own_network.md from the tasks: `python tools/observation_tables.py`."""

from __future__ import annotations

import inspect
import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import warp as wp

from s2a import robot, tasks
from s2a.core import config as settings
from s2a.robot.spec import RobotSpec
from s2a.sim.simulation import SimConfig
from s2a.tasks.base import MdpConfig, Task, active, columns_of

ROOT = Path(__file__).parents[1]
BEGIN, END = "<!-- observations: begin -->\n", "<!-- observations: end -->\n"
UNIT, FRAME = re.compile(r"\[([^\]]+)\]\.$"), re.compile(r"in the ([\w' ]+) frame")
RANGE = re.compile(r"-?[\d.]+ to [\d.]+|0 or 1|unit vector")


@dataclass(frozen=True)
class TermColumns:
    """Neighbouring columns with one meaning."""

    name: str  # of the term, or of the joint
    columns: range  # where it is in an observation or action
    meaning: str  # in words
    unit: str  # "1" for none
    frame: str  # of coordinates; empty for what has none
    range: str  # of the values; empty: unbounded
    setting: str = ""  # key of the task that turns it on; empty: it is always there


def observations(kind: type[Task], config: Any, joints: int, critic: bool = False) -> list[TermColumns]:
    """Return what a policy observes, in the order of its columns.

    `kind`: the task; `critic`: return what only a critic observes instead.
    """
    groups = kind.CRITIC if critic else kind.OBSERVATIONS
    terms = active(groups, config)
    setting = {term.key: key for key, group in groups.items() for term in group}
    limit = getattr(config, "observation_limit", 0.0)
    bound = f"-{limit:g} to {limit:g}" if limit and not critic else ""
    places = columns_of(terms, joints)
    return [
        _field(term, range(places[term.key].start, places[term.key].stop), bound, setting[term.key]) for term in terms
    ]


def _field(term: wp.Function, columns: range, bound: str, setting: str) -> TermColumns:
    first = inspect.cleandoc(term.func.__doc__ or "").split("\n\n")[0]
    text = " ".join(first.split())
    unit, frame, own = UNIT.search(text), FRAME.search(text), RANGE.search(text)
    meaning = re.sub(rf",? {FRAME.pattern}|: a unit vector|, {RANGE.pattern}", "", UNIT.sub("", text)).strip(" .:")
    meaning = meaning[:1].upper() + meaning[1:]
    within = (unit[1] if unit else "", frame[1] if frame else "", own[0] if own else bound)
    return TermColumns(term.key, columns, meaning, *within, setting)


def actions(robot: RobotSpec, config: MdpConfig, sim: SimConfig) -> list[TermColumns]:
    """Return what an action of a robot moves, in the order of its columns; all are clamped to -1 to 1."""
    arm, fingers = "velocity of the joint's target", "velocity of the finger joint's target; -1 grips"
    limits, gripper = sim.limits and sim.limits.of(robot.limits), robot.gripper
    speeds = limits.velocity if limits else [config.action_scale] * len(robot.arm_joints)
    finger = gripper.finger_speed if limits else config.finger_speed * config.action_scale
    names = [(name, arm, f"{speed:.4g} rad/s") for name, speed in zip(robot.arm_joints, speeds, strict=True)]
    unit = "m/s" if abs(gripper.ratio - 1.0) < 1e-6 else "rad/s"
    names += [(name, fingers, f"{finger:.4g} {unit}") for name in gripper.joints]
    return [
        TermColumns(name, range(i, i + 1), meaning, scale, "", "-1 to 1")
        for i, (name, meaning, scale) in enumerate(names)
    ]


def markdown(kinds: Mapping[str, tuple[type[Task], Any]], robot: RobotSpec, sim: SimConfig) -> Iterator[str]:
    """Yield the lines of the tables of some tasks, with their settings, by name; `sim` is that of the actions' speeds.

    Columns that an earlier task has in the same place are named, not listed again.
    """
    earlier: dict[bool, dict[TermColumns, str]] = {False: {}, True: {}}
    for name, (kind, config) in kinds.items():
        yield f"### {name}\n"
        for critic, listed in earlier.items():
            fields = observations(kind, config, len(robot.joints), critic)
            new = [field for field in fields if field not in listed]
            again = {other: [f for f in fields if listed.get(f) == other] for other in dict.fromkeys(listed.values())}
            notes = [f"{_columns(some)} as in {other}" for other, some in again.items() if some]
            known = ", ".join(notes) + (" and" if notes and new else "")
            words = [*(["Only the critic observes"] if critic and fields else []), *([known] if known else [])]
            if words:
                yield f"{' '.join(words)}{':' if new else '.'}\n"
            yield from table(new) if new else ()
            listed |= dict.fromkeys(new, name)
    yield f"### Actions of {robot.name}\n"
    yield from table(list(_joined(actions(robot, next(iter(kinds.values()))[1], sim))))


def _columns(fields: Sequence[TermColumns]) -> str:
    first, last = fields[0].columns.start, fields[-1].columns.stop - 1
    return str(first) if first == last else f"{first}-{last}"


def _joined(fields: Sequence[TermColumns]) -> Iterator[TermColumns]:
    """Yield fields, neighbours of the same meaning as one."""
    for _, group in itertools.groupby(fields, key=lambda field: (field.meaning, field.unit)):
        same = list(group)
        names = f"{same[0].name}` to `{same[-1].name}" if len(same) > 1 else same[0].name
        yield replace(same[0], name=names, columns=range(same[0].columns.start, same[-1].columns.stop))


def table(fields: Sequence[TermColumns]) -> Iterator[str]:
    """Yield the lines of a Markdown table of fields."""
    names = ["columns", "name", "meaning", "unit", "frame", "range", "with"]
    rows = [
        [_columns([f]), f"`{f.name}`", f.meaning, f.unit, f.frame, f.range, f.setting and f"`{f.setting}`"]
        for f in fields
    ]
    kept = [i for i, name in enumerate(names) if name == "unit" or any(row[i] for row in rows)]
    yield f"| {' | '.join(names[i] for i in kept)} |"
    yield "|---" * len(kept) + "|"
    for row in rows:
        yield f"| {' | '.join(row[i] for i in kept)} |"
    yield ""


def main() -> None:
    """Replace the text between the marks."""
    page = ROOT / "docs" / "own_network.md"
    before, _, rest = page.read_text().partition(BEGIN)
    page.write_text(before + BEGIN + tables() + END + rest.partition(END)[2])


def kinds() -> dict[str, tuple[type[Task], Any]]:
    """Return the tasks with their settings, all of their observations turned on, by name."""
    every = {}
    for name in ("open_part", *(each for each in tasks.names() if each != "open_part")):
        kind = tasks.task(name)
        values = settings.compose("train", [f"task={name}", "stage=-", "out=-"])["task"]
        values |= {group: True for group in {**kind.OBSERVATIONS, **kind.CRITIC} if group}
        every[name] = kind, settings.load(kind.Config, values)
    return every


def tables() -> str:
    """Return the tables in Markdown, for the Panda as `s2a train` moves it."""
    sim = settings.load(SimConfig, settings.compose("train", ["stage=-", "out=-"])["sim"])
    return "\n".join(markdown(kinds(), robot.load("panda"), sim)).rstrip() + "\n"


if __name__ == "__main__":
    main()
