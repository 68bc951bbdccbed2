"""Values from the YAML tree and the command line -> frozen dataclasses, strictly.

A frozen dataclass, beside the code that uses it, holds the names, types, units and meaning of settings. Each value has one
place. What someone has a reason to set, a document, a test, an experiment, a preset or a user, is a key: its value is in the
tree `conf/`, and its field has no default. Any other value is the default of its field, with its source beside it, and
no key: the command line refuses it as unknown, while callers in Python and settings of earlier runs may give it.
`load` joins the two: a key that is missing, unknown or of another type is an error, and so is a value outside the bounds of its
type (`s2a.core.bounds`).
"""

import difflib
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, is_dataclass
from functools import cache, lru_cache
from pathlib import Path
from types import UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import dacite
from hydra import compose as hydra_compose
from hydra import initialize_config_dir
from hydra.core.config_store import ConfigStore
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException, MissingConfigException, OverrideParseException
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from yaml import YAMLError

from s2a.core import bounds
from s2a.core.errors import InputError

T = TypeVar("T")


@dataclass(frozen=True)
class Chosen:
    """Annotation of a field whose dataclass depends on the values: `Annotated[Base, Chosen(choose)]`."""

    choose: Callable[[Mapping[str, Any]], type]  # all plain values -> the field's dataclass, a subclass of its type


@dataclass(frozen=True)
class Named:
    """Annotation of a field that a name stands for: `Annotated[RobotSpec, Named(load)]`; what it holds is no keys."""

    read: Callable[[str], Any]  # name -> the field's value; InputError for a name that there is not


@dataclass(frozen=True)
class Described:
    """Annotation of a dictionary field whose keys depend on the values: `Annotated[dict[str, float], Described(describe)]`."""

    describe: Callable[[Mapping[str, Any]], Mapping[str, str]]  # all plain values -> the meaning of each possible key


REQUIRED = "???"  # Placeholder of a value without a default in a YAML file


def folder() -> Path:
    """Return the folder of the YAML tree: inside the installed package, or beside it in a checkout."""
    package = Path(__file__).resolve().parents[1]
    return package / "conf" if (package / "conf").is_dir() else package.parent / "conf"


def is_job() -> bool:
    """Return whether this process is in a job of a sweep."""
    return HydraConfig.initialized()


def compose(name: str, overrides: Sequence[str] = (), settings: type | None = None) -> dict[str, Any]:
    """Compose `conf/<name>.yaml` with `key=value` overrides in Hydra's grammar.

    `settings`: dataclass of the values. What is given for its text and path keys is then taken as it is (see
    `_spared`).

    Returns:
        Plain nested dictionaries, interpolations resolved; `???` stays where a required value was not given.

    Raises:
        InputError: an override that cannot be read, or that names an unknown key or option.
    """
    given, texts = opened(overrides), list[str]()
    if settings:
        given = [_spared(text, settings, texts) for text in given]
    try:
        composed: dict[str, Any] = _restored(_composed(folder(), name, tuple(given)), texts)
    except (HydraException, OmegaConfBaseException, ValueError) as error:
        reason = explain(error, keys(_composed(folder(), name, resolve=False)))
        raise InputError(_restored(reason, texts)) from error
    return composed


@lru_cache(256)
def _composed(tree: Path, name: str, overrides: tuple[str, ...] = (), resolve: bool = True) -> dict[str, Any]:
    """Return plain values, which are not to be changed: Hydra takes 0.1 s for them."""
    with initialize_config_dir(str(tree), version_base="1.3"):
        return plain(hydra_compose(name, list(overrides)), resolve)


