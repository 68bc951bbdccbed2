"""The rule-based fallback: English sentences of a few verbs, without a model; what it does not read, it refuses."""

import itertools
import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field

import numpy as np

from s2a.language.ask import Answer, Request
from s2a.language.do.facts import COLORS, Facts, RoomPart
from s2a.language.do.plan import Skill, SkillPlan
from s2a.language.grammar import NOUNS, coarse_names, is_named, names_of, relation_at
from s2a.tasks.base import Task

HIGH = frozenset("top upper uppermost topmost highest first".split())
LOW = frozenset("bottom lower lowermost bottommost lowest last".split())
MIDDLE = frozenset("middle center centre central".split())
LEFT, RIGHT = frozenset("left leftmost left-hand".split()), frozenset("right rightmost right-hand".split())
ORDINALS = {"second": 1, "2nd": 1, "third": 2, "3rd": 2, "fourth": 3, "4th": 3}  # From the top; 0 is the first
POSITIONS = HIGH | LOW | MIDDLE | LEFT | RIGHT | set(ORDINALS)
# Words of sentences for colours, and those names of surfaces that fit each: of a scan no colour is sure
COLOR_WORDS = {name: name for name in COLORS} | {
    "gray": "grey",
    "violet": "purple",
    "golden": "yellow",
    "silver": "grey",
}
ALIKE = (
    {"brown", "orange", "beige"}, {"grey", "black"}, {"grey", "white", "beige"}, {"red", "pink"}, {"red", "orange"},
    {"pink", "purple"}, {"orange", "yellow"}, {"yellow", "beige"}, {"blue", "purple"},
)  # fmt: skip
BIG, SMALL = (
    frozenset("big bigger biggest large larger largest".split()),
    frozenset("small smaller smallest little tiny".split()),
)
ADJECTIVES = BIG | SMALL | COLOR_WORDS.keys()
LARGER = 1.3  # Ratio of volumes from which one thing is the larger one
LEVEL = 0.04  # [m] Up to which two fronts are equally high, or equally far left
# [m] Largest gap to what a part is beside, difference up to which two parts are equally near, and depth of furniture
NEAR, SAME, WIDE = 0.5, 0.1, 1.0
# [m] By which furniture that stands under other furniture may rise above its top, or stick out of its outline
BELOW = 0.05


class Unresolved(Exception):
    """Words that mean no part, or several.

    Attributes:
        kind: "ambiguous", "unknown" or "impossible".
        reason: in a few words.
        options: ids that fit.
    """

    def __init__(self, kind: str, reason: str, options: Sequence[str] = ()) -> None:
        super().__init__(reason)
        self.kind, self.reason, self.options = kind, reason, tuple(options)


def belonging(parts: Sequence[str], around: Sequence[str], facts: Facts) -> list[str]:
    """Return those of some parts that belong to some furniture: its own, else those of furniture that stands below it."""
    fitting = [i for i in parts if belongs(i, around, facts)]
    return [i for i in fitting if {*_line(i, facts)[1:]} & {*around}] or fitting


def belongs(part: str, around: Sequence[str], facts: Facts) -> bool:
    """Return True for what is a part of some furniture, stands on it, or belongs to furniture that stands below it."""
    above = _line(part, facts)
    if {*above[1:], *facts[part].touches} & {*around} or any(facts[i].on in around for i in above):
        return True
    return any(facts[part].moves and _under(facts[above[-1]], facts[other]) for other in around if other in facts)


def _under(low: RoomPart, high: RoomPart) -> bool:
    """Return True for furniture that stands below other furniture, such as a cabinet below a desk."""
    if low.id == high.id or not (low.center and low.size and high.center and high.size):
        return False
    beside = np.abs(np.subtract(low.center, high.center))[:2] - 0.5 * np.array(high.size)[:2]
    tops = low.center[2] + low.size[2] / 2, high.center[2] + high.size[2] / 2
    return bool((beside <= BELOW).all() and tops[0] <= tops[1] + BELOW and high.size[2] > low.size[2] / 2)


