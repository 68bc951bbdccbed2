"""English relations between things of a room, and names of these: lexicon and parser, shared by insertion and skills.

wish     = { clause }
clause   = [ "not" ] relation thing { "and" thing } | edge | height
relation = a phrase of `PHRASES`, the longest that begins at a word
edge     = "at the left end" of the thing named beside it
thing    = [ article ] words up to the next relation, comma or stop word
"""

from __future__ import annotations

import difflib
import itertools
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

MISSPELLED = 0.86  # Similarity (difflib's ratio) from which a word is a misspelling of another
NOUNS = {
    "counter": "kitchen counter|countertop|worktop|base cabinet|kitchen unit|kitchen island|counter top",
    "shelf": "bookshelf|bookcase|shelves|wall shelf|rack|shelving unit|shelf unit", "bookshelf": "bookcase|shelf|shelves",
    "sink": "washbasin|wash basin|basin|bathroom sink|kitchen sink", "washbasin": "sink|basin|wash basin",
    "vanity": "bathroom cabinet|sink cabinet|vanity unit|washstand|bathroom counter", "bathtub": "bath|tub|bath tub",
    "shower": "shower tray|shower cabin|shower floor", "sofa": "couch|settee|loveseat", "armchair": "easy chair|recliner",
    "nightstand": "bedside table|bedside cabinet|night stand|night table", "bedside table": "nightstand|night table",
    "tv stand": "tv cabinet|tv bench|media console|lowboard|tv unit|tv table", "tv cabinet": "tv stand|lowboard",
    "dresser": "chest of drawers|drawer chest|commode|sideboard", "stove": "hob|cooktop|oven|cooker|range",
    "cabinet": "cupboard|storage cabinet|sideboard|filing cabinet|file cabinet|drawer cabinet", "cup": "mug",
    "table": "dining table|side table|coffee table|kitchen table|end table|meeting table",
    "windowsill": "window sill|window ledge",
    "desk": "office desk|writing desk|workbench|office table", "keyboard": "computer keyboard", "microwave": "microwave oven",
    "tv": "television|tv set|television set|flat screen|screen", "floor": "ground", "rug": "carpet|mat",
    "monitor": "screen|display|computer screen|computer monitor", "toilet": "cistern|toilet tank|wc",
    "refrigerator": "fridge|icebox", "wardrobe": "closet", "dish rack": "drying rack|dish drainer",
    "trash can": "bin|waste bin|dustbin|trash bin|wastebasket|waste basket|garbage can|rubbish bin|trash",
    "laundry basket": "hamper|laundry hamper", "backpack": "rucksack", "curtain": "drape", "painting": "picture",
}  # fmt: skip
"""Synonyms and kinds of each noun."""
COARSE = {
    "table": "desk|workbench|nightstand|bedside table", "couch": "sofa|armchair", "sofa": "couch|armchair", "bed": "mattress",
    "storage": "cabinet|cupboard|wardrobe|closet|shelf|bookshelf|bookcase|dresser|sideboard|rack|storage unit",
    "screen": "monitor|tv|television|display|projector screen", "wall art": "picture|painting|poster|photo|artwork|frame",
    "door frame": "door|doorway|entrance", "window frame": "window|windowsill", "window": "windowsill", "chair": "armchair|stool",
}  # fmt: skip
"""What the labels of captures by a headset or a phone stand for, where no thing has the name itself."""
AREAS = {
    "kitchen": "stove|oven|refrigerator|fridge|counter|base cabinet|dishwasher|toaster|microwave",
    "bathroom": "toilet|bathtub|shower|washbasin",
    "bedroom": "bed|nightstand|wardrobe",
    "office": "desk|monitor|keyboard",
    "living room": "sofa|couch|armchair|coffee table|tv|tv stand",
    "dining room": "dining table",
}
"""What stands in each area of a home."""