# An override that gives a value: key with its sign, key, value
ASSIGNMENT = re.compile(r"(\+{0,2}([\w.]+))=(.*)", re.S)
# What stands for a text while Hydra composes: it can neither read it in its grammar nor take it for a number
STAND_IN = re.compile(r"TEXT_(\d+)_")
# What Hydra takes for no text
NUMBER = re.compile(r"[+-]?[\d_.]*\d[\d_.]*(?:[eE][+-]?[\d_]+)?|[+-]?(?:inf|nan)|true|false", re.I)
# An element of a list: quoted, where a comma is in it, or as it is
ELEMENT = re.compile(r"""\s*(?:"((?:[^"\\]|\\.)*)"|'((?:[^'\\]|\\.)*)'|([^,]*?))\s*(?:,|$)""", re.S)


def _spared(override: str, settings: type, texts: list[str]) -> str:
    """Return an override with stand-ins for its texts, which are appended to `texts`.

    The value of a key of a text or path is all of the argument after the "=", be it a number, a comma or a quote; `null` is
    none where the key may be none. A list of them is [a,b]; an element with a comma is quoted.
    """
    assignment = ASSIGNMENT.fullmatch(override)
    kinds = _kinds(settings, assignment[2]) if assignment else ()
    if assignment is None or not any(kind in (str, Path) or _is_list(kind) for kind in kinds):
        return override
    key, value = assignment[1], assignment[3]
    bracketed, lists = value[:1] == "[" and value[-1:] == "]", [kind for kind in kinds if get_origin(kind) is tuple]
    if (value == "null" and type(None) in kinds) or (bracketed and lists and not any(map(_is_list, lists))):
        return override
    several = bracketed and bool(lists)
    elements = _elements(value) if several else [value]
    stand_ins = ",".join(f"TEXT_{len(texts) + i}_" for i in range(len(elements)))
    texts += elements
    return f"{key}=[{stand_ins}]" if several else f"{key}={stand_ins}"


def _kinds(settings: type, key: str) -> tuple[Any, ...]:
    """Return the types that the value of a dotted key may have; none for an unknown key, and for one of a dictionary."""
    kind: Any = settings
    for name in key.split("."):
        if not is_dataclass(kind) or name not in (hints := get_type_hints(kind)):
            return ()
        kind = hints[name]
    return get_args(kind) if get_origin(kind) in (Union, UnionType) else (kind,)


def _is_list(kind: Any) -> bool:
    """Return True for a list of texts or of paths."""
    return get_origin(kind) is tuple and set(get_args(kind)) <= {str, Path, Ellipsis}


def _elements(value: str) -> list[str]:
    """Return the elements of [a,"b,c"], without their quotes."""
    inner, elements, start = value[1:-1], list[str](), 0
    while inner.strip() and start <= len(inner) and (match := ELEMENT.match(inner, start)):
        quoted = match[1] if match[1] is not None else match[2]
        elements.append(match[3] if quoted is None else re.sub(r"""\\(["'\\])""", r"\1", quoted))
        start = match.end() if match[0].endswith(",") else len(inner) + 1
    return elements


def _restored(value: Any, texts: Sequence[str]) -> Any:
    """Return values, or a message, with the texts for their stand-ins."""
    if isinstance(value, str):
        return STAND_IN.sub(lambda match: texts[int(match[1])] if int(match[1]) < len(texts) else match[0], value)
    if isinstance(value, Mapping):
        return {key: _restored(inner, texts) for key, inner in value.items()}
    return [_restored(inner, texts) for inner in value] if isinstance(value, list) else value


def quoted(overrides: Sequence[str], settings: type) -> list[str]:
    """Return the overrides of a sweep with quotes around numbers that are texts or paths, which Hydra's grammar would rewrite."""

    def quote(override: str) -> str:
        assignment = ASSIGNMENT.fullmatch(override)
        if assignment is None or not {str, Path}.intersection(_kinds(settings, assignment[2])):
            return override
        return f"{assignment[1]}=" + ",".join(
            f'"{each.strip()}"' if NUMBER.fullmatch(each.strip()) else each for each in assignment[3].split(",")
        )

    return [quote(each) for each in overrides]


def file(name: str) -> dict[str, Any]:
    """Return the values of one file of the tree, `conf/<name>.yaml`; unlike `compose`, also inside of a Hydra job."""
    return read(folder() / f"{name}.yaml")


