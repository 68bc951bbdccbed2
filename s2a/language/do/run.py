"""A sentence in a room: plan, check, execute skill by skill, and plan once more where one fails."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from s2a import robot as robots
from s2a.core.errors import InputError
from s2a.language.ask import Model, UsageLog, ValidationFeedback
from s2a.language.do import episode
from s2a.language.do import facts as fact
from s2a.language.do.episode import Outcome, RoomChange
from s2a.language.do.facts import Facts, RoomPart
from s2a.language.do.plan import Failure, Skill, SkillPlan, plan, refused
from s2a.motion.obstacles import Obstacles
from s2a.motion.places import inside_placements
from s2a.robot.tool_path import opening_coordinate
from s2a.scene.usd.descriptive import DescribedPart
from s2a.scene.usd.sim_scene import SimRoom
from s2a.tasks.base import Task

SHUT = 0.02  # [m] Up to which a part counts as shut


@dataclass(frozen=True)
class RoomContext:
    """What a sentence is planned in."""

    room: SimRoom  # as in its file
    described: dict[str, DescribedPart] | None  # the descriptive flavour, or None
    robot: str  # name of the robot
    opening: float  # to which a part is opened for an object to be put into it [m]
    skills: Mapping[str, type[Task]]  # the tasks that a plan may be made of, by their names in it


class Checker:
    """Checks plans against a room.

    Attributes:
        passed: what holds of the last plan that was checked, a line a skill.
    """

    def __init__(self, context: RoomContext, room: SimRoom, facts: Facts) -> None:
        """Keep the context, the room as it stands now, and its facts."""
        self._room, self._facts, self._opening, self._skills = room, facts, context.opening, context.skills
        robot = robots.load(context.robot)
        self._reach, self._drives = 2.0 * robot.base.reach, robot.drive is not None
        self.passed: list[str] = []

    def __call__(self, plan: SkillPlan) -> None:
        """Check a plan; ValidationFeedback tells what does not hold."""
        self._is_open = {i: thing.open > SHUT for i, thing in self._facts.items() if thing.moves}
        self._on = {i: thing.on for i, thing in self._facts.items() if thing.kind == "free"}
        rules: dict[tuple[str, ...], Callable[[Skill], str]] = {
            ("part",): self._turned,
            ("object", "support"): self._placed,
            ("object", "part"): self._put,
        }
        takes = {name: kind.INSTRUCTION.takes for name, kind in self._skills.items()}
        self.passed = [f"{skill.words}: {rules[takes[skill.skill]](skill)}" for skill in plan.skills]

    def _turned(self, skill: Skill) -> str:
        """Check that a part can be opened or closed."""
        part, words = self._moving(skill.part), self._skills[skill.skill].INSTRUCTION
        if not part.base:
            raise ValidationFeedback(f"{part.id!r} is out of reach: it has no collision-free base pose.")
        was = "open" if self._is_open[part.id] else "shut"
        if words.begins not in (None, was):
            raise ValidationFeedback(f"{part.id!r} is {was} already.")
        self._is_open[part.id] = (words.leaves or was) == "open"
        return f"{part.kind}, was {was}, {'its base is searched' if self._drives else 'has a free base pose'}"

    def _placed(self, skill: Skill) -> str:
        """Check that an object can be picked and placed on a support."""
        object, support = self._free(skill.object), self._facts[skill.support or ""]
        if support.kind != "fixed":
            into = [name for name, kind in self._skills.items() if kind.INSTRUCTION.takes == ("object", "part")]
            remedy = f"{into[0]} puts things into it" if support.moves and into else "it would move"
            raise ValidationFeedback(f"{support.id!r} is no fixed support: {remedy}.")
        near = Obstacles.of_room(self._room, {object.id}, np.array(self._room.free[object.id].position))
        if not self._drives and not near.hulls_of(support.id):
            raise ValidationFeedback(
                f"{object.id!r} cannot be put on {support.id!r} by an arm with a fixed base: it is more than 2 m away."
            )
        if not self._drives:
            self._near(object, support)
        self._on[object.id] = support.id
        return f"free, within reach; {support.id} is fixed, {_gap(object, support):.2f} m away"

    def _put(self, skill: Skill) -> str:
        """Check that an object can be put into a part."""
        object, part = self._free(skill.object), self._moving(skill.part)
        if self._is_open[part.id]:
            raise ValidationFeedback(
                f"{part.id!r} is open; {skill.skill} opens and shuts it by itself, and begins with it shut."
            )
        if self._on[object.id] == part.id:
            raise ValidationFeedback(f"{object.id!r} is in {part.id!r} already.")
        self._near(object, part)
        joint = self._room.articulations[part.id]
        opened = opening_coordinate(joint.joint, np.array(joint.grasp.point), self._opening)
        try:
            places = inside_placements(self._room, object.id, part.id, opened)
        except InputError as error:
            raise ValidationFeedback(f"{error}.") from error
        self._on[object.id] = part.id
        return f"free, within reach; {part.id} {part.kind}, was shut, has {len(places)} places for it"

    def _moving(self, name: str | None) -> RoomPart:
        """Return a part that moves on a joint, and hangs on nothing that is open."""
        part = self._facts[name or ""]
        if not part.moves:
            names = ", ".join(i for i, thing in self._facts.items() if thing.moves)
            raise ValidationFeedback(f"{part.id!r} does not open; what opens: {names or 'nothing'}.")
        for carrier in self._room.carriers(part.id):
            if self._is_open.get(carrier) and not self._drives:
                raise ValidationFeedback(
                    f"{part.id!r} is mounted on {carrier!r}, which is open: base poses are valid while it is shut."
                )
        return part

    def _free(self, name: str | None) -> RoomPart:
        """Return an object that lies free, and not in a shut part."""
        object = self._facts[name or ""]
        if object.kind != "free":
            names = ", ".join(i for i, thing in self._facts.items() if thing.kind == "free")
            raise ValidationFeedback(
                f"{object.id!r} is not free: the room was prepared with it fixed; free are: {names or 'none'}."
            )
        inside = self._on[object.id]
        if inside is not None and self._is_open.get(inside) is False:
            raise ValidationFeedback(f"{object.id!r} is in {inside!r}, which is shut; open that first.")
        return object

    def _near(self, object: RoomPart, other: RoomPart) -> None:
        """Raise where one base cannot reach both."""
        if _gap(object, other) > self._reach:
            raise ValidationFeedback(
                f"{object.id!r} and {other.id!r} are {_gap(object, other):.1f} m apart; from one place the arm reaches "
                f"{self._reach:.1f} m: impossible."
            )


def _gap(object: RoomPart, other: RoomPart) -> float:
    """Return the horizontal distance of an object's middle from another's box, as if that were not turned [m]."""
    if object.center is None or other.center is None or other.size is None:
        return 0.0
    off = np.abs(np.subtract(object.center, other.center))[:2] - 0.5 * np.array(other.size[:2])
    return float(np.linalg.norm(np.maximum(off, 0.0)))


Execute = Callable[[Skill, RoomChange, int], Outcome]  # Skill, state of the room before it, its number -> how it went


@dataclass
class Result:
    """What came of a sentence."""

    plans: list[dict[str, Any]] = field(default_factory=list)  # every plan, with what was checked
    skills: list[dict[str, Any]] = field(default_factory=list)  # every skill that was executed, in order
    problem: str = ""  # why the sentence was not done; empty where it was
    # relations of a goal that do not hold in the end, in words, and why
    unmet: dict[str, str] = field(default_factory=dict)


def make_plan(
    context: RoomContext,
    sentence: str,
    model: Model,
    retries: int,
    usage: UsageLog,
    state: RoomChange | None = None,
    failed: Failure | None = None,
) -> tuple[SkillPlan, list[str], str]:
    """Return the plan for a sentence in a state of the room, what was checked of it, and what is possible there, in words.

    Raises:
        InputError: no answer of the model could be used.
    """
    state = state or RoomChange()
    room = episode.at_state(context.room, state)
    facts = fact.gather(room, context.described, episode.opened_by(context.room, state), context.robot)
    check = Checker(context, room, facts)
    answer = plan(model, sentence, facts, check, retries, usage, context.skills, failed)
    return answer, check.passed if answer.skills else [], fact.possible(facts)


def do(
    context: RoomContext,
    sentence: str,
    model: Model,
    retries: int,
    replans: int,
    usage: UsageLog,
    execute: Execute | None,
) -> Result:
    """Plan and execute a sentence.

    Args:
        context: the room.
        sentence: as `check_sentence` returned it.
        model: the language model, or the rules.
        retries: answers that may be rejected, of each plan.
        replans: plans that are asked for after a skill has failed.
        usage: log of the answers, appended to.
        execute: executes a skill; None: the plan is all.

    Raises:
        InputError: the first plan is a refusal, or no answer could be used; nothing has been executed.
    """
    answer, passed, possible = make_plan(context, sentence, model, retries, usage)
    if answer.refusal:
        raise refused(sentence, answer, possible)
    result, state = Result([{**asdict(answer), "checks": passed}]), RoomChange()
    for left in range(replans, -1, -1):
        if execute is None:
            return result
        state, failed = _run(answer, state, execute, result)
        result.problem = failed.reason if failed else ""
        if failed is None or not left:
            return result
        try:
            answer, passed, _ = make_plan(context, sentence, model, retries, usage, state, failed)
        except InputError as error:
            result.problem += f" {error}"
            return result
        result.plans.append({**asdict(answer), "checks": passed})
        if answer.refusal:
            result.problem += f" No other plan: {answer.reason}"
            return result
    return result


def _run(answer: SkillPlan, state: RoomChange, execute: Execute, result: Result) -> tuple[RoomChange, Failure | None]:
    """Execute a plan until a skill fails; return the state of the room then, and the failure."""
    for done, skill in enumerate(answer.skills):
        outcome = execute(skill, state, len(result.skills) + 1)
        state = outcome.state
        result.skills.append(outcome.record)
        if not outcome.success:
            return state, Failure(answer, done, outcome.reason)
    return state, None