SIDES = {"left": "left|lefthand", "right": "right|righthand", "back": "back|rear|far", "front": "front|near"}
END = "at|on|along|near|to|towards the {side} hand|_ end|side|edge|border|corner|half"
BEDDING = ("blanket", "duvet", "mattress", "bedspread", "quilt")
"""What covers a bed, and carries in its stead."""
PHRASES: dict[str, tuple[str, ...]] = {
    "seen from": ("be|_ seen|watched by|from", "visible to|for|from", "in full|plain|_ sight|view of|from",
                  "greet|greets|welcome|welcomes", "look|looks|looking at"),
    **{f"{side} edge": (f"{END.format(side=words)} of|_", f"at|on|to the {words} of|_" if side in ("back", "front") else
                        f"on|at|to the {words}") for side, words in SIDES.items()},
    **{side: (f"to|on|_ the|_ {side} hand|_ of", f"to|on the {side} hand side of") for side in ("left", "right")},
    "between": ("in|_ between",), "front": ("in front of", "before"), "behind": ("behind", "in back of"),
    "above": ("above", "over"), "below": ("below", "beneath", "under", "underneath"),
    "opposite": ("opposite to|of|_", "across from"),
    "corner": ("in|at|on the|a|one corner of|_",),
    "middle": ("in|at|on the very|_ middle|centre|center of|_",),
    "top": ("on the top|upper|highest|uppermost|topmost shelf|board|compartment|level of|_", "on|onto the|_ top of", "atop"),
    "bottom": ("on the bottom|lowest|lower|lowermost shelf|board|compartment|level of|_",),
    "away": ("far|_ away from", "far from"),
    "near": ("within|in easy|_ arm|_ s|_ reach of", "reach|reachable it|this|_ from", "next|close|adjacent|near to", "near",
             "beside", "by", "alongside", "with", "at"),
    "against": ("against", "leaning against|on|at"), "in": ("inside of|_", "within", "into", "in"), "on": ("onto", "upon", "on"),
}  # fmt: skip
"""Relations and their phrases, as sequences of alternatives; "_" is left out."""
TABLE = {
    tuple(word for word in words if word != "_"): kind
    for kind, phrases in reversed(PHRASES.items())
    for phrase in phrases
    for words in itertools.product(*(step.split("|") for step in phrase.split()))
}
"""Kind of relation by the words of a phrase; of equal phrases the kind that comes first in PHRASES."""
MAX_WORDS = max(map(len, TABLE))
EDGES = {"left edge": "left", "right edge": "right", "front edge": "front", "back edge": "behind"}
"""Ends of what carries an object; they mean beside a thing that does not."""
DIRECT = ("on", "in", "against", "top", "bottom", *EDGES, "corner", "middle")
"""Relations to what carries the object."""
BESIDE = ("near", "left", "right", "front", "behind", "between")
"""Relations to what stands on the same support."""
ON_CARRIER = (*EDGES, "corner", "middle")
ARTICLES = frozenset("the a an my your our its this that some one".split())
PEOPLE = frozenset(
    "people those person persons guests visitors whoever who whom anybody anyone everybody everyone somebody someone me us that "
    "is are am sit sits sitting lie lies lying stand stands standing sleep sleeps sleeping on in at by from before".split()
)
STOPS = frozenset(
    "and but so where which that please with facing then not if or to at from because for who whoever".split()
)
"""Words at which the name of a thing ends."""
NOWHERE = frozenset(
    "room house home flat way air hand place spot sight view people person someone lid handle it them all least eye reach".split()
)
"""Words after a preposition that name no thing."""
AFTER = frozenset(
    "please there here today now somewhere wherever anywhere again instead too as like when while though far left right close "
    "well standing ok thanks thank you i we he she they is are was will can could would should only just ones high up "
    "down out".split()
)
"""Words after a name with which something else begins."""
SPATIAL = frozenset(
    "left right end edge side corner middle centre center under beneath below behind between beside opposite above front "
    "inside facing".split()
)
"""Words that no reading of a wish may pass over."""
UNITS = {"m": 1.0, "metre": 1.0, "metres": 1.0, "meter": 1.0, "meters": 1.0, "cm": 0.01}


