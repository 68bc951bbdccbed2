"""The plan for a sentence: a list of skills, or a refusal; parsed strictly and checked against the room."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, replace
from typing import Any, Literal

from s2a.core.errors import InputError, printable
from s2a.language.do import prompts
from s2a.language.do.facts import Facts, lines, text
from s2a.language.llm.ask import Model, Request, ValidationFeedback, ask, parse
from s2a.language.llm.usage_log import UsageLog

MAX_SENTENCE = 500
"""Characters of a sentence; the longest that we think of is 150 long."""
MAX_SKILLS = 6
"""Skills of a plan."""
REASON, OPTIONS = 300, 12
"""Characters of a refusal's reason, and ids that it lists."""

Name = Literal["open", "close", "pick_place", "put_in"]


@dataclass(frozen=True)
class Skill:
    """One thing that the planner can do; what a skill does not take is None.

    Attributes:
        skill: "open" and "close" take a part; "pick_place" an object and a support; "put_in" an object and a part, which it
            opens and shuts again.
        part: id of what moves on a joint.
        object: id of what lies free.
        support: id of what the object is placed on.
    """

    skill: Name
    part: str | None
    object: str | None
    support: str | None

    @property
    def words(self) -> str:
        """The skill in a few words."""
        return " ".join(filter(None, (self.skill, self.object, "->" if self.object else "", self.part or self.support)))


@dataclass(frozen=True)
class SkillPlan:
    """The answer to a sentence.

    Attributes:
        skills: in order; empty where it is refused.
        refusal: None; "ambiguous": several parts or skills fit; "unknown": no part of the room fits; "impossible": no skill
            does it, or the room does not allow it.
        reason: why it is refused, in a few words; empty otherwise.
        options: ids between which the sentence does not decide.
    """

    skills: tuple[Skill, ...]
    refusal: Literal["ambiguous", "unknown", "impossible"] | None
    reason: str
    options: tuple[str, ...]


@dataclass(frozen=True)
class Failure:
    """A plan that was executed and failed.

    Attributes:
        plan: the plan.
        done: skills of it that succeeded.
        reason: why the next one failed; goes back to the model.
    """

    plan: SkillPlan
    done: int
    reason: str


def check_sentence(sentence: str) -> str:
    """Return a sentence without surrounding blanks.

    Raises:
        InputError: it is empty, too long, or holds what no terminal shows.
    """
    stripped = " ".join(sentence.split())
    if not stripped:
        raise InputError('the sentence is empty; give one, such as s2a do "open the top drawer" stage=room.usd')
    if len(stripped) > MAX_SENTENCE:
        raise InputError(
            f"the sentence has {len(stripped)} characters; expected {MAX_SENTENCE} or fewer: give one task"
        )
    if printable(stripped) != stripped:
        raise InputError("the sentence holds characters that cannot be shown; write it in plain letters")
    return stripped


def plan(
    model: Model,
    sentence: str,
    facts: Facts,
    check: Callable[[SkillPlan], None],
    retries: int,
    usage: UsageLog,
    failed: Failure | None = None,
) -> SkillPlan:
    """Ask a model for a plan.

    Args:
        model: the language model, or the rules.
        sentence: what is to be done, as `check_sentence` returned it.
        facts: the room as it stands now.
        check: raises ValidationFeedback for a plan that does not fit the room.
        retries: answers that may be rejected.
        usage: log of the answers, appended to.
        failed: an earlier plan that was executed and failed.

    Raises:
        InputError: no answer could be used.
    """
    known = {"label": sentence, "sentence": sentence, "room": lines(facts), "things": facts}
    question = prompts.question(sentence, text(facts))
    request = Request("skills", prompts.SKILLS, (("user", question),), prompts.SCHEMA, known)
    if failed:
        request = request.with_feedback(json.dumps(asdict(failed.plan)), prompts.again(failed))
    return ask(model, request, lambda answer: _accepted(answer, facts, check), retries, usage)


def refused(sentence: str, answer: SkillPlan, facts_text: str) -> InputError:
    """Return the error of a refused sentence: what was asked, why not, what is possible."""
    between = f" ({', '.join(answer.options)})" if answer.options else ""
    return InputError(f"{sentence[:120]!r} is {answer.refusal}: {answer.reason}{between}; possible: {facts_text}")


def _accepted(answer: str, facts: Facts, check: Callable[[SkillPlan], None]) -> SkillPlan:
    """Return a plan that fits schema and room; raise ValidationFeedback for any other."""
    found = parse(answer, SkillPlan, strict=True)
    if bool(found.skills) == (found.refusal is not None):
        raise ValidationFeedback("Give skills and a null refusal, or no skills and a refusal.")
    if found.refusal is not None:
        return _tidy(found, facts)
    if len(found.skills) > MAX_SKILLS:
        raise ValidationFeedback(f"{len(found.skills)} skills were given; give {MAX_SKILLS} or fewer.")
    for skill in found.skills:
        _check_arguments(skill, facts)
    check(found)
    return found


def _tidy(found: SkillPlan, facts: Facts) -> SkillPlan:
    """Return a refusal whose words can be shown in a line, and whose options are in the room."""
    reason = " ".join(printable(found.reason).split())[:REASON].rstrip(".; ")
    options = tuple(i for i in dict.fromkeys(found.options) if i in facts)[:OPTIONS]
    return replace(found, reason=reason or "no reason was given", options=options)


TAKES: dict[str, tuple[str, ...]] = {
    "open": ("part",),
    "close": ("part",),
    "pick_place": ("object", "support"),
    "put_in": ("object", "part"),
}


def _check_arguments(skill: Skill, facts: Facts) -> None:
    """Raise ValidationFeedback for arguments that a skill lacks or does not take, and for ids that are not in the room."""
    given: dict[str, Any] = {f.name: getattr(skill, f.name) for f in fields(skill) if f.name != "skill"}
    wrong = [name for name, value in given.items() if (value is not None) != (name in TAKES[skill.skill])]
    if wrong:
        takes = " and ".join(TAKES[skill.skill])
        raise ValidationFeedback(f"Skill {skill.skill!r} takes {takes}, and null for the rest; check {wrong[0]!r}.")
    for name, value in given.items():
        if value is not None and value not in facts:
            raise ValidationFeedback(
                f"There is no {printable(value)[:60]!r} in the room (key {name!r}). Use ids of the room, or refuse."
            )
