"""The plan of an insertion and the size of its object: a model's answers, validated against the room."""

import json
import math
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

from s2a.core.config import nearest
from s2a.language.ask import Model, Request, UsageLog, ValidationFeedback, ask, parse
from s2a.language.grammar import is_kind_of
from s2a.language.insert import prompts
from s2a.language.insert.fit import NoRoom
from s2a.language.insert.stable_pose import AXES, sideways
from s2a.language.sandbox.diff import SCALE
from s2a.scene.scene import Scene

Range = tuple[float, float]
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}  # Metres per unit of mesh files
MIN_SIZE, MAX_SIZE = 0.001, 4.0  # Sizes of objects that fit into a room [m]
# Largest ratio of max to min of an informative range: an envelope lies or is a stack, a battery lies or stands
MAX_RATIO = {"height": 30.0, "longest": 12.0}
FLAT = 1e-3  # Smallest side as a fraction of the longest: a sheet has no thickness
# Factor by which a size may be outside its range for a unit to be accepted: products differ, and so do models
SLACK = 1.15


@dataclass(frozen=True)
class Size:
    """Usual size of a kind of object."""

    noun: str  # plain name of the kind; brands and rare words resolved
    height: Range  # min and max in its orientation [m]
    longest: Range  # min and max of the longest side [m]
    unit: Literal["m", "cm", "mm", "in", "ft", "unknown"]  # unit of the file, the model's guess
    reason: str  # in a few words


@dataclass(frozen=True)
class ScaleFit:
    """Scale of an object file."""

    scale: float  # metres per unit of the file
    method: str  # the file's unit that fits the ranges ("unit cm"), or "range" where none does


def size(model: Model, facts: dict[str, Any], retries: int, usage: UsageLog) -> Size:
    """Ask a model for the size of an object.

    `facts`: label, sides in the file, its height, the stated unit, the support and the neighbours.

    Raises:
        InputError: no answer could be used.
    """
    request = Request("scale", prompts.SCALE, (("user", prompts.scale_question(facts)),), prompts.SCALE_SCHEMA, facts)
    doubted: set[str] = set()

    def accept(text: str) -> Size:
        answer = checked_size(parse(text, Size))
        doubt = doubts(answer, facts)
        if doubt and text not in doubted and not doubted:
            doubted.add(text)  # an answer that is repeated is meant
            raise ValidationFeedback(f"{doubt} Is the size in metres, and right? Answer again; repeat it if it is.")
        return answer

    return ask(model, request, accept, retries, usage)


def checked_size(answer: Size) -> Size:
    """Return a size if it is plausible; ValidationFeedback: what is wrong with it, for the model."""
    for name, (low, high) in (("height", answer.height), ("longest", answer.longest)):
        if not (math.isfinite(low) and math.isfinite(high) and MIN_SIZE <= low <= high <= MAX_SIZE):
            raise ValidationFeedback(
                f"{name} is {low:g} to {high:g}; give least and largest in metres, from {MIN_SIZE:g} to {MAX_SIZE:g}."
            )
        if high > MAX_RATIO[name] * low:
            raise ValidationFeedback(f"{name} {low:g} to {high:g} m says too little; give the usual range.")
    if answer.height[0] > answer.longest[1] * 1.01:
        raise ValidationFeedback("The height is more than the longest side, which cannot be.")
    if not answer.noun.strip() or len(answer.noun) > 60:
        raise ValidationFeedback("noun is empty or too long; give one plain English noun.")
    return answer


def doubts(answer: Size, facts: dict[str, Any]) -> str:
    """Return a contradiction between a size and the support or the neighbours; empty if there is none."""
    support = facts.get("support") or {}
    room, wide = support.get("room", math.inf), support.get("widest", math.inf)
    if answer.height[0] > room:
        return f"The support leaves {room:g} m of height, and the object would be {answer.height[0]:g} m high at least."
    if answer.longest[0] > 1.5 * wide:
        return f"The support is {wide:g} m long, and the object would be {answer.longest[0]:g} m long at least."
    for neighbour in facts.get("neighbours", ()):
        if neighbour["label"].lower() == answer.noun.lower():
            length = max(neighbour["size"])
            if not answer.longest[0] / 3 < length < answer.longest[1] * 3:
                return f"A {neighbour['label']} in this room is {length:g} m long."
    return ""


def fit_scale(answer: Size, height: float, longest: float, stated: float | None) -> ScaleFit:
    """Return the scale that matches an object file to its expected size.

    Meshes come in metres, centimetres, millimetres, inches or feet, or in a unit of their own. A unit that puts height and
    longest side where they are expected is taken for the file's, and the object has exactly its size; failing that, one
    that puts the longest side there, for a model may have another side in mind. Else the middle of the ranges is what there is.

    Args:
        answer: the expected ranges.
        height: of the object in the file's unit, upright.
        longest: its longest side, in the file's unit.
        stated: metres per unit as stated in the file, or None.
    """
    middle = math.sqrt(answer.longest[0] * answer.longest[1])
    units = dict(UNITS) if stated is None or stated in UNITS.values() else {"as stated": stated, **UNITS}
    far = {name: abs(math.log(metres * longest / middle)) for name, metres in units.items()}
    for sides in (((height, answer.height), (longest, answer.longest)), ((longest, answer.longest),)):
        fitting = [name for name, metres in units.items() if all(_within(metres * side, span) for side, span in sides)]
        if fitting:
            own = [name for name in fitting if units[name] == stated]
            name = own[0] if own else min(fitting, key=far.__getitem__)
            return ScaleFit(_short(units[name]), f"unit {name}")
    return ScaleFit(_short(_middle(answer, height, longest)), "range")


