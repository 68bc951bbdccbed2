"""What the command line tells about itself, taken from the configuration's own documentation."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping
from dataclasses import is_dataclass
from typing import Any, get_type_hints

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
        lines.append(f"  {key + '=' + shown:40} {meanings.get(key, '')}".rstrip())
    return "\n".join([*lines, *options(name)])


def options(name: str) -> list[str]:
    """List the alternatives of the groups that a verb's configuration takes from sub-folders."""
    text = (config.folder() / f"{name}.yaml").read_text()
    groups = re.findall(r"^\s*- (?:override )?/?([\w/]+)(?:@\w+)?: ", text, flags=re.MULTILINE)
    found = {group: sorted(path.stem for path in (config.folder() / group).glob("*.yaml")) for group in groups}
    return ["", *(f"  {group}=...  one of: {', '.join(names)}" for group, names in found.items())] if found else []


def attributes(cls: type, prefix: str = "") -> dict[str, str]:
    """Read the meaning of every dotted key from the `Attributes:` sections of a dataclass and of those inside it."""
    section = (inspect.getdoc(cls) or "").partition("Attributes:\n")[2]
    entries = re.findall(r"^    (\w+): (.*(?:\n {8,}.*)*)", section, flags=re.MULTILINE)
    found = {f"{prefix}{key}": " ".join(text.split()) for key, text in entries}
    hints: dict[str, Any] = get_type_hints(cls)
    for key, kind in hints.items():
        if isinstance(kind, type) and is_dataclass(kind):
            found |= attributes(kind, f"{prefix}{key}.")
    return found