def read(path: Path) -> dict[str, Any]:
    """Return the values of a YAML file, interpolations resolved; InputError where it cannot be read."""
    try:
        return plain(OmegaConf.load(path))
    except (YAMLError, OmegaConfBaseException, ValueError, TypeError) as error:
        raise InputError(f"{path}: {' '.join(str(error).split())}") from error


def plain(config: Any, resolve: bool = True) -> dict[str, Any]:
    """Turn a composed Hydra configuration into nested dictionaries; required values without a value stay `???`."""
    return dict(OmegaConf.to_container(config, resolve=resolve))  # type: ignore[arg-type]


def load(cls: type[T], values: Mapping[str, Any], prefix: str = "") -> T:
    """Build a frozen dataclass from plain nested dictionaries: every key known, present, of its type, in its range.

    Lists become tuples, strings become paths and integers become floats where the dataclass says so.

    Raises:
        InputError: naming the key, the value, and what is possible.
    """
    if missing := [key for key, value in leaves(values) if value == REQUIRED]:
        raise InputError(f"key {prefix + missing[0]!r} has no value; give {prefix}{missing[0]}=...")
    values = {key: _chosen(cls, key, value, values) for key, value in values.items()}
    rules = dacite.Config(strict=True, type_hooks={float: _float, int: _int, Path: _path})
    try:
        loaded = dacite.from_dict(cls, _tuples(values), rules)
    except dacite.WrongTypeError as error:
        key, given = f"{prefix}{error.field_path}", _given(values, error)
        raise InputError(f"key {key!r} is {given!r}; expected {expected(error.field_type)}") from error
    except dacite.MissingValueError as error:
        key = f"{prefix}{error.field_path}"
        raise InputError(f"key {key!r} is missing; give +{key}=...") from error
    except dacite.UnexpectedDataError as error:
        name = sorted(error.keys)[0]
        raise InputError(_unknown(name, [key for key in keys(values) if name not in key.split(".")])) from error
    bounds.check(cls, loaded, prefix.removesuffix("."))
    return loaded


@cache
def hints(cls: type) -> dict[str, Any]:
    """Return the annotations of a dataclass's fields, with what is annotated beside their types."""
    return get_type_hints(cls, include_extras=True)


N = TypeVar("N", Chosen, Described, Named)


def note(cls: type, key: str, kind: type[N]) -> N | None:
    """Return the annotation of a field that depends on the values; None for any other."""
    hint = hints(cls).get(key)
    return next((annotation for annotation in get_args(hint)[1:] if isinstance(annotation, kind)), None)


def _chosen(cls: type, key: str, value: Any, values: Mapping[str, Any]) -> Any:
    """Return a field's value, loaded where its dataclass depends on the values; InputError for a key that nothing describes."""
    if not isinstance(value, Mapping):
        named = note(cls, key, Named) if isinstance(value, str) else None
        return named.read(value) if named else value
    if (described := note(cls, key, Described)) and (
        unknown := set(value).difference(names := described.describe(values))
    ):
        raise InputError(_unknown(f"{key}.{min(unknown)}", [f"{key}.{name}" for name in names]))
    chooser = note(cls, key, Chosen)
    return load(chooser.choose(values), value, f"{key}.") if chooser else value


def opened(overrides: Sequence[str]) -> list[str]:
    """Return overrides as Hydra takes them.

    Reward terms may be added, since not all of them are listed; the file of a task, task=FILE.py, becomes an option of its
    groups; each of tasks=[FILE.py,...] one of the skills.

    Raises:
        InputError: there is no such file of a task, or no YAML file beside it.
    """
    opened_ = [f"++{text}" if text.startswith("reward.") else text for text in overrides]
    skills = [
        option(name)
        for text in opened_
        if text.startswith("tasks=")
        for name in re.findall(r"[^\[\],=\s\"']+\.py", text)
    ]
    if bad := [name for name in skills if not name.isidentifier()]:
        raise InputError(f"the task {bad[0]!r} cannot be a skill; give its files a name of letters, digits and _")
    further = [f"+{group}@skills.{name}.{group}={name}" for name in skills for group in ("task", "metrics")]
    return further + [TASK_FILE.sub(lambda match: f'{match[1]}="{option(match[2])}"', text) for text in opened_]


