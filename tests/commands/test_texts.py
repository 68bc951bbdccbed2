"""Whatever text or path is typed, it arrives as it was given, through every key of every command that takes one."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from dataclasses import is_dataclass
from pathlib import Path
from types import UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np
import pytest
import tiny_scan
from few import few

from s2a.commands import cli
from s2a.core import config
from s2a.core.errors import InputError
from s2a.scene.usd import geometric

ALPHABETS = (
    "abcXYZ", "0123456789", "0123456789_", "-", "=", "'\"", "[](){}", ",", ", ", "${}", "~", " ", "\n\t", "\\", "#@!$&*?|<>;:%^`",
    "äéßÆ", "日本語房间", "مرحبا", "\u202e\u200d\ufeff", "🛋️🚪", "\x1b[31m", "e5", ".", "null", "true", "+",
)  # fmt: skip
FORMS = (
    "2024-11-27", "20241127_120000", "2024_11_27", "00017", "007.50", "1e5", "61e5", "1_000", "0x1F", "0b1", "+5",
    ".5", "-", "--out", "-label", "out=x", "a=b=c", "${oc.env:HOME}", "${out}", "$HOME", "~", "~/x", "~nobody",
    "trailing  ", "  leading", "two\nlines", "line\r", "???", "null ", "None", "yes", "off", "nan", "inf", "[]", "{}",
    "[a", "(1)", "a,b", ",", '"', "'", '""', "a\\", "\\n", "<b>", "{{x}}", "%s", "é" * 127, "a" * 255, "TEXT_0_",
    "TEXT_1_ TEXT_0_", "!!python/object", "&a", "*a", "- a", "a: b", "a #b", "|",
)  # fmt: skip
"""What programs and people name folders: dates, numbers, options, variables, templates, names as long as may be."""


def texts(count: int, seed: int) -> list[str]:
    """Return texts: the forms above, and random mixtures of letters of all kinds."""
    rng = np.random.default_rng(seed)
    mixed = []
    for _ in range(max(0, count - len(FORMS))):
        chosen = [ALPHABETS[i] for i in rng.choice(len(ALPHABETS), rng.integers(1, 5))]
        letters = [alphabet[rng.integers(len(alphabet))] for alphabet in chosen for _ in range(rng.integers(1, 6))]
        mixed.append("".join(letters[i] for i in rng.permutation(len(letters))))
    return [*FORMS, *mixed][:count]


def text_keys(command: str) -> dict[str, bool | None]:
    """Return the keys of a command that take a text or a path, by name: whether a list of them; None: or a list."""
    given = set(config.keys(cli.compose(command, [])))

    def walk(settings: type, prefix: str) -> Iterator[tuple[str, bool | None]]:
        for name, kind in get_type_hints(settings).items():
            kinds = get_args(kind) if get_origin(kind) in (Union, UnionType) else (kind,)
            for each in kinds:
                if is_dataclass(each):
                    yield from walk(each, f"{prefix}{name}.")
            if {str, Path}.intersection(kinds):
                yield prefix + name, None if any(get_origin(each) is tuple for each in kinds) else False
            elif any(get_origin(each) is tuple and set(get_args(each)) <= {str, Path, ...} for each in kinds):
                yield prefix + name, True

    return {name: several for name, several in walk(cli.settings_of(command), "") if name in given}


def value(values: dict[str, Any], key: str) -> Any:
    """Return the value of a dotted key."""
    for name in key.split("."):
        values = values[name]
    return values


def quoted(text: str) -> str:
    """Return an element of a list as it has to be typed."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


COMMANDS = sorted(cli.commands())


