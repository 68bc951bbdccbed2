"""Constant folding: what it says an expression is, Python says too, or it says nothing."""

from __future__ import annotations

import ast
import itertools
import random
import time

import pytest
from harmless_scripts import scripts
from hostile_scripts import GOOD
from mutations import mutated_bytes
from settings import load

from s2a.language.sandbox.constants import Path, Values
from s2a.language.sandbox.jail import SandboxConfig
from s2a.language.sandbox.operations import PolicyViolation
from s2a.language.sandbox.policy import check

ALLOW = load(SandboxConfig, "insert/sandbox").allow


def look(text: str) -> None:
    check(text, "scene.usda", "objects/mug.usd", ALLOW)


UNPACKED = [
    "a, *b = 1, '/x.usda'\nx = b[0]",
    "a, *b = 1, '/x.usda'\nfor x in b:\n    pass",
    "*a, x = ['scene.usda', '/x.usda']",
    "a, *b, x = 'p', 'q', 'scene.usda', '/x.usda'",
    "x = 'scene.usda'\n*x, y = ['/x.usda', 'b']",
    "for a, *x in [('scene.usda', '/x.usda')]:\n    pass",
    "for *a, x in [('/x.usda', 'scene.usda', '/y.usda')]:\n    pass",
    "(a, *b), x = (1, 2), '/x.usda'",
    "[x for *a, x in [('scene.usda', '/x.usda')]]\nx = a",
    "x = str(['scene.usda'])",
    "x = '%s' % ['scene.usda']",
    "x = '%s' % [1, 2]",
    "x = '%s' % ('a',)",
    "x = str(('a',))",
    "x = [1] + [2]",
    "x = ['scene.usda'][0]",
    "y = 1\ny = True\nx = str(y)",
    "y = True\ny = 1\nx = ['a', '/x.usda'][y]",
    "y = 0.0\ny = -0.0\nx = str(y)",
    "y = 1\ny = 1.0\nx = str(y)",
    "y = (1, 2)\ny = [1, 2]\nx = str(y)",
    "y = {1: 'a'}\ny = {True: 'a'}\nx = str(y)",
    "x = [True, 1, 1.0]",
    "x = {1: 'a', True: 'b', 1.0: 'c'}[1]",
    "x = 'aXb'.lower() + 'q'.upper() + ' z '.strip()",
    "x = (5).lower()",
    "x = ','.join(['a', 'b'])",
    "x = ','.join('ab')",
    "x = 'ab'.replace('a', '_')",
    "x = str(Sdf.Reference('scene.usda'))",
    "x = '{}'.format(Sdf.Path('a//b'))",
    "x = '%s' % Sdf.Path('scene.usda')",
    "x = Sdf.Path('scene.usda') + 'x'",
    "x = f\"{Sdf.Reference('a')}\"",
    "x = f\"{[Sdf.Reference('a')]}\"",
    "x = -0x" + "f" * 4000,
    "x = " + "9" * 4000 + " * " + "9" * 4000,
    "x = 0x" + "f" * 4000 + " - 1",
    "x = 1e308 * 10 - 1e308 * 10",
    "y = 'a' if 1 else 'b'\nz = 'c' or 'd'\nx = y + z",
    "k = 0\nk = 1\nx = ('a', 'b')[k] + ('c', 'd')[k]",
    "def f(p, q='/y'):\n    return p + q\nx = f('a')\nx = f('b', q='c')",
    "x = [*['a', 'b']][0]",
    "x = '%d' % True",
    "x = '{:d}'.format(True)",
    "x = f'{True:d}' + f'{1.0}' + f'{-0.0}'",
    "x = 'a' 'b'\nx += '/x'",
    "x = '%c%c' % (95, 95)",
    "x = 7 / 2\nx = 7 - 2\nx = 7 % 4\nx = -7 % 4",
]


