"""Videos of worlds: a success and a failure, of their length, in which what moved is seen to move; small enough for a page."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cabinet import free_cube, write_cabinet

av = pytest.importorskip("av", reason="av is not installed")

from s2a import robot  # noqa: E402
from s2a.commands import cli  # noqa: E402
from s2a.core.errors import InputError  # noqa: E402
from s2a.scene.usd.stamp import layer_hash  # noqa: E402
from s2a.view import film, states  # noqa: E402
from s2a.view.states import States  # noqa: E402

START = np.array(robot.load("panda").start)
BASE = np.array([1.1, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0])
RATE, FRAMES = 10.0, 16


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    return write_cabinet(tmp_path / "sim.usd", free=[free_cube("cube_9", (0.0, 0.0, 0.852), 0.1, 0.2)])


@pytest.fixture
def seen(stage: Path) -> States:
    """Return three worlds: the second alone succeeded; in the first nothing moves, in the others the drawer opens."""
    still, opened = np.zeros(FRAMES), np.linspace(0.0, 0.35, FRAMES)
    cube = np.tile([0.0, 0.0, 0.852, 0.0, 0.0, 0.0, 1.0], (FRAMES, 1))
    return States(
        RATE,
        "panda",
        BASE,
        layer_hash(stage),
        ["world 0", "world 1", "world 2"],
        [np.tile(START, (FRAMES, 1))] * 3,
        {"drawer_2": [still, opened, opened]},
        {"cube_9": [cube] * 3},
        [False, True, False],
    )


def write(seen: States, tmp_path: Path) -> Path:
    states.write(seen, tmp_path / "states.npz")
    return tmp_path / "states.npz"


def decoded(data: bytes) -> tuple[float, np.ndarray]:
    """Return the duration of a video [s], and its images [frame row column 3]."""
    with av.open(io.BytesIO(data)) as file:
        return file.duration / av.time_base, np.stack([f.to_ndarray(format="rgb24") for f in file.decode(video=0)])


@pytest.mark.slow
def test_a_success_and_a_failure_become_videos_in_which_the_drawer_moves_or_not(
    seen: States, stage: Path, tmp_path: Path
) -> None:
    found = film.films(write(seen, tmp_path), stage)
    assert [each.caption.partition(",")[0] for each in found] == ["world 1: success", "world 0: failure"]
    assert "drawer_2 350 mm at the end" in found[0].caption and "drawer_2 0 mm" in found[1].caption
    differences = []
    for each in found:
        duration, images = decoded(each.data)
        assert len(each.data) < film.MAX_BYTES
        assert duration == pytest.approx(FRAMES / RATE + film.HELD, abs=2 / film.RATE)
        assert images.shape[1:] == (film.CAMERA.height, film.CAMERA.width, 3)
        assert (images[0] < 235).any(axis=-1).mean() > 0.03  # not empty
        differences.append((np.abs(images[-1].astype(int) - images[0]).max(axis=-1) > 30).mean())
    assert differences[0] > 0.01 > 10 * differences[1]


@pytest.mark.slow
def test_one_video_where_there_is_no_other_outcome_and_a_long_one_is_faster(
    seen: States, stage: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(film, "SECONDS", 0.8)
    (only,) = film.films(write(replace(seen, success=None), tmp_path), stage)
    assert only.caption.startswith("world 0: outcome not kept") and "2.0 times as fast" in only.caption
    assert decoded(only.data)[0] == pytest.approx(0.8 + film.HELD, abs=2 / film.RATE)
    assert len(film.films(write(replace(seen, success=[True] * 3), tmp_path), stage)) == 1


@pytest.mark.parametrize("rate", [10.0, 60.0, 62.5])
def test_the_images_of_a_video_are_frames_in_their_order_up_to_the_last(rate: float) -> None:
    for frames in (1, 2, 7, 359, 360, 361, 1499, 1500):
        speed, chosen = film.timed(frames, rate)
        assert chosen[0] == 0 and chosen[-1] == frames - 1 and (np.diff(chosen) >= 0).all()
        lasting = (len(chosen) - round(film.HELD * film.RATE)) / film.RATE
        assert lasting <= film.SECONDS + 1 / film.RATE and abs(speed * lasting - frames / rate) <= speed / film.RATE


def test_noise_is_compressed_until_it_is_small_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    noise = list(np.random.default_rng(0).integers(0, 256, (4, 64, 64, 3), dtype=np.uint8))
    fine = film.encoded(noise, 8)
    monkeypatch.setattr(film, "MAX_BYTES", len(fine) // 2)
    assert len(film.encoded(noise, 8)) <= len(fine) // 2


def test_success_comes_back_from_its_file(seen: States, tmp_path: Path) -> None:
    assert states.read(write(seen, tmp_path)).success == [False, True, False]
    assert states.read(write(replace(seen, success=None), tmp_path)).success is None


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"frames": np.array([1, 2])}, "3 worlds, and frames of 2"),
        ({"frames": np.array([FRAMES, FRAMES, 2])}, "frames of"),
        ({"joints": np.full((3 * FRAMES, 9), np.nan)}, "not finite"),
        ({"joints": np.zeros((3 * FRAMES, 4))}, "4 joints"),
        ({"rate": np.array(0.0)}, "no rate"),
        ({"base": np.zeros(3)}, "no pose of a base"),
        ({"part.nothing_1": np.zeros(3 * FRAMES)}, "no part 'nothing_1'"),
        ({"sha256": np.array("other")}, "not the room"),
    ],
)
def test_damaged_states_are_one_line(
    changes: dict[str, np.ndarray], problem: str, seen: States, stage: Path, tmp_path: Path
) -> None:
    with np.load(write(seen, tmp_path)) as file:
        content = dict(file)
    np.savez(tmp_path / "damaged.npz", **{**content, **changes})
    with pytest.raises(InputError, match=problem):
        film.films(tmp_path / "damaged.npz", stage)


@pytest.mark.parametrize("keys", [("states=s.npz",), ("stage=room.usd",), ("states=none.npz", "stage=none.usd")])
def test_a_missing_key_or_file_is_one_line(
    keys: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    result = Path(__file__).parents[2] / "experiments/results/many_parts_cpu.json"
    assert cli.main(["report", f"path={result}", f"out={tmp_path}/out.html", *keys]) == 2
    said = capsys.readouterr().err.strip()
    assert "give" in said and len(said.splitlines()) == 1 and not (tmp_path / "out.html").exists()
