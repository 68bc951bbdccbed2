"""The rule-based fallback: English sentences of a few verbs, without a model; what it does not read, it refuses."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field

from s2a.language.do.facts import Facts, RoomPart
from s2a.language.do.nouns import Unresolved, resolve
from s2a.language.do.plan import Skill, SkillPlan
from s2a.language.llm.ask import Answer, Request
from s2a.tasks.base import Task

POLITE = re.compile(
    r"^(?:(?:please|hey|hi|robot|now|first|then|also|finally|next|after that|kindly|could you|can you|would you|will you|"
    r"i want you to|i would like you to|i'd like you to)\b[\s,]*)+"
)
UNREAD = re.compile(
    r"\b(not|don't|dont|never|no|nothing|without|except|but|unless|if|when|while|until|before|after|instead|only|"
    r"all|every|each|both|any|either|or|two|three|everything|halfway|half|slightly|degrees|percent|cm|centimeters)\b"
)
"""Negations, conditions, quantities: to overlook one would do the wrong thing."""
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
        found = SkillPlan(tuple(_skills(sentence, facts, skills)), None, "", ())
    except Unresolved as why:
        found = SkillPlan((), why.kind, why.reason, why.options)  # type: ignore[arg-type]
    return Answer(json.dumps(asdict(found)), "rules")


@dataclass
class _Memory:
    """The part and the object that were named last, which "it" means; the skill that a bare noun goes on with; what was moved."""

    skills: Mapping[str, type[Task]]
    part: str | None = None
    object: str | None = None
    held: bool = False
    verb: str | None = None
    moved: set[str] = field(default_factory=set)


def _skills(sentence: str, facts: Facts, skills: Mapping[str, type[Task]]) -> list[Skill]:
    """Return the skills of a sentence.

    Raises:
        Unresolved: it cannot be read, or means none or several things.
    """
    words = re.sub(r"[\"!?“”]", " ", sentence.lower().replace("\N{RIGHT SINGLE QUOTATION MARK}", "'"))
    if unread := UNREAD.search(words):
        raise Unresolved("impossible", f"the rules do not read {unread[0]!r}; say one thing at a time")
    clauses = [POLITE.sub("", each.strip()) for each in re.split(r"[,;]|\.+(?:\s|$)|\band\b|\bthen\b", words)]
    memory, found = _Memory(skills), list[Skill]()
    for clause in (TRAILING.sub("", " ".join(each.split())) for each in clauses):
        if clause and clause != "please":
            if found and clause.split()[0] in ("the", "a", "an") and memory.verb:  # "open the window and the door"
                clause = f"{skills[memory.verb].INSTRUCTION.phrases[0]} {clause}"
            found += _clause(clause, facts, memory)
    if memory.held:
        raise Unresolved("impossible", "no skill holds an object; say where to put it")
    if not found:
        raise Unresolved("impossible", "the sentence asks for nothing")
    return _merged(found, skills)


def _clause(clause: str, facts: Facts, memory: _Memory) -> list[Skill]:
    """Return the skills of one clause."""
    if found := AROUND.match(clause):
        clause = f"{'open' if found[2] in ('open', 'out') else 'close'} {found[1]}"
    turns = _turns(memory.skills)
    for pattern, name in turns:
        if found := pattern.match(clause):
            memory.verb = name
            return [_turn(found[1], name, facts, memory)]
    memory.verb = None
    if found := PUT.match(clause):
        if re.match(r"(?:me|us|him|her)\b", found[1]):
            raise Unresolved("impossible", "no skill hands an object over")
        return [_put(re.sub(r" (?:down|away|back)(?= )", "", found[1]), facts, memory)]
    if found := TAKE.match(clause):
        memory.object, memory.held = resolve(found[1], facts, _is_free, "lies free", all_fit=True), True
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
            found = _placed(object, split[1], words[split.end() :].strip(), facts, memory)
            memory.moved.add(object)
            return found
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
