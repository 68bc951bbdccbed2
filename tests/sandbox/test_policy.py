"""What a script may say."""

from __future__ import annotations

import pytest
from harmless_scripts import scripts
from hostile_scripts import ALL, GOOD
from settings import load

from s2a.sandbox.jail import ConfinementConfig
from s2a.sandbox.policy import check
from s2a.sandbox.violation import Refusal

ALLOW = load(ConfinementConfig, "insert/confinement").allow
REFUSED = {name: hostile for name, hostile in ALL.items() if hostile.allowlist}


def look(text: str) -> None:
    check(text, "scene.usda", "objects/mug.usd", ALLOW)


@pytest.mark.parametrize("name", REFUSED)
def test_a_hostile_script_is_refused_for_what_is_wrong_with_it_and_in_which_line(name: str) -> None:
    with pytest.raises(Refusal) as refusal:
        look(GOOD + REFUSED[name].attack)
    assert any(part in refusal.value.reason for part in REFUSED[name].allowlist.split("|"))
    assert refusal.value.line is None or refusal.value.line > len(GOOD.splitlines())


@pytest.mark.parametrize("number", range(len(scripts())))
def test_a_harmless_script_is_allowed(number: int) -> None:
    look(scripts()[number])


def test_there_are_enough_of_both() -> None:
    assert len(REFUSED) >= 80 and len(set(scripts())) >= 40


def test_a_file_that_follows_from_two_calls_must_be_right_in_both() -> None:
    opener = "from pxr import Usd\ndef o(p):\n    return Usd.Stage.Open(p)\no({!r})\no({!r})\n"
    look(opener.format("scene.usda", "./scene.usda"))
    with pytest.raises(Refusal, match="other.usda"):
        look(opener.format("scene.usda", "other.usda"))