TASK_FILE = re.compile(r"^(\+{0,2}task(?:@[\w.]+)?)=[\"']?(.+\.py)[\"']?$")  # An override that gives a task by its file


def option(name: str) -> str:
    """Return a task's name as an option of its config groups; that of a file, FILE.py, is added to them from FILE.yaml.

    That file holds what conf/task, conf/metrics and conf/reward hold of other tasks, under keys of these names.

    Raises:
        InputError: there is no such file, or no YAML file beside it; it is named like a task of the package.
    """
    if not name.endswith(".py"):
        return name
    path = Path(name).expanduser().resolve()
    values, stem = path.with_suffix(".yaml"), path.stem
    for each in (path, values):
        if not each.is_file():
            raise InputError(f"{each}: no such file; a task is FILE.py with FILE.yaml beside it")
    if (folder() / "task" / f"{stem}.yaml").exists():
        raise InputError(f"{path}: there is a task {stem!r} already; give the file another name")
    groups = plain(OmegaConf.load(values), resolve=False)
    if not {"task", "metrics"} <= set(groups):
        raise InputError(
            f"{values}: expected the keys task and metrics, and reward for training; has {', '.join(groups)}"
        )
    # A task is trained by the reward of its name; one that states none, by the paper's.
    groups.setdefault("reward", plain(OmegaConf.load(folder() / "reward" / "paper.yaml"), resolve=False))
    for group, node in groups.items():
        ConfigStore.instance().store(
            group=group, name=stem, node=node | ({"name": str(path)} if group == "task" else {}), package=group
        )
    _composed.cache_clear()  # of a file of this name with other values
    return stem


