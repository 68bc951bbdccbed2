"""Progress and the prints of libraries."""

from __future__ import annotations

import threading
import time
from contextlib import redirect_stdout

import pytest

from s2a.core import progress
from s2a.core.progress import StdoutFilter, track


def test_tracking_changes_neither_the_items_nor_what_is_printed(capsys: pytest.CaptureFixture[str]):
    assert list(track((n * n for n in range(4)), "square", total=4)) == [0, 1, 4, 9]
    assert capsys.readouterr() == ("", "")


def test_a_log_has_lines_with_the_remaining_time(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "LINE_EVERY", 0.05)
    for _ in track(range(1), "a long first item"):
        time.sleep(0.2)
    assert capsys.readouterr() == ("", "a long first item: 0 of 1\n")
    monkeypatch.setattr(progress, "LINE_EVERY", 0.0)
    monkeypatch.setattr(threading.Timer, "start", lambda timer: None)
    assert list(track(range(3), "certify")) == [0, 1, 2]
    assert list(track(iter("ab"), "scan")) == ["a", "b"]
    lines = ["certify: 1 of 3, 0:00:00 left", "certify: 2 of 3, 0:00:00 left", "scan: 1"]
    assert capsys.readouterr() == ("", "\n".join(lines) + "\n")


def test_of_what_libraries_print_only_compiling_is_told_and_only_once(capsys: pytest.CaptureFixture[str]):
    with redirect_stdout(StdoutFilter()):
        print("Warp 1.19.0 initialized")
        print("Module a 1f load on device 'cpu' took 0.1 ms  (cached)")
        print("Module b 2f load on device 'cpu' took 900 ms  (compiled)")
        print("Module c 3f load on device 'cpu' took 900 ms  (compiled)")
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("compiling kernels") == 1
