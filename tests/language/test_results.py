"""What a script's process says and hands back: none of it is believed, and none of it brings the program down."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from few import few
from hostile_scripts import GOOD
from mutations import mutated_bytes
from placed_mug import CONFIG, UPRIGHT, saved, write_stage
from pxr import Sdf

from s2a.language.insert.batch import geometry_free_text
from s2a.language.insert.prompts import run_sandboxed
from s2a.language.sandbox.diff import compare
from s2a.language.sandbox.jail import Sandbox
from s2a.language.sandbox.operations import PolicyViolation

WORDS = """\
( ) { } [ ] < > @ " ' = : , # /* */ \n " " \\ 1 -1 1e400 nan inf -0 None true
def over class Xform Mesh "" mug_8 wall_1 scene rel custom uniform prepend delete append reorder add variantSet variants
references payload inherits specializes apiSchemas kind active instanceable hidden customData customLayerData
dictionary double double3 float float3 half3 quatd quatf int int[] bool string string[] token token[] asset
matrix4d double3[] timecode pathExpression opaque group rel color3f
xformOp:translate xformOp:orient xformOp:scale xformOp:transform xformOp:rotateX xformOp:rotateXYZ xformOpOrder
semantics:labels:class s2a:partId s2a:label .timeSamples .connect .spline !resetXformStack! !invert! coffee mug
(1,2,3) (1,2,3,4) [1,2] ["a"] {1:2} <../a> @a.usd@ "\\x1b[2J" """
SNIPPETS = tuple(word.encode() for word in WORDS.split(" ") if word)
"""Pieces of USD's text."""


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_stage(tmp_path_factory.mktemp("stage"))


@pytest.fixture(scope="module")
def good(stage: Path) -> bytes:
    return saved(stage)


PRINTS = {
    "flush": "print('added', prim.GetPath(), flush=True)",
    "more than a buffer": "for i in range(90):\n    print('prim', i, 'is at', prim.GetPath(), '-------------------', stage)",
    "USD text": "for i in range(90):\n    print('#usda 1.0\\ndef \"a\" {', flush=True)",
    "brackets in a comment": "a = '{ # }'\nfor i in range(15):\n    a = a + a\nprint('#usda 1.0')\nprint(a, flush=True)",
}


@pytest.mark.parametrize("name", few(PRINTS, 1))
def test_what_a_script_prints_has_no_effect(name: str, stage: Path) -> None:
    with Sandbox(geometry_free_text(stage), CONFIG, False) as sandbox:
        plain = run_sandboxed(sandbox, GOOD, UPRIGHT)
        printing = run_sandboxed(sandbox, GOOD + PRINTS[name], UPRIGHT)
    assert plain.layer.ExportToString() == printing.layer.ExportToString()


HEADER = b"#usda 1.0\n"
CRASHES = {
    "path expression": HEADER + b'def "a" { pathExpression e = "' + b"(" * 200_000 + b'" \n}\n',
    "prims, closers in comments": HEADER + b'def "a" { # }\n' * 33_000,
    "prims, closers in texts": HEADER + b'def "a" { string s = "}"\n' * 33_000,
    "dictionaries": HEADER + b"(customLayerData = {" + b"dictionary a = { # }\n" * 33_000,
    "variant sets": HEADER + b'def "a" (variantSets="v") { variantSet "v" = { "x" { # }}}\n' * 20_000,
    "targets": HEADER + b'def "a" { rel r = </a.b' + b"[/a.b" * 100_000 + b"]" * 100_000 + b">\n}\n",
}


@pytest.mark.parametrize("name", few(CRASHES, 3))
def test_a_stage_that_crashes_its_reader_is_refused(name: str, stage: Path) -> None:
    with Sandbox(geometry_free_text(stage), CONFIG, False) as sandbox:
        with pytest.raises(PolicyViolation, match=r"\(comparison\).*not USD text"):
            sandbox.compare(CRASHES[name], UPRIGHT)


