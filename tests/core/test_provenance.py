"""Where numbers came from."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from s2a.core import provenance


def test_a_checkout_around_an_installed_copy_is_not_taken_for_ours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def git(*arguments: str) -> str:
        user = ["-c", "user.name=a", "-c", "user.email=a@b"]
        command = ["git", "-C", str(tmp_path), *user, *arguments]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()

    copy = tmp_path / "provenance.py"
    copy.write_text("")
    git("init", "-q")
    git("commit", "-q", "--allow-empty", "-m", "Start")
    monkeypatch.setattr(provenance, "__file__", str(copy))
    monkeypatch.delenv("S2A_COMMIT", raising=False)
    assert provenance.provenance("cpu")["commit"] is None
    monkeypatch.setenv("S2A_COMMIT", "abc1234")
    assert provenance.provenance("cpu")["commit"] == "abc1234"
    git("add", copy.name)
    git("commit", "-q", "-m", "Add")
    assert provenance.provenance("cpu")["commit"] == git("rev-parse", "--short", "HEAD")
    copy.write_text("changed")
    assert provenance.provenance("cpu")["commit"] == git("rev-parse", "--short", "HEAD") + "+"