def positioned(parts: list[str], position: str, facts: Facts) -> list[str]:
    """Return those of some parts that stand in a position; all where it does not tell them apart."""
    if len(parts) < 2:
        return parts
    if position in LEFT | RIGHT:
        if not _alike(parts, facts):
            raise Unresolved("ambiguous", f"{position!r} needs fronts that face alike", parts)
        x, y = facts[parts[0]].facing or (1.0, 0.0)
        along = {i: float(np.dot(facts[i].center or (0, 0, 0), (-y, x, 0.0))) for i in parts}
        return _extreme(parts, along, largest=position in RIGHT)
    if len({_line(i, facts)[-1] for i in parts}) > 1 and not set.intersection(*({*facts[i].touches} for i in parts)):
        raise Unresolved("ambiguous", f"several pieces of furniture have such a part; which one's {position!r}?", parts)
    height = {i: (facts[i].center or (0, 0, 0))[2] for i in parts}
    if position in HIGH | LOW:
        return _extreme(parts, height, largest=position in HIGH)
    ranks = sorted(parts, key=lambda i: -height[i])
    levels: list[list[str]] = []
    for i in ranks:
        if levels and abs(height[levels[-1][0]] - height[i]) <= LEVEL:
            levels[-1].append(i)
        else:
            levels.append([i])
    rank = (len(levels) - 1) / 2 if position in MIDDLE else ORDINALS[position]
    if rank != int(rank) or rank >= len(levels):
        raise Unresolved("unknown", f"of {len(levels)} levels none is {position!r}", parts)
    return levels[int(rank)]


def _extreme(parts: list[str], values: dict[str, float], *, largest: bool) -> list[str]:
    """Return the parts with the largest or smallest value, and those within LEVEL of it."""
    best = (max if largest else min)(values[i] for i in parts)
    return [i for i in parts if abs(values[i] - best) <= LEVEL]


def _alike(parts: list[str], facts: Facts) -> bool:
    """Return True for fronts that face in one direction, within some 25 degrees."""
    facings = [facts[i].facing or (0.0, 0.0) for i in parts]
    return all(float(np.dot(facings[0], other)) > 0.9 for other in facings)


def _line(part: str, facts: Facts) -> list[str]:
    """Return a part and what it belongs to, up to its furniture."""
    line = [part]
    while (parent := facts[line[-1]].parent) is not None and parent in facts:
        line.append(parent)
    return line


ARTICLES = frozenset("the a an my your this that its some".split())
BELONGS = (
    "of",
    "in",
    "on",
    "from",
    "at",
    "under",
    "below",
    "beneath",
    "inside",
)  # What a part belongs to, or stands on
BESIDE = ("near", "above", "below", "left", "right")  # Relations of the grammar to what a part does not belong to
SIDES = {"left": -1.0, "right": 1.0}  # Of a front, as it is seen
GLUE = "~"  # Stands for a blank within a label that holds a relation, such as "chest of drawers"


@dataclass(frozen=True)
class Phrase:
    """Words for a part."""

    noun: str  # without articles, positions and adjectives
    positions: tuple[str, ...]  # such as "top" and "left"
    relation: str  # to what it belongs to or is beside: "of", or one of BESIDE
    context: str  # words for that; empty where none are given
    adjectives: tuple[str, ...] = ()  # such as "red" and "big"


