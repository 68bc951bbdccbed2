"""Answers as models write them: nearly all place the object, whatever a model writes around its script."""

from __future__ import annotations

from pathlib import Path

import pytest
from model_answers import answers
from placed_mug import CONFIG, PLAN, write_stage

from s2a.language.insert.batch import geometry_free_text
from s2a.language.insert.pipeline import bare
from s2a.language.insert.prompts import run_sandboxed
from s2a.language.sandbox.jail import Sandbox
from s2a.language.sandbox.operations import PolicyViolation
from s2a.language.sandbox.policy import check


def refused(names: list[str], stage: Path) -> dict[str, str]:
    """Return the answers that are refused, with the reasons."""
    found = {}
    with Sandbox(geometry_free_text(stage), CONFIG, False) as sandbox:
        for name in names:
            try:
                run_sandboxed(sandbox, bare(answers()[name]), PLAN)
            except PolicyViolation as violation:
                found[name] = str(violation)
    return found


def test_of_60_answers_57_or_more_pass_the_policy() -> None:
    reasons = {}
    for name, answer in answers().items():
        try:
            check(bare(answer), "scene.usda", PLAN.reference, CONFIG.allow)
        except PolicyViolation as violation:
            reasons[name] = str(violation)
    assert len(answers()) == 60 and len(set(answers().values())) == 60
    assert len(reasons) <= 3, reasons


@pytest.mark.slow
def test_answers_of_each_family_and_each_body_place_the_object(tmp_path: Path) -> None:
    names = list(answers())
    assert not refused([names[12 * (k % 5) + k] for k in range(12)], write_stage(tmp_path))


@pytest.mark.slow
def test_of_60_answers_57_or_more_place_the_object(tmp_path: Path) -> None:
    reasons = refused(list(answers()), write_stage(tmp_path))
    print(f"refused {len(reasons)} of 60: {reasons}")
    assert len(reasons) <= 3


@pytest.mark.parametrize(
    ("answer", "script"),
    [
        ("x = 1\n", "x = 1\n"),
        ("```\nx = 1\n```", "x = 1\n"),
        ("```python\nx = 1\n```\ntext\n```bash\nls\n```", "x = 1\n"),
        ("```python\nx = 1\n```\n```python\nx = 2\n```", "x = 2\n"),
        ("```bash\nls\n```\n~~~ python\nx = 1\n~~~", "x = 1\n"),
        ("````python\nx = '''\n```\n'''\n````", "x = '''\n```\n'''\n"),
        ("<think>```python\nx = 0\n```</think>x = 1", "x = 1"),
        ("hm...</think>\n```py\nx = 1\n```", "x = 1\n"),
        ("1. So:\n\n   ```python\n   if x:\n       y = 1\n   ```\n", "if x:\n    y = 1\n"),
        ("```python\nx = 1", "x = 1"),
        ("", ""),
        ("```", "```"),
    ],
)
def test_a_script_is_found_in_an_answer(answer: str, script: str) -> None:
    assert bare(answer) == script
