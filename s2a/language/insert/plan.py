"""The plan of an insertion: the model's choice of places, validated against the room."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

from s2a.core.config import nearest
from s2a.language.insert import prompts
from s2a.language.insert.place.stable_pose import AXES, sideways
from s2a.language.llm.ask import Model, Request, UsageLog, ValidationFeedback, ask, parse
from s2a.scene.scene import Scene

CHOICES = 3
HIGHEST = 1000.0
"""Of the supports of a room [m]."""
LISTED = 200
"""Number of ids listed for a model that named an unknown one."""


@dataclass(frozen=True)
class Choice:
    """A place for an object.

    Attributes:
        target: id of the carrying part.
        surface: "horizontal", "vertical", or "inside": below another surface of the target, such as a shelf's compartment.
        relation: "on" it; "in" a basin, a box or a compartment; "against" a wall behind it; "hanging" on a vertical surface.
        height: of the support above the floor [m]; None for any.
        reason: in a few words.
    """

    target: str
    surface: Literal["horizontal", "vertical", "inside"]
    relation: Literal["on", "in", "against", "hanging"]
    height: float | None
    reason: str


@dataclass(frozen=True)
class Place:
    """Where on its support an object goes.

    Attributes:
        relation: of `prompts.PLACES`.
        of: ids of the parts that it refers to: two for "between", else one.
    """

    relation: str
    of: tuple[str, ...]


@dataclass(frozen=True)
class Plan:
    """Places and orientation of an object.

    Attributes:
        up: axis of the file that points up, "+x" to "-z".
        front: axis of the file that its front faces along.
        near: id of the neighbour, or None.
        choices: the best place first, three at most; none in a plan that declines.
        place: where on these, held to where there is room.
        declined: why there is no place for it in this room; empty in a plan that names places.
    """

    up: str
    front: str
    near: str | None
    choices: tuple[Choice, ...]
    place: tuple[Place, ...] = ()
    declined: str = ""

    @property
    def hangs(self) -> bool:
        """True if the first choice hangs: the orientation need not be stable."""
        return bool(self.choices) and self.choices[0].relation == "hanging"

    def said(self) -> dict[str, Any]:
        """Return the plan as a model answers it, without what it left empty."""
        return {name: value for name, value in asdict(self).items() if name not in ("place", "declined") or value}


@dataclass(frozen=True)
class FailedPlan:
    """A plan without room.

    Attributes:
        plan: the plan.
        reason: the collisions; goes back to the model.
        unstable: Set where the object tilted, drifted or fell at a free candidate pose.
    """

    plan: Plan
    reason: str
    unstable: bool


def plan(
    model: Model,
    scene: Scene,
    facts: dict[str, Any],
    room: str,
    retries: int,
    usage: UsageLog,
    failed: FailedPlan | None = None,
) -> Plan:
    """Ask a model for a plan.

    Args:
        model: the language model.
        scene: the room.
        facts: label, sides, tilt margins and placement hint of the object, and the room's lines.
        room: the room's description.
        retries: answers that may be rejected: unknown ids go back with the list of known ones.
        usage: log of the answers, appended to.
        failed: an earlier plan without room.

    Raises:
        InputError: no answer could be used.
    """
    request = Request("plan", prompts.PLAN, (("user", prompts.plan_question(facts, room)),), prompts.PLAN_SCHEMA, facts)
    if failed:
        tried = [(choice.target, choice.height) for choice in failed.plan.choices]
        known = {**facts, "tried": tried, "tried_up": failed.plan.up, "unstable": failed.unstable}
        request = replace(request, facts=known).with_feedback(
            json.dumps(failed.plan.said()), f"{failed.reason}. Think of other places, or of another up axis."
        )
    return ask(model, request, lambda text: checked(parse(text, Plan), scene), retries, usage)


def checked(answer: Plan, scene: Scene) -> Plan:
    """Return a plan if it fits the room.

    Raises:
        ValidationFeedback: what is wrong with it, for the model.
    """
    _check_axes(answer)
    if answer.declined.strip() and not answer.choices:
        return answer
    if not 1 <= len(answer.choices) <= CHOICES:
        raise ValidationFeedback(f"{len(answer.choices)} choices were given; give one to {CHOICES}, the best first.")
    for place in answer.place:
        if place.relation not in prompts.PLACES or len(place.of) != (2 if place.relation == "between" else 1):
            raise ValidationFeedback(
                f"place {place.relation!r} of {len(place.of)} things; possible: {', '.join(prompts.PLACES)}, each of one "
                "thing, and 'between' of two."
            )
    named = (part_id for place in answer.place for part_id in place.of)
    for part_id in (*(choice.target for choice in answer.choices), answer.near, *named):
        if part_id is not None and part_id not in scene.parts:
            raise ValidationFeedback(_unknown(part_id, scene))
    for choice in answer.choices:
        if choice.height is not None and not abs(choice.height) <= HIGHEST:
            raise ValidationFeedback(f"height is {choice.height:g}; give the support's height in metres, or null.")
        if (choice.relation == "hanging") != (choice.surface == "vertical"):
            raise ValidationFeedback(
                f"relation {choice.relation!r} does not go with surface {choice.surface!r}: what hangs, hangs on a vertical "
                f"surface; what is on, in or against something needs a horizontal or an inside one."
            )
    return answer


def _check_axes(answer: Plan) -> None:
    for name, axis in (("up", answer.up), ("front", answer.front)):
        if axis not in AXES:
            raise ValidationFeedback(f"{name} is {axis!r}; possible: {', '.join(AXES)}.")
    if answer.front not in sideways(answer.up):
        raise ValidationFeedback(
            f"front {answer.front!r} lies along up {answer.up!r}; possible: {', '.join(sideways(answer.up))}."
        )


def _unknown(part_id: str, scene: Scene) -> str:
    """Return the feedback on an unknown part."""
    known = list(scene.parts)[:LISTED]
    return f"There is no {part_id[:60]!r} in the room{nearest(part_id[:60], known)}. All ids: {', '.join(known)}."