def phrase(words: str, labels: Iterable[str]) -> Phrase:
    """Read words for a part: "the top drawer of the desk", "the desk's top drawer"; names of several words stay whole."""
    for label in {*labels, *(name for noun in NOUNS for name in names_of(noun))}:
        if re.search(r"\sof\s|'s\s", label):
            words = words.replace(label, label.replace(" ", GLUE))
    if owner := re.fullmatch(r"(.+?)'s? (.+)", words):
        words = f"{owner[2]} of {owner[1]}"
    parts = words.split()
    head, relation, context = words, "of", ""
    for at in range(1, len(parts)):
        kind, length = relation_at(parts, at) or ("", 1)
        if kind not in BESIDE and parts[at] in BELONGS:
            kind, length = "of", 1
        if kind and at + length < len(parts):
            if kind not in (*BESIDE, "of"):
                phrase_read = " ".join(parts[at : at + length])
                raise Unresolved("impossible", f"the rules do not read {phrase_read!r}; name the part by its id")
            head, relation, context = " ".join(parts[:at]), kind, " ".join(parts[at + length :])
            break
    tokens = [token for token in re.findall(rf"[\w'{GLUE}-]+", head) if token not in ARTICLES]
    if context.split() and set(re.findall(r"[\w-]+", context)) <= ARTICLES | POSITIONS | {"side"}:  # "on the left"
        tokens, context = [*(t for t in context.split() if t in POSITIONS), *tokens], ""
    positions = tuple(token for token in tokens if token in POSITIONS)
    tokens = [token for token in tokens if token not in POSITIONS]
    in_names = {pair for label in labels for pair in itertools.pairwise(label.split())}  # "orange juice"
    own = [token in ADJECTIVES and (token, after) not in in_names for token, after in itertools.pairwise(tokens)]
    adjectives = tuple(itertools.compress(tokens, own))
    noun = " ".join(itertools.compress(tokens, [*(not each for each in own), True]))
    return Phrase(noun.replace(GLUE, " "), positions, relation, context.replace(GLUE, " "), adjectives)


def resolve(words: str, facts: Facts, fits: Callable[[RoomPart], bool], what: str, *, all_fit: bool = False) -> str:
    """Return the id of the one part that words mean.

    Args:
        words: in lower case.
        facts: the room.
        fits: which parts can be meant at all, such as those that open; of furniture, its parts that fit are meant.
        what: these in words, for refusals.
        all_fit: What does not fit may be meant too: of two cups, one of which is fixed, either.

    Raises:
        Unresolved: none or several are meant.
    """
    exact = [i for i in facts if i.lower() in words.split()]
    if len(exact) == 1 and fits(facts[exact[0]]):
        before = words.split()[: words.split().index(exact[0].lower())]
        own = itertools.takewhile(ADJECTIVES.__contains__, reversed(before))  # "the red cup_17"
        return described(exact, own, exact[0], facts)[0]
    wanted = phrase(words, _labels(facts))
    named = _named(wanted, facts)
    if not named:
        raise Unresolved("unknown", f"nothing in the room is called {wanted.noun or words!r}")
    parts = [i for i in named if fits(facts[i])] or _fitting_parts(wanted.noun, named, facts, fits)
    if not parts:
        raise Unresolved("impossible", f"{wanted.noun!r} is not something that {what}", named)
    if all_fit:
        parts = named if set(parts) <= set(named) else parts
    for position in wanted.positions:
        parts = positioned(parts, position, facts)
    if len(parts) > 1:
        raise Unresolved("ambiguous", f"{len(parts)} parts fit {words!r}", parts)
    if not fits(facts[parts[0]]):
        raise Unresolved("impossible", f"{parts[0]} is not something that {what}", parts)
    return parts[0]


def _fitting_parts(noun: str, named: list[str], facts: Facts, fits: Callable[[RoomPart], bool]) -> list[str]:
    """Return the parts of furniture that fit; the one that bears its name, if there is one: the oven door of an oven."""
    parts = [i for i in facts if fits(facts[i]) and belongs(i, named, facts)]
    nouns = names_of(noun)
    return [i for i in parts if any(facts[i].label.lower().startswith(f"{n} ") for n in nouns)] or parts


