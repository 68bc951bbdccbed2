"""The documentation: its links lead somewhere, its commands are understood, and what is cheap in it is executed."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
import satellites
from few import few

from s2a.commands import cli
from s2a.core import config

docs_site = pytest.importorskip("docs_site", reason="mkdocs is not installed", exc_type=ImportError)

ROOT = Path(__file__).parents[2]
PAGES = (*docs_site.PAGES, *sorted(p.relative_to(ROOT).as_posix() for p in (ROOT / "docs").rglob("*.md")))
ELLIPSIS, PLACEHOLDER = "...", re.compile(r"\.\.\.|=NAME$")
"""Stand for what a reader fills in."""
CHEAP = ("check", "export", "view", "zoo")


def blocks(text: str) -> Iterator[str]:
    """Yield the lines of blocks of code, continued ones joined; fences of other languages aside."""
    yield from re.findall(r"^```(?:bash|sh)?\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    yield from re.findall(r"(?:^ {4,}\S.*\n)+", re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE), re.M)


def commands(text: str) -> list[list[str]]:
    """Return the arguments of every call of s2a in blocks of code; lines with shell variables are left out."""
    lines = "\n".join(blocks(text)).replace("\\\n", " ").splitlines()
    calls = [re.sub(r"^(torchrun .*-m )?s2a ", "s2a ", line.strip()) for line in lines]
    return [shlex.split(call, comments=True)[1:] for call in calls if call.startswith("s2a ") and "$" not in call]


def mentions(text: str) -> list[list[str]]:
    """Return the arguments of every call of s2a within a sentence, which may leave some out."""
    spans = re.findall(r"`s2a (\w+ [^`]*=[^`]*)`", re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE))
    return [[*shlex.split(" ".join(span.split())), ELLIPSIS] for span in spans if "$" not in span and "|" not in span]


def understood(arguments: list[str]) -> None:
    """Compose and load the settings of a call, as the command line does; of a sweep, those of its first job."""
    swept = {"-m", "--multirun"} & set(arguments)
    command, *rest = [argument for argument in arguments if not argument.startswith("-")]
    given = [argument for argument in rest if not PLACEHOLDER.search(argument)]
    if swept:
        firsts = [re.sub(r"^([\w.+/]+=[^\[{\"',]*),.*", r"\1", argument) for argument in given]
        given = [argument for argument in firsts if not argument.startswith("hydra")]
    if len(given) < len(rest):
        names = {argument.partition("=")[0] for argument in given}
        given += [f"{key}=given" for key in required(command) if key not in names]
    config.load(cli._module(command).Config, cli.compose(command, given))


@cache
def required(command: str) -> tuple[str, ...]:
    return tuple(key for key, value in config.leaves(config.compose(command)) if value == config.REQUIRED)


@pytest.mark.parametrize("page", PAGES)
def test_links_and_paths_lead_to_files_of_the_repository(page: str) -> None:
    text = (ROOT / page).read_text()
    links = [docs_site.target(page, path) for path, _ in docs_site.links(text)]
    links += re.findall(r"`((?:s2a|conf|tests|tools|experiments|docs)/[\w/-]+\.\w+)`", text)
    assert [link for link in links if not (ROOT / link).exists()] == []


@pytest.mark.parametrize(
    "page", few([page for page in PAGES if page != "CHANGELOG.md"], 4)
)  # it names keys of its time
def test_every_command_of_the_documentation_is_understood(page: str) -> None:
    text = (ROOT / page).read_text()
    for arguments in map(list, dict.fromkeys(map(tuple, commands(text) + mentions(text)))):
        if any(map(satellites.missing, arguments)):
            continue
        try:
            understood(arguments)
        except Exception as error:
            raise AssertionError(f"{page}: s2a {shlex.join(arguments)}: {error}") from error


def test_commands_are_found_in_fences_indented_blocks_and_sentences_and_wrong_ones_are_not_understood() -> None:
    text = "a\n\n    s2a view path=x \\\n        text=true\n\n```\ns2a zoo out=z  # c\nfor a in b; do s2a zoo out=$a; done\n```\n"
    assert sorted(commands(text)) == [["view", "path=x", "text=true"], ["zoo", "out=z"]]
    assert mentions("give `s2a view path=x`, or `s2a view`") == [["view", "path=x", ELLIPSIS]]
    understood(["view", "...", "image=x.png"])
    for wrong in (["view", "image=x.png"], ["view", "path=x", "imag=x.png"], ["vew", "path=x"]):
        with pytest.raises(Exception, match=r"path|imag|vew"):
            understood(wrong)


@pytest.mark.slow
def test_the_site_builds_without_a_broken_link(tmp_path: Path) -> None:
    build = [sys.executable, "-m", "mkdocs", "build", "--site-dir", str(tmp_path / "site")]
    quiet = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(build, cwd=ROOT, capture_output=True, text=True, env=quiet)
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "site/experiments/results/rooms.json").is_file()
    assert "Three results" in (tmp_path / "site/index.html").read_text()


def run(calls: list[list[str]]) -> None:
    for arguments in calls:
        assert cli.main(arguments) == 0, shlex.join(arguments)


@pytest.mark.slow
def test_the_cheap_commands_of_the_first_room_run(
    office_scan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "demo").mkdir()
    (tmp_path / "demo/scan").symlink_to(office_scan)
    monkeypatch.chdir(tmp_path)
    calls = commands((ROOT / "docs/tutorials/first_room.md").read_text())
    run([call for call in calls if call[0] in CHEAP and "path=demo/room.usd" not in call])
    assert (tmp_path / "demo/geometric.usd").is_file() and (tmp_path / "demo/zoo/truth.json").is_file()


FIRST, SMALL = "docs/tutorials/first_room.md", ("num_envs=16", "ppo.iterations=3")


def shortened(call: list[str]) -> list[str]:
    """Return a call of a tutorial with as few iterations as a test has time for."""
    if call[0] == "train":
        names = {text.partition("=")[0] for text in SMALL}
        call = [each for each in call if each.partition("=")[0] not in names] + list(SMALL)
    return [each.replace("model_349", "model_2").replace("num_envs=1024", "num_envs=16") for each in call]


@pytest.mark.slow
@pytest.mark.parametrize(
    "pages",
    [
        ("README.md",),
        (FIRST,),
        (FIRST, "docs/tutorials/insert.md"),
        (FIRST, "docs/tutorials/train.md"),
        ("docs/tutorials/phone.md",),
    ],
    ids=lambda pages: Path(pages[-1]).stem,
)
def test_a_page_runs_from_top_to_bottom(
    pages: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The pages before the last one write what it begins with; pools of hundreds of homes are left out."""
    monkeypatch.chdir(tmp_path)
    for page in pages:
        calls = [call for call in commands((ROOT / page).read_text()) if "pools/" not in str(call)]
        assert len(calls) > 3
        waiting = [
            call for call in calls if "page=true" in call or (call[0] == "annotate" and "page=false" not in call)
        ]
        for call in (shortened(call) for call in calls if call not in waiting):
            code = cli.main(call)
            assert code == 0 or (call[0] == "certify" and code == 1), shlex.join(call)