class _Sdf:
    """Stands for USD's classes: none of their objects is a text."""

    Reference = staticmethod(lambda text: ("object", text))
    Path = staticmethod(lambda text: ("object", text))


def run(text: str) -> list[object]:
    """Return the values that `x` has while a script runs."""
    tree, seen = ast.parse(text), []
    scope: dict[str, object] = {"Sdf": _Sdf, "seen": seen}

    body = []
    for statement in tree.body:
        if isinstance(statement, ast.For):
            statement.body.insert(0, ast.parse("seen.append(x)").body[0])
        body.append(statement)
        if isinstance(statement, (ast.Assign, ast.AugAssign)) and "x" in ast.dump(statement):
            body += ast.parse("if 'x' in globals(): seen.append(x)").body
    tree.body = body
    try:
        exec(compile(ast.fix_missing_locations(tree), "script", "exec"), scope)
    except Exception:  # it would fail there, too
        pass
    return seen


def folded(text: str) -> list[object] | None:
    """Return the values that `x` can have, as the policy thinks."""
    tree = ast.parse("from pxr import Sdf\n" + text)
    return Values(tree, {}).of(ast.Name("x"))


@pytest.mark.parametrize("text", UNPACKED)
def test_what_is_folded_is_what_python_has(text: str) -> None:
    try:
        known = folded(text)
    except PolicyViolation:
        return
    if known is None or any(isinstance(value, Path) for value in known):
        return
    kinds = [(type(value), repr(value)) for value in known]
    for value in run(text):
        assert (type(value), repr(value)) in kinds


TEXTS = (
    "'a'", "'_'", "'%s'", "s", "t", "'{{}}'", "str({n})", "str({l})", "f'{{{n}}}{{{t}}}'", "f'{{{l}}}'", "f'{{{n}:.2f}}'",
    "'%s' % ({n},)", "'%s %s' % ({t}, {n})", "'%s' % {l}", "'%s' % {n}", "'{{}}-{{}}'.format({t}, {n})", "({t} + {t})",
    "'{{}}'.format({l})", "{t}.join([{t}, {t}])", "{t}.lower()", "{t}.upper()", "{t}.replace({t}, {t})", "{t}.strip({t})",
    "({t} if {n} else {t})", "({t} or {t})", "[{t}, {t}][{i}]", "({t}, {n})[0]", "{{{n}: {t}}}[{n}]", "'abc'[{i}]",
)  # fmt: skip
NUMBERS = (
    "0", "1", "True", "False", "1.0", "0.0", "-0.0", "2", "i", "j", "({n} + {n})", "({n} - {n})", "({n} * {n})", "(-{n})",
    "[{n}, {n}][{i}]", "({n}, {t})[0]", "({n} or {n})", "({n} and {n})", "({n} if {n} else {n})", "({n} / 2)", "({n} % 3)",
)  # fmt: skip
LISTS = (
    "[{n}, {t}]",
    "({n}, {t})",
    "[{l}, {n}]",
    "({t},)",
    "l",
    "m",
    "({l} if {n} else {l})",
    "{{{t}: {n}}}",
    "[*{l}, {n}]",
)
INDICES = ("0", "1", "True", "False", "-1")
KINDS = {"t": TEXTS, "n": NUMBERS, "l": LISTS, "i": INDICES}
NAMES = {"s": "t", "t": "t", "i": "n", "j": "n", "l": "l", "m": "l"}
"""Names with the kind of what they stand for."""


def expression(kind: str, dice: random.Random, depth: int) -> str:
    """Return an expression that gives a text ("t"), a number ("n"), a list ("l") or an index ("i")."""
    forms = [form for form in KINDS[kind] if depth or "{" not in form]
    form = dice.choice(forms or ["[1, 'a']"])
    for _ in range(form.count("{t}") + form.count("{n}") + form.count("{l}") + form.count("{i}")):
        for inner in KINDS:
            form = form.replace(
                f"{{{inner}}}", expression(inner, dice, depth - 1).replace("{", "{{").replace("}", "}}"), 1
            )
    return form.replace("{{", "{").replace("}}", "}") if "{" in form else form


