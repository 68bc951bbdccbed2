"""A sentence in a room: plan, check, execute skill by skill, and plan once more where one fails."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from s2a.core.errors import InputError
from s2a.language.do import episode
from s2a.language.do import facts as fact
from s2a.language.do.check import Checker
from s2a.language.do.episode import Outcome, RoomChange
from s2a.language.do.plan import Failure, Skill, SkillPlan, plan, refused
from s2a.language.llm.ask import Model, UsageLog
from s2a.scene.usd.descriptive import DescribedPart
from s2a.scene.usd.sim_scene import SimRoom
from s2a.tasks.base import Task

Execute = Callable[[Skill, RoomChange, int], Outcome]
"""Skill, state of the room before it, its number -> how it went."""


@dataclass(frozen=True)
class RoomContext:
    """What a sentence is planned in.

    Attributes:
        room: as in its file.
        described: the descriptive flavour, or None.
        robot: name of the robot.
        opening: to which a part is opened for an object to be put into it [m].
        skills: the tasks that a plan may be made of, by their names in it.
    """

    room: SimRoom
    described: dict[str, DescribedPart] | None
    robot: str
    opening: float
    skills: Mapping[str, type[Task]]


@dataclass
class Result:
    """What came of a sentence.

    Attributes:
        plans: every plan, with what was checked.
        skills: every skill that was executed, in order.
        problem: why the sentence was not done; empty where it was.
    """

    plans: list[dict[str, Any]] = field(default_factory=list)
    skills: list[dict[str, Any]] = field(default_factory=list)
    problem: str = ""


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
    known = fact.gather(room, context.described, episode.opened_by(context.room, state), context.robot)
    check = Checker(room, known, context.robot, context.opening, context.skills)
    found = plan(model, sentence, known, check, retries, usage, context.skills, failed)
    return found, check.passed if found.skills else [], fact.possible(known)


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
    found, passed, possible = make_plan(context, sentence, model, retries, usage)
    if found.refusal:
        raise refused(sentence, found, possible)
    result, state = Result([{**asdict(found), "checks": passed}]), RoomChange()
    for left in range(replans, -1, -1):
        if execute is None:
            return result
        state, failed = _run(found, state, execute, result)
        result.problem = failed.reason if failed else ""
        if failed is None or not left:
            return result
        try:
            found, passed, _ = make_plan(context, sentence, model, retries, usage, state, failed)
        except InputError as error:
            result.problem += f" {error}"
            return result
        result.plans.append({**asdict(found), "checks": passed})
        if found.refusal:
            result.problem += f" No other plan: {found.reason}"
            return result
    return result


def _run(found: SkillPlan, state: RoomChange, execute: Execute, result: Result) -> tuple[RoomChange, Failure | None]:
    """Execute a plan until a skill fails; return the state of the room then, and the failure."""
    for done, skill in enumerate(found.skills):
        outcome = execute(skill, state, len(result.skills) + 1)
        state = outcome.state
        result.skills.append(outcome.record)
        if not outcome.success:
            return state, Failure(found, done, outcome.reason)
    return state, None
