"""What is kept between runs of `prepare`."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest

from s2a.core import cache
from s2a.scene.scene import Mesh

TRIANGLE = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("S2A_CACHE", str(tmp_path / "kept"))
    return tmp_path / "kept"


class Maker:
    """Counts how often it had to work."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self) -> dict[str, np.ndarray]:
        self.calls += 1
        return cache.pack([TRIANGLE])


def test_the_same_surface_and_settings_are_worked_on_once() -> None:
    make = Maker()
    again = Mesh(TRIANGLE.vertices.copy(), TRIANGLE.faces.copy())
    first, second = (cache.recall("test", [mesh, "0.1"], make) for mesh in (TRIANGLE, again))
    assert make.calls == 1
    assert cache.unpack(first) == cache.unpack(second) == [TRIANGLE]


@pytest.mark.parametrize(
    "other",
    [
        [TRIANGLE, "0.2"],
        [Mesh(TRIANGLE.vertices + np.float32(1e-6), TRIANGLE.faces), "0.1"],
        [Mesh(TRIANGLE.vertices, TRIANGLE.faces[:, ::-1]), "0.1"],
        [Mesh(TRIANGLE.vertices, TRIANGLE.faces, np.zeros((3, 3))), "0.1"],
        ["0.1", TRIANGLE],
    ],
)
def test_anything_else_is_something_else(other: list) -> None:
    assert cache.key(other) != cache.key([TRIANGLE, "0.1"])


def test_other_code_gives_other_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for folder in ("prepare", "geometry"):
        (tmp_path / folder).mkdir()
    monkeypatch.setattr(cache, "__file__", str(tmp_path / "cache.py"))
    found = []
    for text in ("one", "two"):
        (tmp_path / "geometry" / "convex.py").write_text(text)
        found += [cache._code.__wrapped__() for _ in range(2)]
    assert found[0] == found[1] != found[2] == found[3]


@pytest.mark.parametrize("damage", [b"", b"no archive", None])
def test_a_damaged_entry_is_made_anew(damage: bytes | None, place: Path) -> None:
    make = Maker()
    cache.recall("test", [TRIANGLE], make)
    (entry,) = (place / "test").iterdir()
    entry.write_bytes(entry.read_bytes()[:-40] if damage is None else damage)
    assert cache.unpack(cache.recall("test", [TRIANGLE], make)) == [TRIANGLE]
    assert make.calls == 2
    cache.recall("test", [TRIANGLE], make)
    assert make.calls == 2


def test_a_cache_that_cannot_be_written_costs_time_only(place: Path) -> None:
    place.write_text("a file where the folder should be")
    assert cache.unpack(cache.recall("test", [TRIANGLE], Maker())) == [TRIANGLE]


def test_many_writers_of_one_entry_leave_one_whole_entry(place: Path) -> None:
    barrier = threading.Barrier(8)

    def make() -> dict[str, np.ndarray]:
        barrier.wait(10)
        return cache.pack([TRIANGLE])

    threads = [threading.Thread(target=cache.recall, args=("test", [TRIANGLE], make)) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    (entry,) = (place / "test").iterdir()
    with np.load(entry) as arrays:
        assert cache.unpack(arrays) == [TRIANGLE]