def program(dice: random.Random) -> str:
    """Return a script whose names have several values."""
    lines = ["s = 'p'", "t = 'Q'", "i = 1", "j = 0.0", "l = [1, 'z']", "m = ('y', True)"]
    for _ in range(dice.randint(1, 5)):
        name = dice.choice(list(NAMES))
        value = expression(NAMES[name], dice, 1)
        form = dice.choice(("{n} = {v}", "{n}, *l = [{v}, 1, 'c']", "*l, {n} = [1, 'c', {v}]", "for {n} in [{v}]:\n    pass",
                            "l, *m, {n} = [2], 'b', 'c', {v}", "for {n}, *m in [({v}, 'd', 1)]:\n    pass"))  # fmt: skip
        lines.append(form.replace("{n}", name).replace("{v}", value))
    return "\n".join([*lines, f"x = {expression(dice.choice('tnl'), dice, 3)}"])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_whatever_is_folded_is_what_python_has(seed: int) -> None:
    dice, known = random.Random(seed), 0
    for _ in range(1000):
        text = program(dice)
        try:
            compile(text, "script", "exec")
            values = folded(text)
        except (SyntaxError, PolicyViolation, RecursionError):
            continue
        found = run(text)
        if values is None or not found:
            continue
        known += 1
        assert (type(found[-1]), repr(found[-1])) in [(type(value), repr(value)) for value in values], text
    assert known > 200


HOLES = [
    "a, *b = 1, '/x.usda'\nUsd.Stage.Open(b[0])",
    "*a, b = ['scene.usda', '/x.usda']\nUsd.Stage.Open(b)",
    "for a, *b in [('scene.usda', '/x.usda')]:\n    Usd.Stage.Open(b[0])",
    "a, *b = 'p', 'q'\nprim.GetReferences().AddReference(b[0])",
    "a, *b = 'kind', 'active'\nprim.SetMetadata(b[0], False)",
    "a, *b, c = 'p', 'q', 'kind', 'active'\nprim.SetMetadata(c, False)",
    "x = str(['{0.', 'path}'])\ny = x[2] + x[1]\nz = y.format(prim)",
    "x = '%s' % ['{']\ny = (x[2] + '0' + '.path}').format(prim)",
    "a, *b = '', '{0.path}'\nx = b[0].format(prim)",
    "x = Tf.MakeValidIdentifier('a') * 1000000",
    "x = sum([[1]], []) * 1000000",
    "x = prim.GetName() * 1000",
    "def f():\n    return 'a'\nx = f() * 1000",
    "a, b = 'ab'\nc, *d = 'a', 'b'\nx = d * 1000000",
    "import os",
    "import math as Gf, os",
    "from math import factorial\nfactorial(100000)",
    "import math\nmath.factorial(100000)",
    "from typing import get_type_hints\nget_type_hints('x')",
    "from typing import List\nList('a')",
    "from typing import Any as Usd\nUsd.Stage.CreateNew('x')",
    "from math import pi as Usd\nUsd.Stage.CreateNew('x')",
    "import typing\ntyping.sys.modules",
    "import math\nmath.__loader__",
    "from __future__ import braces",
    "from __future__ import annotations as print\nprint",
]


@pytest.mark.parametrize("attack", HOLES)
def test_a_file_a_key_or_a_format_that_python_sees_otherwise_is_refused(attack: str) -> None:
    with pytest.raises(PolicyViolation):
        look(GOOD + attack + "\n")


def loops(depth: int, beside: int) -> str:
    lines = [f"{' ' * k}for a{k} in range(2):" for k in range(depth)] + [" " * depth + "pass"]
    return "\n".join([*lines, *(f"for b{k} in range(2):\n    pass" for k in range(beside))]) + "\n"


