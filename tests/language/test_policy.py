"""What a script may say."""

from __future__ import annotations

import pytest
from harmless_scripts import scripts
from hostile_scripts import ALL, GOOD
from settings import load

from s2a.language.sandbox.jail import SandboxConfig
from s2a.language.sandbox.operations import PolicyViolation
from s2a.language.sandbox.policy import check

ALLOW = load(SandboxConfig, "insert/sandbox").allow
REFUSED = {name: hostile for name, hostile in ALL.items() if hostile.allowlist}


def look(text: str) -> None:
    check(text, "scene.usda", "objects/mug.usd", ALLOW)


@pytest.mark.parametrize("name", REFUSED)
def test_a_hostile_script_is_refused_for_what_is_wrong_with_it_and_in_which_line(name: str) -> None:
    with pytest.raises(PolicyViolation) as violation:
        look(GOOD + REFUSED[name].attack)
    assert any(part in violation.value.reason for part in REFUSED[name].allowlist.split("|"))
    assert violation.value.line is None or violation.value.line > len(GOOD.splitlines())


@pytest.mark.parametrize("number", range(len(scripts())))
def test_a_harmless_script_is_allowed(number: int) -> None:
    look(scripts()[number])


def test_there_are_enough_of_both() -> None:
    assert len(REFUSED) >= 80 and len(set(scripts())) >= 40


def test_a_file_that_follows_from_two_calls_must_be_right_in_both() -> None:
    opener = "from pxr import Usd\ndef o(p):\n    return Usd.Stage.Open(p)\no({!r})\no({!r})\n"
    look(opener.format("scene.usda", "./scene.usda"))
    with pytest.raises(PolicyViolation, match="other.usda"):
        look(opener.format("scene.usda", "other.usda"))