@pytest.mark.parametrize("rounds", [1, pytest.param(200, marks=pytest.mark.slow)])
@pytest.mark.parametrize("command", COMMANDS)
def test_every_text_arrives_through_every_key(command: str, rounds: int) -> None:
    samples, keys = texts(200, COMMANDS.index(command)), text_keys(command)
    samples.remove("null") if "null" in samples else None
    order = np.random.default_rng(rounds).permutation(len(samples))
    for turn in range(rounds):
        mine = {key: samples[order[(turn + place) % len(samples)]] for place, key in enumerate(keys)}
        mine |= {key: text[1:] for key, text in mine.items() if keys[key] is None and text[:1] + text[-1:] == "[]"}
        arguments = [f"{key}={f'[{quoted(text)}]' if keys[key] else text}" for key, text in mine.items()]
        values = cli.compose(command, arguments)
        for key, text in mine.items():
            assert value(values, key) == ([text] if keys[key] else text), (key, text)


@pytest.mark.parametrize("command", few([each for each in COMMANDS if each != "doctor"], 8))  # which has no keys
def test_a_text_that_is_no_value_of_a_command_is_one_line(command: str) -> None:
    keys = [key for key, several in text_keys(command).items() if not several]
    required = [key for key in keys if value(cli.compose(command, []), key) == config.REQUIRED]
    for number, text in enumerate(texts(200, 7)[COMMANDS.index(command) :: 45]):
        key = keys[number % len(keys)]
        arguments = [f"{other}=x" for other in required if other != key] + [f"{key}={text}"]
        try:
            settings: Any = config.load(cli.settings_of(command), cli.compose(command, arguments))
        except InputError as error:
            assert "\n" not in str(error)
            continue
        for name in key.split("."):
            settings = getattr(settings, name)
        plain = str(Path(text).expanduser()) if isinstance(settings, Path) else text
        assert str(settings) == plain, (key, text)


def fits(text: str) -> bool:
    """Return whether a text can be a file's name, and leaves room for no other's place."""
    return 0 < len(os.fsencode(text)) <= 255 and "/" not in text and text.strip(". ") != "" and text[0] != "~"


NAMES = [text for text in texts(200, 11) if fits(text)][::9]
NAMES += [os.fsdecode(b"caf\xe9"), "a" * 255, "\x1b[31mred", "two\nlines", "\u202egnp.exe"]


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES, ids=ascii)
def test_folders_of_any_name_are_read_and_written(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "out").mkdir()
    tiny_scan.write(tmp_path / "in" / name)
    monkeypatch.chdir(tmp_path / "in")
    code = cli.main(["export", f"scan={name}", f"out=../out/{name}"])
    printed = capsys.readouterr()
    if code:
        assert code == 2 and "this is a bug" not in printed.err
        assert len(printed.err.strip().splitlines()) == 1
        assert os.listdir(tmp_path / "out") == []
    else:
        assert os.listdir(tmp_path / "out") == [name]
        assert {"geometric.usd", "descriptive.usda"} <= set(os.listdir(tmp_path / "out" / name))
        with contextlib.chdir(tmp_path / "out"):
            assert cli.main(["view", f"path={name}/geometric.usd"]) == 0
    assert os.listdir(tmp_path / "in") == [name]
    assert "\x1b" not in printed.err + printed.out


LABELS = (
    "<script>alert(1)</script>",
    "\x1b[31mdoor",
    "\u202erood",
    "{label}",
    "%s",
    "${x}",
    "T\xfcr \u95e8",
    "/World/x",
    "x" * 300,
)


@pytest.mark.parametrize("label", LABELS, ids=ascii)
def test_labels_of_any_letters_are_kept_and_printed_as_text(
    label: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = tiny_scan.contents()
    files[tiny_scan.PARTS]["data"]["annotations"][1]["label"] = f"{label}.1.2"
    tiny_scan.write(tmp_path / "scan", files)
    assert cli.main(["export", f"scan={tmp_path / 'scan'}", f"out={tmp_path / 'usd'}"]) == 0
    assert label in {part.label for part in geometric.read(tmp_path / "usd" / "geometric.usd").parts.values()}
    assert cli.main(["view", f"path={tmp_path / 'usd' / 'geometric.usd'}"]) == 0
    printed = capsys.readouterr()
    assert all(letter.isprintable() or letter == "\n" for letter in printed.out + printed.err)
