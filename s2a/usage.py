"""What the command line tells about itself, taken from the configuration's own documentation."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping
from dataclasses import is_dataclass
from typing import Any, get_args, get_origin, get_type_hints

from s2a import config

GENERAL = """\
usage: s2a <verb> key=value ...

{verbs}

s2a <verb> --help    the verb's keys, their values and meaning
-m, --multirun       run once with each of the values in key=a,b; each run's `out` lies below its own folder
--debug              show the traceback of an error
--version            show the version
"""


def general(verbs: Mapping[str, str]) -> str:
    """Return the help text of the whole command."""
    return GENERAL.format(verbs="\n".join(f"  {verb:10}{meaning}" for verb, meaning in verbs.items()))


def verb(name: str, meaning: str, cls: type) -> str:
    """Return the help text of one verb: every key with its value in the YAML tree and its meaning."""
    values = sorted(config.leaves(config.compose(name)), key=lambda leaf: "." in leaf[0])
    meanings = attributes(cls)
    lines = [f"s2a {name} key=value ...: {meaning}", ""]
    for key, value in values:
        shown = "(required)" if value == config.REQUIRED else f"{value}"
        lines.append(f"  {key + '=' + shown:40} {meaning_of(key, meanings)}".rstrip())
    return "\n".join([*lines, *options(name)])


def options(name: str) -> list[str]:
    """List the alternatives of the groups that a verb's configuration takes from sub-folders."""
    text = (config.folder() / f"{name}.yaml").read_text()
    groups = re.findall(r"^\s*- (?:override )?/?([\w/]+)(?:@\w+)?: ", text, flags=re.MULTILINE)
    found = {group: sorted(path.stem for path in (config.folder() / group).glob("*.yaml")) for group in groups}
    return ["", *(f"  {group}=...  one of: {', '.join(names)}" for group, names in found.items())] if found else []


def meaning_of(key: str, meanings: Mapping[str, str]) -> str:
    """Find the meaning of a dotted key, for one inside a dictionary under `*`; empty where only the whole has one."""
    names = key.split(".")
    inside = (".".join([*names[:i], "*", *names[i + 1 :]]) for i in range(1, len(names)))
    return next((meanings[name] for name in (key, *inside) if name in meanings), "")


def attributes(cls: type, prefix: str = "") -> dict[str, str]:
    """Read the meaning of every dotted key from the `Attributes:` of a dataclass and of those inside it.

    What lies in a dictionary of dataclasses is found under the key `*`.
    """
    found: dict[str, str] = {}
    for part in reversed(cls.__mro__[:-1]):
        section = inspect.cleandoc(part.__doc__ or "").partition("Attributes:\n")[2]
        entries = re.findall(r"^    (\w+): (.*(?:\n {8,}.*)*)", section, flags=re.MULTILINE)
        found |= {f"{prefix}{key}": " ".join(text.split()) for key, text in entries}
    hints: dict[str, Any] = get_type_hints(cls)
    for key, kind in hints.items():
        inner, path = (get_args(kind)[1], f"{key}.*") if get_origin(kind) is dict else (kind, key)
        if isinstance(inner, type) and is_dataclass(inner):
            found |= attributes(inner, f"{prefix}{path}.")
    return found