def _named(wanted: Phrase, facts: Facts) -> list[str]:
    """Return the parts that a noun names, those in its context where it has one."""
    parts = _called(wanted.noun, facts)
    contexts = [(wanted.relation, wanted.context)] if wanted.context else []
    if not parts and " " in wanted.noun:  # "desk drawer"
        first, _, last = wanted.noun.rpartition(" ")
        parts, contexts = _called(last, facts), [("of", first), *contexts]
    for relation, context in contexts:
        inner = phrase(context, _labels(facts))
        around = _named(inner, facts)
        if not around:  # "paper towel": of a compound all is named
            name = inner.noun if context == wanted.context else wanted.noun
            raise Unresolved("unknown", f"nothing in the room is called {name!r}")
        within = belonging(parts, around, facts) if relation == "of" else []
        if relation == "below":
            within = [i for i in parts if belongs(i, around, facts)]
        within = within or (_beside(parts, around, relation, facts) if relation != "of" else [])
        if not within and parts:
            words = "belongs to" if relation == "of" else f"is {relation}{' of' if relation in SIDES else ''}"
            raise Unresolved("unknown", f"no {wanted.noun!r} {words} {inner.noun!r}", parts)
        parts = within
    try:
        return described(parts, wanted.adjectives, wanted.noun, facts)
    except Unresolved as why:
        if why.kind != "ambiguous" or not wanted.positions:
            raise
    for position in wanted.positions:  # of the top one the colours of the others do not matter
        parts = positioned(parts, position, facts)
    return described(parts, wanted.adjectives, wanted.noun, facts)


def described(parts: list[str], adjectives: Iterable[str], noun: str, facts: Facts) -> list[str]:
    """Return those of some parts that adjectives fit: the big red one is the largest of the red ones.

    Raises:
        Unresolved: all are of other colours, or which one is meant is not known.
    """
    for adjective in sorted(adjectives, key=lambda word: word in BIG | SMALL) if parts else ():
        fitting = _sized if adjective in BIG | SMALL else _colored
        parts = fitting(parts, adjective, noun, facts)
    return parts


def _sized(parts: list[str], adjective: str, _: str, facts: Facts) -> list[str]:
    """Return the largest or smallest of some parts where it is clearly that, else all."""
    volumes = {i: float(np.prod(size)) for i in parts if (size := facts[i].size)}
    order = sorted(volumes, key=volumes.__getitem__, reverse=adjective in BIG)
    if len(order) < 2:
        return parts
    small, large = sorted(volumes[i] for i in order[:2])
    return order[:1] if large > LARGER * small else parts


def _colored(parts: list[str], adjective: str, noun: str, facts: Facts) -> list[str]:
    """Return those of some parts that have a colour, else whose most frequent one is like it; a lone unknown one fits."""
    color = COLOR_WORDS[adjective]
    unknown = [i for i in parts if not facts[i].colors]
    alike = {color}.union(*(group for group in ALIKE if color in group))
    if exact := [i for i in parts if color in facts[i].colors]:
        return exact
    if unknown and len(parts) > 1:
        reason = f"of {len(unknown)} called {noun!r} the colour is not known; leave the colour out or give an id"
        raise Unresolved("ambiguous", reason, unknown)
    if near := unknown or [i for i in parts if facts[i].colors[0] in alike]:
        return near
    colors = ", ".join(f"{i} is {' and '.join(facts[i].colors)}" for i in parts[:3])
    raise Unresolved("unknown", f"no {noun!r} is {adjective}: {colors}", parts)