@pytest.mark.slow
def test_a_crash_goes_back_to_the_model_and_the_next_script_is_run(stage: Path) -> None:
    crashing = (
        "open('scene.usda', 'wb').write(b'#usda 1.0\\ndef \"a\" { pathExpression e = \"' + b'(' * 200000 + b'\"}')"
    )
    with Sandbox(geometry_free_text(stage), CONFIG, False) as sandbox:
        with pytest.raises(PolicyViolation, match=r"its reader ended with -11"):
            sandbox.compare(sandbox.run(crashing, {}).saved, UPRIGHT)
        assert run_sandboxed(sandbox, GOOD, UPRIGHT).layer.GetPrimAtPath("/scene/mug_8")


ATTRIBUTES = [
    ("xformOp:translate", "quatd", "(1, 0, 0, 0)"),
    ("xformOp:translate", "double", "1"),
    ("xformOp:translate", "double3[]", "[(1, 2, 3)]"),
    ("xformOp:transform", "double", "1"),
    ("xformOp:orient", "double3", "(1, 0, 0)"),
    ("xformOp:rotateZZZ", "double3", "(1, 0, 0)"),
    ("xformOp:rotateX", "float3", "(1, 0, 0)"),
    ("xformOp:scale", "token", '"a"'),
    ("semantics:labels:class", "int", "1"),
    ("semantics:labels:class", "bool", "true"),
    ("semantics:labels:class", "string", '"coffee mug"'),
    ("semantics:labels:class", "token[]", '["coffee mug", "coffee mug"]'),
    ("semantics:labels:class", "token[]", "None"),
    ("xformOpOrder", "double", "1"),
    ("xformOpOrder", "int[]", "[1]"),
    ("xformOpOrder", "matrix4d", "((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))"),
    ("xformOpOrder", "token[]", '["xformOp:\\x1b[2J\\x07"]'),
    ("s2a:label", "int", "1"),
    ("s2a:label", "string[]", '["coffee mug"]'),
    ("s2a:partId", "asset", "@mug_8@"),
    ("s2a:partId", "dictionary", "{}"),
]


@pytest.mark.parametrize(("name", "kind", "value"), ATTRIBUTES)
def test_an_attribute_of_another_type_is_a_violation_in_one_printable_line(
    name: str, kind: str, value: str, stage: Path, good: bytes
) -> None:
    lines = [line for line in good.decode().splitlines() if f" {name} " not in line]
    place = max(number for number, line in enumerate(lines) if "xformOp" in line or "s2a:" in line)
    text = "\n".join([*lines[: place + 1], f"        {kind} {name} = {value}", *lines[place + 1 :]]) + "\n"
    with pytest.raises(PolicyViolation) as refused:
        compare(text.encode(), geometry_free_text(stage), UPRIGHT)
    assert str(refused.value).isprintable()


def fuzz(stage: Path, good: bytes, count: int, seed: int) -> tuple[int, int]:
    """Compare mutated stages; return how many were refused, and how many accepted because nothing of them was changed."""
    given, dice, refused = geometry_free_text(stage), random.Random(seed), 0
    plain = compare(good, given, UPRIGHT).ExportToString()
    for number in range(count):
        text = mutated_bytes(good, SNIPPETS, dice)
        try:
            layer = compare(text, given, UPRIGHT)
        except PolicyViolation as violation:
            refused += 1
            assert str(violation).isprintable() and len(str(violation)) < 1500, number
        else:
            assert sorted(harmless(layer)) == sorted(harmless(plain)), (number, text)
    return refused, count - refused


def harmless(layer: Sdf.Layer | str) -> list[str]:
    """Return the lines of a layer with what may differ without consequence taken out."""
    text = layer if isinstance(layer, str) else layer.ExportToString()
    drop = ("kind", "custom ", "uniform ", "append ", "prepend ", "add ")
    lines = [line.strip() for line in text.splitlines() if "kind = " not in line]
    for word in drop:
        lines = [line.replace(word, "") for line in lines]
    return [line for line in lines if line not in ("", "(", ")")]


def test_a_mutated_stage_is_a_violation_or_says_what_was_planned(stage: Path, good: bytes) -> None:
    assert fuzz(stage, good, 300, 0)[0] > 200


@pytest.mark.slow
def test_of_5000_mutated_stages_each_is_a_violation_or_says_what_was_planned(stage: Path, good: bytes) -> None:
    refused, accepted = fuzz(stage, good, 5000, 1)
    print(f"refused {refused}, accepted {accepted}")
