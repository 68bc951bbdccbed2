"""The vocabulary: words of the project's old dialect are in no public name, configuration key, message or documentation."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import satellites

from s2a.commands.cli import commands
from s2a.core import config

ROOT = Path(__file__).parents[2]
FOLDERS = ("s2a", "experiments", "tools")
WORDS = {
    "anew": "again",
    "aside": "atomic_write",
    "battery": "check suite",
    "bump": "collision",
    "carcass": "cabinet body",
    "certificate": "validation report",
    "chatter": "stdout filter",
    "clash": "collision, penetration depth",
    "complaint": "validation feedback",
    "confined": "sandbox",
    "crumb": "min_component_area",
    "draw": "render",
    "epochs": "num_learning_epochs",
    "feel": "contact forces",
    "feet": "stable pose, support polygon",
    "freest": "collision_free_path",
    "hollow": "concavity",
    "hollows": "concavities",
    "judge": "check, metrics",
    "largest": "max",
    "least": "min",
    "led": "grasped",
    "ledger": "usage log",
    "lens": "intrinsics",
    "longest": "max, max_tokens",
    "look": "camera pose",
    "looks": "visuals",
    "loose": "free object",
    "mechanisms": "layers",
    "mend": "fix",
    "mended": "corrected",
    "midway": "uncounted",
    "openings": "swept volumes",
    "palm": "gripper body",
    "picture": "image",
    "pictures": "images",
    "refusal": "policy violation",
    "rehearse": "preload",
    "restarts": "ik_seeds",
    "share": "fraction",
    "shares": "fractions",
    "shell": "structure",
    "skeleton": "geometry-free stage",
    "snap": "project_to_scan",
    "smallest": "min",
    "spot": "candidate",
    "spots": "candidates",
    "stance": "stable pose",
    "surroundings": "obstacles",
    "tally": "episode_stats",
    "thing": "object",
    "things": "objects",
    "told": "reported",
    "touch": "contact",
    "tries": "iterations, attempts",
    "troubles": "error flags",
    "verb": "command",
    "verbs": "commands",
    "walled": "rim",
    "way": "path, travel, displacement",
    "ways": "paths, directions",
    "wish": "placement hint",
}
"""Old word -> what the field says."""
PHRASES = (
    "no number",
    "belongs here",
    "anew",
    "mend ",
    "the verb",
    "a verb",
    "by the handle",
    "tears the",
    "the hand ",
)
"""Not in messages or help texts."""
PROSE = (
    "anew", "by the handle", "carcass", "certificate", "certificates", "clash", "convex pieces", "crumb", "feet", "freest",
    "ledger", "led opening", "mend", "mended", "no number", "picture", "pictures", "refusal", "rehearse", "stance", "tally",
    "the hand", "thing", "things", "told", "verb", "verbs", "wish",
)  # fmt: skip
"""Not in the documentation, code aside."""
DOCS = (
    "README.md",
    *(p.relative_to(ROOT).as_posix() for p in sorted((ROOT / "docs").rglob("*.md"))),
    "experiments/README.md",
)
ALLOWED: dict[str, tuple[tuple[str, ...], str]] = {
    "s2a/language/do/plan.py": (("refusal",), "a field of the model's answers, which are recorded word for word"),
    "s2a/language/insert/plan.py": (("longest",), "a field of the model's answers, which are recorded word for word"),
    "s2a/language/grammar.py": (("wish",), "the command line's own word: wish=prefer"),
    "s2a/language/insert/pipeline.py": (("wish",), "the command line's own word: wish=prefer"),
    "s2a/language/insert/settings.py": (("wish",), "the command line's own word: wish=prefer"),
    "s2a/language/insert/wish_check.py": (("wish",), "the command line's own word: wish=prefer"),
    "s2a/language/insert/wish.py": (("wish",), "the command line's own word: wish=prefer"),
    "s2a/language/insert/rules.py": (("longest",), "as in s2a/language/insert/plan.py"),
    "s2a/core/bounds.py": (("least",), "AtLeast(4) reads as the bound it is"),
    "s2a/core/check.py": (("least",), "at_least(...) and at_most(...) read as the bounds they are"),
    "s2a/learn/rl/config.py": (("epochs",), "num_learning_epochs, rsl_rl's own name"),
    "s2a/homes/solids.py": (("draw",), "random draws"),
    "s2a/homes/fittings.py": (("openings",), "doors and windows of a room"),
    "s2a/homes/objects.py": (("picture",), "a framed one, which hangs on a wall"),
    "s2a/tasks/open_part.py": (("openings",), "task.bonus_openings: displacements of the grasp point"),
}
"""Files with old words that stay, and why."""
ALLOWED_KEYS = ("ppo.num_learning_epochs", "task.bonus_openings", "skills.open.task.bonus_openings", "wish")
"""Keys with old words that stay, as the files above say."""


def _sources() -> list[Path]:
    return [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py"))]


def _words(name: str) -> list[str]:
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower().split("_")


def _public_names(tree: ast.Module) -> Iterator[str]:
    """Yield the names of public functions with their arguments, classes with their members, and module constants."""
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and not node.name.startswith("_"):
            yield node.name
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            yield from (argument.arg for argument in (*node.args.args, *node.args.kwonlyargs))
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield from (
                m.target.id for m in node.body if isinstance(m, ast.AnnAssign) and isinstance(m.target, ast.Name)
            )
    for node in tree.body:
        if isinstance(node, ast.Assign):
            yield from (target.id for target in node.targets if isinstance(target, ast.Name))


def _messages(tree: ast.Module) -> Iterator[str]:
    """Yield the texts of exceptions and of docstrings that become help texts."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise):
            yield from (n.value for n in ast.walk(node) if isinstance(n, ast.Constant) and isinstance(n.value, str))
        if isinstance(node, ast.ClassDef):
            yield ast.get_docstring(node) or ""