def _beside(parts: list[str], around: list[str], relation: str, facts: Facts) -> list[str]:
    """Return those of some parts that are near some things, or above, below or to a side of them as their front is seen."""
    gaps: dict[str, float] = {}
    for i, other in itertools.product(parts, around):
        part, thing = facts[i], facts[other]
        if i == other or belongs(i, [other], facts) or not (part.center and part.size and thing.center and thing.size):
            continue
        facing = part.facing or (thing.facing if relation in SIDES else None)
        off, half = np.subtract(part.center, thing.center), (max(part.size[:2]) / 2, max(thing.size[:2]) / 2)
        x, y = facing or (0.0, 0.0)
        across = float(off @ (-y, x, 0.0))
        aside, ahead = (abs(across), abs(float(off @ (x, y, 0.0)))) if facing else (float(np.linalg.norm(off[:2])), 0.0)
        if relation in ("above", "below"):
            sign = 1.0 if relation == "above" else -1.0
            fits = sign * off[2] > 0.0 and aside <= max(half) + BELOW and ahead <= WIDE
            gap = 0.0
        else:
            side = SIDES.get(relation)
            gap = aside if part.moves else float(np.linalg.norm(off[:2]))
            fits = gap <= sum(half) + NEAR and ahead <= WIDE
            if fits and side is not None:
                if not facing:
                    reason = f"{relation!r} needs a front, which neither {part.id} nor {thing.id} has"
                    raise Unresolved("ambiguous", reason, parts)
                fits = side * across > 0.0
        if fits:
            gaps[i] = min(gap, gaps.get(i, gap))
    return [i for i, gap in gaps.items() if gap <= min(gaps.values()) + SAME]


def _called(noun: str, facts: Facts) -> list[str]:
    """Return the part of an id, or those whose label ends in a noun ("cabinet": a "wall cabinet"), else begins with it."""
    if same := [i for i in facts if i.lower() == noun]:
        return same
    nouns, labels = names_of(noun), {i: thing.label.lower() for i, thing in facts.items()}
    head = noun.rpartition(" ")[2] if " " in noun else ""  # a "table" may be the "coffee table", no "bedside table" is
    parts = [i for i, label in labels.items() if label == head in nouns or is_named(label, nouns - {head})]
    parts = parts or [i for i, label in labels.items() if label in coarse_names(noun)]
    return parts or [i for i, label in labels.items() if any(label.startswith(f"{n} ") for n in nouns)]


def _labels(facts: Facts) -> set[str]:
    return {thing.label.lower() for thing in facts.values()}


POLITE = re.compile(
    r"^(?:(?:please|hey|hi|robot|now|first|then|also|finally|next|after that|kindly|could you|can you|would you|will you|"
    r"i want you to|i would like you to|i'd like you to)\b[\s,]*)+"
)
# Negations, conditions, quantities: to overlook one would do the wrong thing
UNREAD = re.compile(
    r"\b(not|don't|dont|never|no|nothing|without|except|but|unless|if|when|while|until|before|after|instead|only|"
    r"all|every|each|both|any|either|or|two|three|everything|halfway|half|slightly|degrees|percent|cm|centimeters)\b"
)
TRAILING = re.compile(r"(?:\s+(?:please|again|now|for me|right away|gently|carefully|completely|fully))+$")
AROUND = re.compile(r"^(?:pull|push|slide|swing)\s+(.+)\s+(open|out|shut|closed|in)$")
PUT = re.compile(
    r"^(?:put away|put|place|set down|set|lay|move|bring|stow|store|drop|stick|pop|transfer|carry|deposit)\s+(.+)$"
)
TAKE = re.compile(r"^(?:take|pick up|grab|get|fetch|grasp)\s+(.+?)(?:\s+(?:from|off|out of)\s+.+)?$")
PLACES = re.compile(r"\s(back into|into|inside|in to|in|back onto|onto|on top of|on to|on)\s")
IT = frozenset({"it", "this", "that", "them"})


def rules(request: Request) -> Answer:
    """Answer the question for skills; what is wrong with an earlier answer is a reason to refuse."""
    facts, sentence, skills = request.facts["things"], str(request.facts["sentence"]), request.facts["skills"]
    try:
        if len(request.messages) > 1:
            raise Unresolved("impossible", request.messages[-1][1])
        answer = SkillPlan(tuple(_skills(sentence, facts, skills)), None, "", ())
    except Unresolved as why:
        answer = SkillPlan((), why.kind, why.reason, why.options)  # type: ignore[arg-type]
    return Answer(json.dumps(asdict(answer)), "rules")