def _short(scale: float) -> float:
    return float(f"{scale:.{SCALE}g}")


def _within(value: float, span: Range) -> bool:
    return span[0] / SLACK <= value <= span[1] * SLACK


def _middle(answer: Size, height: float, longest: float) -> float:
    """Return the scale that brings both sides closest to the middle of their ranges, weighted by the ranges' precision."""
    total = weight = 0.0
    for side, (low, high) in ((max(height, FLAT * longest), answer.height), (longest, answer.longest)):
        surety = 1.0 / (math.log(high / low) + 0.1) ** 2
        total += surety * math.log(math.sqrt(low * high) / side)
        weight += surety
    return math.exp(total / weight)


CHOICES = 3
HIGHEST = 1000.0  # Of the supports of a room [m]
LISTED = 200  # Number of ids listed for a model that named an unknown one


@dataclass(frozen=True)
class Choice:
    """A place for an object."""

    target: str  # id of the carrying part
    # "horizontal", "vertical", or "inside": below another surface of the target, such as a shelf's compartment
    surface: Literal["horizontal", "vertical", "inside"]
    # "on" it; "in" a basin, a box or a compartment; "against" a wall behind it; "hanging" on a vertical surface
    relation: Literal["on", "in", "against", "hanging"]
    height: float | None  # of the support above the floor [m]; None for any
    reason: str  # in a few words


@dataclass(frozen=True)
class Place:
    """Where on its support an object goes."""

    relation: str  # of `prompts.PLACES`
    of: tuple[str, ...]  # ids of the parts that it refers to: two for "between", else one


@dataclass(frozen=True)
class Plan:
    """Places and orientation of an object."""

    up: str  # axis of the file that points up, "+x" to "-z"
    front: str  # axis of the file that its front faces along
    near: str | None  # id of the neighbour, or None
    choices: tuple[Choice, ...]  # the best place first, three at most; none in a plan that declines
    place: tuple[Place, ...] = ()  # where on these, held to where there is room
    declined: str = ""  # why there is no place for it in this room; empty in a plan that names places

    @property
    def hangs(self) -> bool:
        """True if the first choice hangs: the orientation need not be stable."""
        return bool(self.choices) and self.choices[0].relation == "hanging"

    def said(self) -> dict[str, Any]:
        """Return the plan as a model answers it, without what it left empty."""
        return {name: value for name, value in asdict(self).items() if name not in ("place", "declined") or value}


@dataclass(frozen=True)
class FailedPlan:
    """A plan without room."""

    plan: Plan  # the plan
    reason: str  # the collisions; goes back to the model
    unstable: bool  # Set where the object tilted, drifted or fell at a free candidate pose


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
        context = {**facts, "tried": tried, "tried_up": failed.plan.up, "unstable": failed.unstable}
        request = replace(request, facts=context).with_feedback(
            json.dumps(failed.plan.said()), f"{failed.reason}. Think of other places, or of another up axis."
        )
    return ask(model, request, lambda text: checked(parse(text, Plan), scene), retries, usage)


def checked(answer: Plan, scene: Scene) -> Plan:
    """Return a plan if it fits the room; ValidationFeedback: what is wrong with it, for the model."""
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
    ids = list(scene.parts)[:LISTED]
    return f"There is no {part_id[:60]!r} in the room{nearest(part_id[:60], ids)}. All ids: {', '.join(ids)}."


# Kinds of which one table or counter has one
SINGLE = (
    "tv", "keyboard", "microwave", "kettle", "toaster", "coffee maker", "coffee machine", "printer", "record player",
    "bread bin", "dish rack", "knife block", "toaster oven",
)  # fmt: skip


def like_on(target: str, label: str, lines: list[dict[str, Any]]) -> str | None:
    """Return the id of a thing on a support that is of the same single kind as a label; None if there is none.

    `lines`: of the room, see `s2a.language.insert.describe.describe`.
    """
    kinds = [kind for kind in SINGLE if is_kind_of(label, kind)]
    standing = (line for line in lines if line.get("on") == target)
    return next((line["id"] for line in standing if any(is_kind_of(line["label"], kind) for kind in kinds)), None)


def apart_from_likes(plan: Plan, label: str, lines: list[dict[str, Any]], last: bool) -> Plan:
    """Return a plan without the supports that carry a like of the object, or with these at the end if it is the last one.

    Raises:
        NoRoom: nothing is left, and it is not the last plan.
    """
    likes = {choice: like_on(choice.target, label, lines) for choice in plan.choices}
    free = tuple(choice for choice in plan.choices if likes[choice] is None)
    if not free and not last:
        raise NoRoom("; ".join(_clause(choice, like) for choice, like in likes.items()))
    return replace(plan, choices=free + tuple(choice for choice in plan.choices if last and choice not in free))


def _clause(choice: Choice, like: str | None) -> str:
    return (
        f"{choice.relation} {choice.target}: {like} is there already, and people keep one such thing at a place; repeat it if "
        "there is no better place for a second one"
    )