@pytest.mark.parametrize("path", _sources(), ids=lambda path: path.relative_to(ROOT).as_posix())
def test_public_names_and_messages_are_in_the_fields_words(path: Path) -> None:
    tree = ast.parse(path.read_text())
    banned = set(WORDS).difference(ALLOWED.get(path.relative_to(ROOT).as_posix(), ((), ""))[0])
    found = {f"{name}: {WORDS[word]}" for name in _public_names(tree) for word in _words(name) if word in banned}
    found |= {word for word in _words(path.stem) if word in banned}
    found |= {phrase for text in _messages(tree) for phrase in PHRASES if phrase in text}
    assert sorted(found) == []


@pytest.mark.parametrize("command", commands())
def test_configuration_keys_are_in_the_fields_words(command: str) -> None:
    keys = set(config.keys(config.compose(command))).difference(ALLOWED_KEYS)
    assert [(key, word) for key in keys for word in re.split(r"[._]", key) if word in WORDS] == []


def test_help_asks_no_whether() -> None:
    found = [path.name for path in _sources() if re.search(r"^ {8}\w+: [Ww]hether ", path.read_text(), re.MULTILINE)]
    assert found == []


@pytest.mark.parametrize("name", DOCS)
def test_the_documentation_is_in_the_fields_words(name: str) -> None:
    prose = re.sub(r"```.*?```|`[^`]*`|\]\([^)]*\)", "", (ROOT / name).read_text(), flags=re.DOTALL).lower()
    assert [word for word in PROSE if re.search(rf"\b{word}\b", prose)] == []


@pytest.mark.skipif(bool(satellites.MISSING), reason="needs all satellites")
def test_everything_that_is_excused_exists() -> None:
    assert [name for name in ALLOWED if not (ROOT / name).exists()] == []
    known = {key for command in commands() for key in config.keys(config.compose(command))}
    assert set(ALLOWED_KEYS) <= known


def test_no_two_modules_define_a_public_class_of_the_same_name() -> None:
    found: dict[str, list[str]] = {}
    for path in sorted((ROOT / "s2a").rglob("*.py")):
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_") and node.name != "Config":
                found.setdefault(node.name, []).append(path.relative_to(ROOT).as_posix())
    assert {name: paths for name, paths in found.items() if len(paths) > 1} == {}