@dataclass
class _Memory:
    """The part and the object that were named last, which "it" means; the words that a bare noun goes on with; what was moved."""

    skills: Mapping[str, type[Task]]
    part: str | None = None
    object: str | None = None
    held: bool = False
    verb: str | None = None
    moved: set[str] = field(default_factory=set)


def _skills(sentence: str, facts: Facts, skills: Mapping[str, type[Task]]) -> list[Skill]:
    """Return the skills of a sentence; Unresolved: it cannot be read, or means none or several things."""
    words = re.sub(r"[\"!?“”]", " ", sentence.lower().replace("\N{RIGHT SINGLE QUOTATION MARK}", "'"))
    if unread := UNREAD.search(words):
        raise Unresolved("impossible", f"the rules do not read {unread[0]!r}; say one thing at a time")
    clauses = [POLITE.sub("", each.strip()) for each in re.split(r"[,;]|\.+(?:\s|$)|\band\b|\bthen\b", words)]
    for at in range(len(clauses) - 1, 0, -1):  # "the mug on the counter, next to the toaster"
        if relation_at(clauses[at].split(), 0) and clauses[at - 1]:
            clauses[at - 1 : at + 1] = [f"{clauses[at - 1]} {clauses[at]}"]
    memory, plan = _Memory(skills), list[Skill]()
    for clause in (TRAILING.sub("", " ".join(each.split())) for each in clauses):
        if clause and clause != "please":
            # "open the window and the door", "put the cup on the desk and the glue stick on the table"
            if plan and memory.verb and clause.split()[0] in ("the", "a", "an", *map(str.lower, facts)):
                clause = f"{memory.verb} {clause}"
            plan += _clause(clause, facts, memory)
    if memory.held:
        raise Unresolved("impossible", "no skill holds an object; say where to put it")
    if not plan:
        raise Unresolved("impossible", "the sentence asks for nothing")
    return _merged(plan, skills)


def _clause(clause: str, facts: Facts, memory: _Memory) -> list[Skill]:
    """Return the skills of one clause."""
    if match := AROUND.match(clause):
        clause = f"{'open' if match[2] in ('open', 'out') else 'close'} {match[1]}"
    turns = _turns(memory.skills)
    for pattern, name in turns:
        if match := pattern.match(clause):
            memory.verb = memory.skills[name].INSTRUCTION.phrases[0]
            return [_turn(match[1], name, facts, memory)]
    memory.verb = None
    if match := PUT.match(clause):
        if re.match(r"(?:me|us|him|her)\b", match[1]):
            raise Unresolved("impossible", "no skill hands an object over")
        memory.verb = "put"
        return [_put(re.sub(r" (?:down|away|back)(?= )", "", match[1]), facts, memory)]
    if match := TAKE.match(clause):
        memory.object, memory.held = resolve(match[1], facts, _is_free, "lies free", all_fit=True), True
        return []
    if any(pattern.match(f"{clause} it") for pattern in (*(pattern for pattern, _ in turns), PUT, TAKE)):
        raise Unresolved("ambiguous", f"{clause} what?")
    verb = clause.split()[0]
    possible = ", ".join(
        [*(name for name, kind in memory.skills.items() if kind.INSTRUCTION.phrases), "put ... on", "put ... into"]
    )
    raise Unresolved("impossible", f"no skill for {verb!r}; skills: {possible}")


def _turns(skills: Mapping[str, type[Task]]) -> list[tuple[re.Pattern[str], str]]:
    """Return the pattern of a clause, and the name, of each skill that takes a part alone; phrases of more words come first."""
    phrases = [(phrase, name) for name, kind in skills.items() for phrase in kind.INSTRUCTION.phrases]
    phrases.sort(key=lambda each: -len(each[0].split()))
    return [(re.compile(rf"^{phrase}\s+(.+)$"), name) for phrase, name in phrases]