@dataclass(frozen=True)
class Relation:
    """A relation of a wish.

    Attributes:
        kind: of `PHRASES`, or "wall", "height" or "area".
        part_ids: for each name in it, the ids of the parts that it may mean; empty for what has no name.
        words: as given.
        height: of the middle of the object above the floor [m], for kind "height".
        negated: True for "not on the floor".
    """

    kind: str
    part_ids: tuple[tuple[str, ...], ...]
    words: str
    height: float | None = None
    negated: bool = False


@dataclass(frozen=True)
class Wish:
    """A parsed wish.

    Attributes:
        relations: its parts, each checked by itself.
        missing: names of things that are not in the room.
        unread: spatial words that belong to no relation.
    """

    relations: tuple[Relation, ...] = ()
    missing: tuple[str, ...] = ()
    unread: tuple[str, ...] = ()


def names_of(noun: str) -> set[str]:
    """Return a noun, its singular, and its synonyms in both directions."""
    forms = {noun, noun.removesuffix("s"), noun.removesuffix("es"), noun.removesuffix("ves") + "f"} - {"", "f"}
    general = {key for key, others in NOUNS.items() if forms & {*others.split("|")}}
    return forms.union(general, *(NOUNS[noun].split("|") for noun in forms & NOUNS.keys()))


def coarse_names(noun: str) -> set[str]:
    """Return the coarse labels that may stand for a noun."""
    names = names_of(noun)
    return {label for label, nouns in COARSE.items() if names & {*nouns.split("|")}}


def alike(noun: str, kinds: Iterable[str]) -> list[str]:
    """Return those of some kinds of things that are spelled like a noun, used as its thing is, or in the same area of a home."""
    kinds = list(kinds)
    spelled = difflib.get_close_matches(noun, kinds, cutoff=MISSPELLED)
    names = names_of(noun) | {noun.split()[-1]}
    groups = [{key, *nouns.split("|")} for key, nouns in (*NOUNS.items(), *COARSE.items(), *AREAS.items())]
    near = set().union(*(group for group in groups if group & names))
    return [*spelled, *(kind for kind in kinds if kind not in spelled and is_named(kind, near))]


def is_named(label: str, names: Iterable[str]) -> bool:
    """Return True if the head noun of a label is one of some names: "office desk" is a desk, "trashcan" a "trash can"."""
    words = label.lower().replace("_", " ")
    return any(
        words == name or words.endswith(f" {name}") or (" " in name and words == name.replace(" ", ""))
        for name in names
    )


def is_kind_of(label: str, noun: str) -> bool:
    """Return True if a label names this kind of object."""
    return is_named(label, (noun, *NOUNS.get(noun, noun).split("|")))


def area_of(name: str) -> str | None:
    """Return the area of a home that a name means: "kitchen corner"; None for another name."""
    area = name.removesuffix(" area").removesuffix(" corner")
    return area if area in AREAS else None


def landmarks(labels: Mapping[str, str]) -> tuple[str, ...]:
    """Return the ids of what stands in some area of a home."""
    nouns = [noun for nouns in AREAS.values() for noun in nouns.split("|")]
    return tuple(i for i, label in labels.items() if is_named(label, nouns))


def relation_at(words: list[str], at: int) -> tuple[str, int] | None:
    """Return the kind and length of the longest relation that begins at a word; None if there is none."""
    for length in range(min(MAX_WORDS, len(words) - at), 0, -1):
        kind = TABLE.get(tuple(words[at : at + length]))
        if kind:
            return kind, length
    return None


def tokens(text: str) -> list[str]:
    """Return words, numbers and separators of a text in lower case; hyphens and apostrophes part words."""
    return re.findall(r"\d+(?:\.\d+)?|[a-z][a-z0-9_]*|[,;.]", text.lower())


def parse_wish(text: str, labels: Mapping[str, str]) -> Wish:
    """Parse a wish for a room, given by the label of each part id."""
    parser = _Parser(tokens(text), labels)
    parser.run()
    return parser.wish()