def leaves(values: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    """List the dotted key and the value of everything that is not a dictionary."""
    pairs: list[tuple[str, Any]] = []
    for key, value in values.items():
        nested = isinstance(value, Mapping)
        pairs += leaves(value, f"{prefix}{key}.") if nested else [(f"{prefix}{key}", value)]
    return pairs


def keys(values: Mapping[str, Any]) -> list[str]:
    """List the dotted keys of everything that can be overridden."""
    return [key for key, _ in leaves(values)]


def nearest(name: str, names: Iterable[str]) -> str:
    """Return the end of an error message: the known names closest to a mistyped one, or all where none is close."""
    names = list(names)
    close = difflib.get_close_matches(name, names, n=3, cutoff=0.5)
    return f"; did you mean: {', '.join(close)}" if close else f"; possible: {', '.join(names)}"


def explain(error: Exception, names: Iterable[str]) -> str:
    """Turn an error of Hydra or OmegaConf about the overrides into one line."""
    text = str(error)
    if isinstance(error, OverrideParseException):
        return f"{error.override!r} is not key=value; quote a value with special characters: 'key=\"value\"'"
    if isinstance(error, MissingConfigException) and error.options:
        group, _, option = str(error.missing_cfg_file).rpartition("/")
        return f"key {group!r} is {option!r}{nearest(option, error.options)}"
    if match := re.search(r"Could not override '([^']+)'|Key '([^']+)' is not in struct", text):
        return _unknown(match[1] or match[2], list(names))
    if match := re.search(r"Missing mandatory value: (\S+)", text):
        return f"key {match[1]!r} has no value; give {match[1]}=..."
    if match := re.search(r"Ambiguous value for argument '([^']+)'", text):
        return f"{match[1]!r} gives several values; write key=[a,b] for a list, or add -m to run once with each"
    return " ".join(text.split())


def _unknown(name: str, names: list[str]) -> str:
    """Return the message about a key that does not exist, with the closest ones."""
    return f"key {name!r} is unknown{_nearest_key(name, names)}"


def _nearest_key(name: str, names: list[str]) -> str:
    """Return the end of an error message: keys that end as a mistyped one does or nearly so, else those of its group."""
    group, _, last = name.rpartition(".")
    ends = [key.rpartition(".")[2] for key in names]
    meant = [last] if last in ends else difflib.get_close_matches(last, ends, n=3, cutoff=0.8)
    matches = [key for key, end in zip(names, ends, strict=True) if end in meant]
    if matches:  # those of its own group first
        return f"; did you mean: {', '.join(sorted(matches, key=lambda key: key.rpartition('.')[0] != group)[:3])}"
    beside = _beside(group, names)
    close = difflib.get_close_matches(last, beside, n=3, cutoff=0.5)
    if close:
        return f"; did you mean: {', '.join(beside[each] for each in close)}"
    return f"; possible: {', '.join(beside.values())}"


def _beside(group: str, names: list[str]) -> dict[str, str]:
    """Return what lies in a group of keys, or in the innermost around it that there is: the last parts, and keys or `group.*`.

    A command has hundreds of keys: of a group inside the group its name is enough.
    """
    while group and not any(key.startswith(f"{group}.") for key in names):
        group = group.rpartition(".")[0]
    start = f"{group}." if group else ""
    inside = [key.removeprefix(start).partition(".") for key in names if key.startswith(start)]
    return {first: f"{start}{first}{dot and '.*'}" for first, dot, _ in inside}


def expected(kind: Any) -> str:
    """Describe a type of a dataclass field to a user."""
    if get_origin(kind) is Literal:
        return "one of: " + ", ".join(map(str, get_args(kind)))
    if type(None) in get_args(kind):
        return " or ".join(expected(option) for option in get_args(kind) if option is not type(None)) + ", or null"
    names = {float: "a number", int: "a whole number", bool: "true or false", str: "a text", Path: "a path"}
    if get_origin(kind) is tuple:
        first, *others = get_args(kind)
        if others and all(other is first for other in others) and first in names:
            return f"a list of {1 + len(others)} {names[first].removeprefix('a ')}s"
        inner = [option for option in get_args(kind) if option is not Ellipsis]
        more = ["..."] if len(inner) < len(get_args(kind)) else []
        if more and get_origin(first) is Literal:
            return f"a list, each {expected(first)}"
        return f"a list [{', '.join([*map(expected, inner), *more])}]"
    return names.get(kind, str(kind).replace("pathlib.", ""))


def _given(values: Mapping[str, Any], error: dacite.WrongTypeError) -> Any:
    """Return the offending value as the user gave it; dacite pads a list that is too short."""
    return dict(leaves(values)).get(str(error.field_path), error.value)


def _tuples(value: Any) -> Any:
    """Copy nested values with every list as a tuple, for frozen dataclasses."""
    if isinstance(value, Mapping):
        return {key: _tuples(inner) for key, inner in value.items()}
    return tuple(map(_tuples, value)) if isinstance(value, (list, tuple)) else value


def _float(value: Any) -> Any:
    _refuse_bool(value, float)
    return float(value) if isinstance(value, int) else value


def _int(value: Any) -> Any:
    _refuse_bool(value, int)
    return value


def _path(value: Any) -> Any:
    if value == "":  # pathlib takes it for the current folder
        raise dacite.WrongTypeError(Path, value)
    if not isinstance(value, (str, int)) or isinstance(value, bool):
        return value
    try:
        return Path(str(value)).expanduser()
    except RuntimeError as error:
        raise InputError(f"{value!r}: no such home directory; set HOME, or begin a name with ./~") from error


def _refuse_bool(value: Any, kind: type) -> None:
    """Raise for true and false, which are numbers in Python."""
    if isinstance(value, bool):
        raise dacite.WrongTypeError(kind, value)
