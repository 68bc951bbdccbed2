"""A goal: relations that a room is to satisfy, judged on its state, and the skills that lead there."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from s2a.core.errors import InputError
from s2a.language.ask import ValidationFeedback
from s2a.language.do import episode
from s2a.language.do import facts as fact
from s2a.language.do.episode import RoomChange
from s2a.language.do.facts import Facts, RoomPart
from s2a.language.do.plan import Skill, SkillPlan
from s2a.language.do.run import SHUT, Checker, Execute, Result, RoomContext
from s2a.robot.tool_path import matrix, opening_coordinate
from s2a.scene.articulation import transform
from s2a.scene.usd.sim_scene import ALL, SimRoom
from s2a.tasks.base import Task

ATTEMPTS = 2  # Skills for one relation
TAKES = {"shut": ("part",), "on": ("object", "support"), "in": ("object", "part")}  # By a skill of each relation


@dataclass(frozen=True)
class Condition:
    """What is to hold of a part or an object."""

    name: str  # "shut", "on" or "in"
    subject: str  # id of the part to be shut, or of the free object
    target: str = ""  # id of what the object is to be on or in

    @property
    def words(self) -> str:
        """The relation in a few words, such as "cup_3 on shelf_7"."""
        return " ".join(filter(None, (self.subject, self.name, self.target)))


def read(file: Path, facts: Facts) -> tuple[Condition, ...]:
    """Return the relations of a YAML file with the keys `shut` (a list of ids, or all), `on` and `in` (object: id).

    Raises:
        InputError: no such file; other keys; an id that the room lacks, or that cannot be what the relation says.
    """
    try:
        values = yaml.load(file.read_text(), yaml.BaseLoader)  # texts alone: to others `on` is True
    except (OSError, UnicodeError, yaml.YAMLError) as error:
        raise InputError(f"goal {file}: cannot be read as YAML ({' '.join(str(error).split())})") from error
    if not isinstance(values, dict) or not values or set(values) - set(TAKES):
        raise InputError(f"goal {file}: expected the keys shut, on and in; shut: all, or 'on: {{cup_3: shelf_7}}'")
    shut = listed(values.get("shut", []), facts, f"goal {file}, key 'shut'")
    relations = [Condition("shut", i) for i in shut]
    for name in ("on", "in"):
        pairs = values.get(name, {})
        if not isinstance(pairs, dict):
            raise InputError(f"goal {file}, key {name!r}: is {pairs!r}; give object: id")
        relations += [Condition(name, str(one), str(other)) for one, other in pairs.items()]
    if not relations:
        raise InputError(f"goal {file}: has no relation; give shut: all, or 'on: {{cup_3: shelf_7}}'")
    placed = [each.subject for each in relations if each.name != "shut"]
    for each in relations:
        _check(each, facts, f"goal {file}")
        if each.name != "shut" and placed.count(each.subject) > 1:
            raise InputError(f"goal {file}: {each.subject!r} has two places; leave one out")
    return tuple(relations)


def listed(given: Any, facts: Facts, where: str) -> list[str]:
    """Return ids of parts that move, from a list of them, one of them, or `all`.

    Raises:
        InputError: it is neither; names `where` it stands.
    """
    moving = [i for i, thing in facts.items() if thing.moves]
    chosen = moving if given == ALL else [given] if isinstance(given, str) else given
    if not isinstance(chosen, Sequence):
        raise InputError(f"{where}: is {given!r}; give a list of ids, or all")
    unknown = [i for i in map(str, chosen) if i not in moving]
    if unknown:
        raise InputError(f"{where}: {unknown[0]!r} does not open here; what opens: {', '.join(moving) or 'nothing'}")
    return list(dict.fromkeys(map(str, chosen)))


def _check(relation: Condition, facts: Facts, where: str) -> None:
    if relation.name == "shut":
        return
    free = [i for i, thing in facts.items() if thing.kind == "free"]
    if relation.subject not in free:
        raise InputError(f"{where}: {relation.subject!r} is not free; free are: {', '.join(free) or 'none'}")
    other = facts.get(relation.target)
    if other is None or (not other.moves if relation.name == "in" else other.kind != "fixed"):
        expected = "a part that opens" if relation.name == "in" else "a fixed part"
        raise InputError(f"{where}: {relation.words!r} needs {expected} of the room, not {relation.target!r}")


def holds(relation: Condition, facts: Facts) -> bool:
    """Return True for a relation that a room satisfies as it stands.

    A part is shut up to 2 cm; an object is on, or in, what has the highest surface below its middle, and in a part with its
    middle no higher than that: not on the edge of a drawer's front.
    """
    thing = facts[relation.subject]
    if relation.name == "shut":
        return abs(thing.open) <= SHUT
    return thing.on == relation.target and (relation.name == "on" or _within(thing, facts[relation.target]))


def _within(thing: RoomPart, part: RoomPart) -> bool:
    """Return True if the middle of an object is no higher than a part."""
    return bool(thing.center and part.center and part.size and thing.center[2] <= part.center[2] + part.size[2] / 2)


def opened(room: SimRoom, parts: Sequence[str], opening: float) -> RoomChange:
    """Return the state in which parts stand open by a path of their grasp points [m], or 95 % of their travel.

    What lies in or on them has moved with them.
    """
    joints = {}
    for i in parts:
        part = room.articulations[i]
        joints[i] = opening_coordinate(part.joint, np.array(part.grasp.point), opening)
    moved = {i: matrix(np.array([*body.position, *body.orientation])) for i, body in room.free.items()}
    still = {i: pose.copy() for i, pose in moved.items()}
    # What hangs on other parts first: the displacement of a carrier is about the axis as it is in the file
    for i in sorted(joints, key=lambda part: -len(room.carriers(part))):
        hanging = [each for each in room.articulations if i in room.carriers(each)]
        for rider in {rider for each in (i, *hanging) for rider in episode.riders(room, each)}:
            moved[rider] = transform(room.articulations[i].joint, joints[i]) @ moved[rider]
    objects = {
        i: tuple(map(float, (*pose[:3, 3], *Rotation.from_matrix(pose[:3, :3]).as_quat())))
        for i, pose in moved.items()
        if not np.array_equal(pose, still[i])
    }
    return RoomChange(joints, objects)


def pursue(context: RoomContext, goal: Sequence[Condition], execute: Execute, state: RoomChange) -> Result:
    """Execute skills until a room satisfies all relations, or no skill for one that is left is possible.

    The next skill is chosen in the room as it stands: first parts are shut, the nearest to the last first, then objects are
    placed. A relation has two attempts, the second after another skill has changed the room.

    Returns:
        Every skill, and as its problem the relations that do not hold in the end, with the last reason of each.
    """
    result, reasons = Result(), dict.fromkeys(goal, "")
    attempts, waits, last = dict.fromkeys(goal, 0), set[Condition](), None
    while True:
        room = episode.at_state(context.room, state)
        facts = fact.gather(room, context.described, episode.opened_by(context.room, state), context.robot)
        left = [each for each in goal if not holds(each, facts)]
        check, chosen = Checker(context, room, facts), None
        for each in sorted(left, key=lambda one: (one.name != "shut", _distance(facts[one.subject], last))):
            if attempts[each] == ATTEMPTS or each in waits:
                continue
            try:
                skill = _skill(each, context.skills)
                check(SkillPlan((skill,), None, "", ()))
            except (ValidationFeedback, InputError) as error:
                reasons[each] = str(error).rstrip(".")
                continue
            chosen = each, skill, check.passed
            break
        if chosen is None:
            break
        relation, skill, passed = chosen
        result.plans.append({"goal": relation.words, "checks": passed})
        outcome = execute(skill, state, len(result.skills) + 1)
        state, last = outcome.state, facts[relation.subject]
        result.skills.append(outcome.record)
        attempts[relation] += 1
        reasons[relation] = outcome.reason.rstrip(".")
        if outcome.success:
            waits.clear()
        else:
            waits.add(relation)
    result.unmet = {each.words: reasons[each] or "it does not hold after its skill" for each in left}
    result.problem = "; ".join(f"{words}: {reason}" for words, reason in result.unmet.items())
    return result


def _skill(relation: Condition, skills: Mapping[str, type[Task]]) -> Skill:
    """Return the skill that makes a relation hold.

    Raises:
        InputError: the command has none.
    """
    for name, kind in skills.items():
        words = kind.INSTRUCTION
        if words.takes == TAKES[relation.name] and (relation.name != "shut" or words.leaves == "shut"):
            if relation.name == "shut":
                return Skill(name, relation.subject, None, None)
            part, support = (relation.target, None) if relation.name == "in" else (None, relation.target)
            return Skill(name, part, relation.subject, support)
    raise InputError(f"no skill makes {relation.words!r} hold; skills: {', '.join(skills)}")


def _distance(thing: RoomPart, last: RoomPart | None) -> float:
    """Return how far a thing is from the last one [m]."""
    if last is None or thing.center is None or last.center is None:
        return 0.0
    return float(np.linalg.norm(np.subtract(thing.center, last.center)))