@dataclass
class _Parser:
    words: list[str]
    labels: Mapping[str, str]
    at: int = 0
    relations: list[Relation] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    unread: list[str] = field(default_factory=list)
    hangs: bool = False
    after_neighbour: int = -1

    def run(self) -> None:
        """Read clause by clause; what is no clause is passed over."""
        while self.at < len(self.words):
            word = self.words[self.at]
            match = relation_at(self.words, self.at)
            if match:
                self._clause(*match)
            elif word.replace(".", "").isdigit() and self._peek(1) in UNITS:
                self._height(float(word) * UNITS[self._peek(1)], 2)
            elif self.words[self.at : self.at + 2] in (["eye", "level"], ["eye", "height"]):
                self._height(1.55, 2)
            elif word in ("who", "whoever", "whom"):
                while self._peek(0) not in ("", ".", ";"):
                    self.at += 1
            else:
                self.hangs |= word in ("hang", "hangs", "hanging")
                adverb = word == "right" and (self._peek(1) in AFTER or relation_at(self.words, self.at + 1))
                self.unread += [word] if word in SPATIAL and not adverb else []
                self.at += 1

    def wish(self) -> Wish:
        """Return what was read, with ends bound to what carries the object."""
        carriers = [
            i for i, one in enumerate(self.relations) if one.kind in ("on", "in", "top", "bottom") and one.part_ids
        ]
        for i, one in enumerate(self.relations):
            if one.kind in ON_CARRIER and not one.part_ids:
                before = [j for j in carriers if j < i] or carriers
                if before:
                    self.relations[i] = replace(one, part_ids=self.relations[before[-1]].part_ids)
                else:
                    self.unread.append(one.words)
            elif one.kind in EDGES and carriers and not {*one.part_ids[0]} & {*self.relations[carriers[0]].part_ids[0]}:
                self.relations[i] = replace(one, kind=EDGES[one.kind])
        relations = [one for one in self.relations if one.part_ids or one.kind == "height"]
        if self.hangs and not any(one.kind == "wall" for one in relations):
            relations.append(Relation("wall", (self._ids(("wall",)),), "hanging"))
        return Wish(tuple(relations), tuple(dict.fromkeys(self.missing)), tuple(self.unread))

    def _peek(self, ahead: int) -> str:
        return self.words[self.at + ahead] if self.at + ahead < len(self.words) else ""

    def _height(self, height: float, length: int) -> None:
        words = " ".join(self.words[self.at : self.at + length])
        self.at += length
        if self.words[self.at : self.at + 3] in (["above", "the", "floor"], ["above", "the", "ground"]):
            self.at += 3
        if relation_at(self.words, self.at) and self._peek(0) in "left right from behind to in above".split():
            self.unread.append(words)
            return
        self.relations.insert(0, Relation("height", (), words, height))

    def _clause(self, kind: str, length: int) -> None:
        """Read a relation and its things."""
        begin = self.at
        phrase = self.words[begin : begin + length]
        recent = list(
            itertools.takewhile(lambda word: word not in ",;.", reversed(self.words[max(0, begin - 4) : begin]))
        )
        if (
            kind in ("on", "in")
            and self.at == self.after_neighbour
            and any(one.kind in DIRECT for one in self.relations)
        ):
            self.at += length
            carrier = self._thing(kind)  # "on the couch near the picture on the wall": where the picture is
            if carrier and not carrier[1]:
                area = area_of(carrier[0])
                (self.unread if area else self.missing).append(f"{kind} {carrier[0]}" if area else carrier[0])
            return
        negated = bool({"not", "never", "don"} & set(recent[:3] if "don" not in recent else recent))
        self.at += length
        if self._peek(0).replace(".", "").isdigit() or self._peek(0) == "eye":
            return  # "at 1.5 m"
        if kind == "seen from":
            while self._peek(0) in PEOPLE:
                self.at += 1
        anaphor = kind in ON_CARRIER and phrase[-1] != "of"
        shelf = kind in ("top", "bottom") and phrase[-1] not in ("of", "atop")
        if anaphor or shelf:
            ids = self._ids(names_of("shelf")) if shelf else ()
            self.missing += ["shelf"] if shelf and not ids else []
            self.relations += (
                [Relation(kind, (ids,) if ids else (), " ".join(phrase), None, negated)] if ids or anaphor else []
            )
            return
        named: list[tuple[str, tuple[str, ...]]] = []
        while thing := self._thing(kind):
            named.append(thing)
            more = self._peek(0) == "and" or (self._peek(0) == "," and self._peek(1) == "and")
            ahead = self.at + 1 + (self._peek(0) == ",")
            if not more or relation_at(self.words, ahead) or not self._names_a_thing(ahead):
                break
            self.at = ahead
        if kind == "between":
            if len(named) == 2 and all(ids for _, ids in named):
                words = f"{' '.join(phrase)} {named[0][0]} and {named[1][0]}"
                self.relations.append(Relation(kind, tuple(ids for _, ids in named), words, None, negated))
            self.unread += ["between"] if len(named) == 1 and named[0][1] else []
        if named and kind in BESIDE:
            self.after_neighbour = self.at
        for name, ids in named:
            if ids and kind != "between":
                self.relations.append(self._relation(kind, name, ids, f"{' '.join(phrase)} {name}", negated))
            elif not ids and area_of(name):
                self.unread.append(f"{' '.join(phrase)} {name}")
            elif not (ids or negated or kind == "away"):
                self.missing.append(name)

    def _relation(self, kind: str, name: str, ids: tuple[str, ...], words: str, negated: bool) -> Relation:
        if area_of(name) and not self._ids((name,)):
            return Relation("area", (ids,), words, None, negated)
        on_wall = kind in ("on", "in") and self.labels[ids[0]].lower().endswith("wall")
        return Relation("wall" if on_wall else kind, (ids,), words, None, negated)

    def _names_a_thing(self, at: int) -> bool:
        """Return True if a thing is named at a word: after an article, or by a word of the room."""
        word = self.words[at] if at < len(self.words) else ""
        return word in ARTICLES or bool(word and self._ids(names_of(word)))

    def _thing(self, kind: str) -> tuple[str, tuple[str, ...]] | None:
        """Read a thing: its name and the ids that it may mean; None where no thing is named."""
        article = self._peek(0) in ARTICLES
        if self.words[self.at : self.at + 2] == ["one", "of"]:
            self.at += 2
        while self._peek(0) in ARTICLES:
            self.at += 1
        words: list[str] = []
        while (word := self._peek(len(words))) and word.isidentifier() and word not in STOPS and len(words) < 5:
            if words and relation_at(self.words, self.at + len(words)):
                break
            words.append(word)
        words = words[:1] + list(
            itertools.takewhile(lambda word: word not in AFTER and not word.endswith("ly"), words[1:])
        )
        name = " ".join(words)
        for first in range(len(words)):
            ending = " ".join(words[first:])
            exact = tuple(i for i, label in self.labels.items() if ending in (i.lower(), label.lower()))
            coarse = coarse_names(ending)  # labels as they are: a "coffee table" is no desk
            if ids := exact or self._ids(names_of(ending)) or self._labelled(coarse):
                self.at += len(words)
                return name, ids
        if (area := area_of(name)) and kind in ("in", "near", "on"):
            self.at += len(words)
            return name, self._ids(AREAS[area].split("|"))
        if not words or not article or words[0] in NOWHERE:
            self.at += len(words) if words and words[0] in NOWHERE else 0
            return None
        self.at += len(words)
        return name, ()

    def _labelled(self, names: set[str]) -> tuple[str, ...]:
        return tuple(i for i, label in self.labels.items() if label.lower().replace("_", " ") in names)

    def _ids(self, names: Iterable[str]) -> tuple[str, ...]:
        names = tuple(names)
        return tuple(i for i, label in self.labels.items() if is_named(label, names))