SLOW = {
    "loops in each other": loops(40, 200),
    "more of them": loops(50, 230),
    "comprehensions in each other": "x = " + "[" * 25 + "1" + " for a in range(2)]" * 25 + "\n",
    "loops beside each other": loops(3, 400),
    "replaced unions": "".join(f"a = '{'ab' * 90}{k}'\n" for k in range(60)) + "b = a.replace('a', a)\n" * 150,
    "sums of unions": "".join(f"a = 'x{k}'\n" for k in range(8)) + "".join(f"b{k} = a + a\n" for k in range(400)),
    "names of names": "a0 = 1\n" + "".join(f"a{k + 1} = a{k} * a{k} - a{k}\n" for k in range(50)),
    "functions of functions": "def f0(x):\n    return x * 2\n"
    + "".join(f"def f{k + 1}(x):\n    return f{k}(x) * f{k}(x) * f{k}(f{k}(x))\n" for k in range(18))
    + "y = f18(1) * 2\n",
    "many names": "".join(f"n{k} = {k}\n" for k in range(1500)),
    "a list of lists": "x = ["
    + ",".join(["[1, 2, 3]"] * 190)
    + "]\n"
    + "for a in x:\n    for b in a:\n        pass\n" * 100,
    "many attributes": "x = stage" + ".path" * 55 + "\n" + "y = x.name\n" * 1200,
    "many formats": "a = 1.0\na = 2.0\n" + "x = f'{a:.3f}{a:.4f}{a}'\n" * 500,
    "ifs": "".join(f"if a{k} == 1:\n    pass\n" for k in range(900)),
    "big numbers": "x = " + "9" * 4000 + "\n" + "y = x * x\n" * 1000,
    "dictionaries": "d = {"
    + ", ".join(f"'k{k}': {k}" for k in range(90))
    + "}\n"
    + "for k, v in d.items():\n    pass\n" * 400,
}


@pytest.mark.parametrize("name", SLOW)
def test_a_text_is_judged_in_three_seconds_of_cpu_time(name: str) -> None:
    start = time.process_time()
    try:
        look(SLOW[name][: ALLOW.max_length])
    except PolicyViolation:
        pass
    assert time.process_time() - start < 3.0


def fuzz(count: int, seed: int) -> int:
    """Return how many of the scripts with something odd in them are allowed; others are violations."""
    dice, allowed, every = random.Random(seed), 0, scripts()
    words = (
        b"( ) [ ] { } : , . * ** = == \n \\ ' \" ''' # @ for in if def return import from as with lambda yield await "
    )
    words += b"1 0x 1e999 9e99 True None f' {x} % + - * / // stage prim Gf Usd Sdf \x00 \xff \xef\xbb\xbf STAGE"
    snippets = tuple(word for word in words.split(b" ") if word)
    for number in range(count):
        text = mutated_bytes(every[number % len(every)].encode(), snippets, dice).decode(errors="surrogateescape")
        try:
            look(text)
            allowed += 1
        except PolicyViolation as violation:
            assert str(violation).isprintable()
    return allowed


def test_an_odd_script_is_allowed_or_a_violation() -> None:
    assert 0 < fuzz(200, 0) < 200


@pytest.mark.slow
def test_of_5000_odd_scripts_each_is_allowed_or_a_violation() -> None:
    print(f"scripts allowed: {fuzz(5000, 1)} of 5000")


def test_values_of_several_names_are_all_combined_or_none_is_known() -> None:
    names = "".join(f"a = 'x{k % 2}'\nb = 'y{k}'\n" for k in range(40))
    assert folded(names + "x = (b + a)[0] + a") is None
    small = "".join(f"a = {k}\nb = {k}\n" for k in range(8))
    known = folded(small + "x = a * 10 + b")
    assert known is not None and set(known) == {a * 10 + b for a, b in itertools.product(range(8), repeat=2)}