def _taking(memory: _Memory, *takes: str) -> str:
    """Return the name of the first skill that takes these; Unresolved where there is none."""
    names = [name for name, kind in memory.skills.items() if kind.INSTRUCTION.takes == takes]
    if not names:
        raise Unresolved("impossible", f"no skill takes {' and '.join(takes)}")
    return names[0]


def _turn(words: str, name: str, facts: Facts, memory: _Memory) -> Skill:
    """Return the skill that opens or closes a part."""
    if words in IT:
        if memory.part is None:
            raise Unresolved("ambiguous", f"what does {words!r} mean?")
        return Skill(name, memory.part, None, None)
    if memory.part and re.search(r"\bones?$", words):  # "the bottom one"
        words = f"{re.sub(r'ones?$', facts[memory.part].label, words)} of {facts[memory.part].parent or memory.part}"
    memory.part = resolve(words, facts, lambda thing: thing.moves, "opens")
    return Skill(name, memory.part, None, None)


def _put(words: str, facts: Facts, memory: _Memory) -> Skill:
    """Return the skill that puts an object somewhere: of the ways to split the words, the first that means something."""
    splits = list(PLACES.finditer(f"{words} "))
    inner = re.fullmatch(r"(.+) (?:in|inside|back)", words)
    if inner and memory.part:  # "put the cup in", after "open the drawer"
        return Skill(_taking(memory, "object", "part"), memory.part, _object(inner[1], facts, memory), None)
    if not splits:
        raise Unresolved("ambiguous", "where to? say on or into what")
    first: Unresolved | None = None
    for split in splits:
        try:
            object = _object(words[: split.start()], facts, memory)
            skill = _placed(object, split[1], words[split.end() :].strip(), facts, memory)
            memory.moved.add(object)
            return skill
        except Unresolved as why:
            first = first or why
    raise first or Unresolved("impossible", "nothing was read")


def _object(words: str, facts: Facts, memory: _Memory) -> str:
    """Return the object that words mean."""
    if words in IT:
        if memory.object is None:
            raise Unresolved("ambiguous", f"what does {words!r} mean?")
        return memory.object
    memory.object = resolve(words, facts, _is_free, "lies free; the room was prepared with it fixed", all_fit=True)
    return memory.object


def _placed(object: str, place: str, words: str, facts: Facts, memory: _Memory) -> Skill:
    """Return the skill that puts an object on or into what words mean."""
    memory.held = False
    if place in ("on", "onto", "on to", "on top of", "back onto"):
        support = resolve(words, facts, lambda thing: thing.kind == "fixed", "can support an object")
        if facts[object].on == support and object not in memory.moved:
            raise Unresolved("impossible", f"{object} is on {support} already", (support,))
        return Skill(_taking(memory, "object", "support"), None, object, support)
    into = _taking(memory, "object", "part")
    if words in IT and memory.part:
        return Skill(into, memory.part, object, None)
    memory.part = resolve(words, facts, lambda thing: thing.moves, f"opens; {into} needs a part that does")
    return Skill(into, memory.part, object, None)


def _is_free(thing: RoomPart) -> bool:
    return thing.kind == "free"


def _merged(plan: list[Skill], skills: Mapping[str, type[Task]]) -> list[Skill]:
    """Return the skills without opening before, and closing after, one that does both by itself to put an object in."""
    merged: list[Skill] = []
    words = {name: kind.INSTRUCTION for name, kind in skills.items()}
    for skill in plan:
        last = merged[-1] if merged else None
        if last is not None and last.part == skill.part is not None:
            if skill.object and not last.object and words[skill.skill].begins == "shut":
                if words[last.skill].leaves == "open":
                    merged.pop()
            elif last.object and not skill.object and words[last.skill].leaves == "shut":
                if words[skill.skill].leaves == "shut":
                    continue
        merged.append(skill)
    return merged
