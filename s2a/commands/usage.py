"""Help texts of the command line, generated from the documentation of the configuration classes."""

import inspect
import json
import re
import sys
import textwrap
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import is_dataclass
from itertools import takewhile
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

from s2a.core import config
from s2a.core.errors import InputError

GENERAL = """\
usage: s2a <command> key=value ...

{commands}

s2a <command> --help   keys of the command, their defaults and meaning
--help-all             the same with the keys of all groups, such as sim.*
-m, --multirun         run once per value of key=a,b; each run writes `out` below its own folder
--debug                show the traceback of an error
--version              show the version
"""


def general(commands: Mapping[str, str]) -> str:
    """Return the help text of the whole command."""
    return GENERAL.format(commands="\n".join(f"  {command:10}{meaning}" for command, meaning in commands.items()))


def command(name: str, meaning: str, cls: type, every: bool = False) -> str:
    """Return the help text of one command: examples, then keys with their defaults and their meaning.

    `every`: list the keys inside groups, too; else a line a group says how many there are.
    """
    values = sorted(config.leaves(config.compose(name)), key=lambda leaf: "." in leaf[0])
    texts = meanings(cls, config.compose(name))
    inside = Counter(key.partition(".")[0] for key, _ in values if "." in key)
    words = getattr(sys.modules[cls.__module__], "SENTENCE", None)
    first = f'"{words}" ' if words else ""
    lines = [f"s2a {name} {first}key=value ...: {meaning}", *examples(name), ""]
    for key, value in values:
        if every or "." not in key:
            lines.append(f"  {key + '=' + typed(value):40} {meaning_of(key, texts)}".rstrip())
    if inside and not every:
        lines += [
            "",
            *(f"  {f'{group}.*':40} {n} key{'s' * (n > 1)}: {texts.get(group, '')}" for group, n in inside.items()),
        ]
        lines += [f"  s2a {name} --help-all lists them."]
    return "\n".join([*lines, *options(name, cls)])


def fitted(text: str, columns: int) -> str:
    """Return a help text in lines of so many columns; a meaning goes on below its beginning, or below its key."""
    lines: list[str] = []
    for line in text.splitlines():
        begin = re.match(r"( +\S+ +|  )?", line).end()  # type: ignore[union-attr]
        below = " " * (begin if begin <= columns // 2 - 10 else 8)
        if len(line) > columns:
            line = textwrap.fill(line, columns, subsequent_indent=below, break_long_words=False, break_on_hyphens=False)
        lines.append(line)
    return "\n".join(lines)


def meanings(cls: type, values: Mapping[str, Any]) -> dict[str, str]:
    """Return the meaning of the keys of a command's settings, those that depend on its composed values among them."""
    return attributes(cls) | _chosen(cls, values)


def _chosen(cls: type, values: Mapping[str, Any]) -> dict[str, str]:
    """Read the meaning of the keys of those fields that depend on the values."""
    texts: dict[str, str] = {}
    for key in values:
        if chosen := config.note(cls, key, config.Chosen):
            texts |= attributes(chosen.choose(values), f"{key}.")
        if described := config.note(cls, key, config.Described):
            texts |= {f"{key}.{name}": meaning for name, meaning in described.describe(values).items()}
    return texts


def examples(name: str) -> list[str]:
    """Return the comment at the head of a command's YAML, which shows example calls."""
    lines = (config.folder() / f"{name}.yaml").read_text().splitlines()
    return [line.removeprefix("#").rstrip() for line in takewhile(lambda line: line.startswith("#"), lines)]


def typed(value: Any) -> str:
    """Return a value as a user types it: true, null, [1,2]."""
    if value == config.REQUIRED:
        return "(required)"
    if isinstance(value, (list, tuple)):
        return f"[{','.join(map(typed, value))}]"
    return json.dumps(value) if value is None or isinstance(value, bool) else f"{value}"


def groups(name: str) -> dict[str, list[str]]:
    """Return the files of the config groups that a command composes from sub-folders, by group."""
    text = (config.folder() / f"{name}.yaml").read_text()
    names = re.findall(r"^\s*- (?:override )?/?([\w/]+)(?:@\w+)?: ", text, flags=re.MULTILINE)
    return {group: sorted(path.stem for path in (config.folder() / group).glob("*.yaml")) for group in names}


def options(name: str, cls: type) -> list[str]:
    """List the options of the config groups of a command: of shared groups those that it can load."""
    choices = groups(name)
    required = [f"{key}=given" for key, value in config.leaves(config.compose(name)) if value == config.REQUIRED]
    for group, names in choices.items():
        choices[group] = [each for each in names if _loads(name, cls, [*required, f"{group}={each}"])]
    lines = [f"  {group}=...  one of: {', '.join(names)}" for group, names in choices.items() if len(names) > 1]
    return ["", *lines] if lines else []


def _loads(name: str, cls: type, overrides: Sequence[str]) -> bool:
    """Return whether a command can load its settings with overrides."""
    try:
        config.load(cls, config.compose(name, overrides))
    except InputError:
        return False
    return True


def meaning_of(key: str, meanings: Mapping[str, str]) -> str:
    """Return the meaning of a dotted key; entries of a dictionary share one under `*`, or that of the whole dictionary."""
    names = key.split(".")
    inside = (".".join([*names[:i], "*", *names[i + 1 :]]) for i in range(1, len(names)))
    return next((meanings[name] for name in (key, *inside, ".".join(names[:-1])) if name in meanings), "")


def attributes(cls: type, prefix: str = "") -> dict[str, str]:
    """Read the meaning of every dotted key from the `Attributes:` of a dataclass and of those inside it.

    What lies in a dictionary of dataclasses is found under the key `*`; the meaning of each key of another dictionary may be an
    annotation of its type, `Annotated[dict[str, float], {key: meaning}]`. Choices that the text does not name are added to it.
    """
    texts: dict[str, str] = {}
    for part in reversed(cls.__mro__[:-1]):
        section = inspect.cleandoc(part.__doc__ or "").partition("Attributes:\n")[2]
        entries = re.findall(r"^    (\w+): (.*(?:\n {8,}.*)*)", section, flags=re.MULTILINE)
        texts |= {f"{prefix}{key}": " ".join(text.split()) for key, text in entries}
    annotated: dict[str, Any] = get_type_hints(cls, include_extras=True)
    for key, kind in get_type_hints(cls).items():
        for meanings in (note for note in get_args(annotated[key])[1:] if isinstance(note, Mapping)):
            texts |= {f"{prefix}{key}.{name}": meaning for name, meaning in meanings.items()}
        if text := texts.get(f"{prefix}{key}"):
            texts[f"{prefix}{key}"] = _with_choices(text, config.expected(kind))
        inner, path = (get_args(kind)[1], f"{key}.*") if get_origin(kind) is dict else (kind, key)
        for option in get_args(inner) if isinstance(inner, UnionType) else (inner,):  # one of them may be None
            if isinstance(option, type) and is_dataclass(option):
                texts |= attributes(option, f"{prefix}{path}.")
    return texts


def _with_choices(text: str, expected: str) -> str:
    """Return the meaning of a key with what it may be ("one of: a, b, or null"), unless the text names all of that."""
    choices = expected.partition("one of: ")[2].removesuffix(", or null").split(", ")
    return text if all(choice in text for choice in choices) else f"{text.rstrip('.')}; {expected}."
