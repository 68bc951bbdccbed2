"""Recordings out of LeRobot datasets: small ones, written here in the layout of v3.0."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from cabinet import write_cabinet

from s2a import robot
from s2a.commands import cli
from s2a.core.errors import InputError
from s2a.joints.pull import header, read, read_recordings

FPS = 50
SCALARS = {name: {"dtype": "int64", "shape": [1], "names": None} for name in ("frame_index", "episode_index", "index")}
SCALARS["timestamp"] = {"dtype": "float32", "shape": [1], "names": None}
HAND = {"observation.state": ["opening.pos", "force"]}
PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"


def write(root: Path, features: dict[str, list[str]], files: list[list[dict[str, np.ndarray]]]) -> Path:
    """Write a dataset: episodes by file, each with its features [frame number], and an action that is none of them."""
    about = {name: {"dtype": "float32", "shape": [len(names)], "names": names} for name, names in features.items()}
    about["action"] = about["observation.state"]
    info = {"codebase_version": "v3.0", "fps": FPS, "data_path": PATH, "features": {**about, **SCALARS}}
    episodes: dict[str, list[int]] = {"episode_index": [], "data/chunk_index": [], "data/file_index": []}
    for file, held in enumerate(files):
        tables = []
        for frames in held:
            number, count = len(episodes["episode_index"]), len(frames["observation.state"])
            columns = {name: pa.array(list(np.float32(values))) for name, values in frames.items()}
            columns["action"] = pa.array(list(np.full_like(frames["observation.state"], 9.0, np.float32)))
            columns["timestamp"] = pa.array((np.arange(count) / FPS).astype(np.float32))
            columns |= {"frame_index": pa.array(range(count)), "episode_index": pa.array([number] * count)}
            tables.append(pa.table(columns))
            for name, value in zip(episodes, (number, 0, file), strict=True):
                episodes[name].append(value)
        path = root / PATH.format(chunk_index=0, file_index=file)
        path.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(pa.concat_tables(tables), path)
    folder = root / "meta/episodes/chunk-000"
    folder.mkdir(parents=True)
    pq.write_table(pa.table(episodes), folder / "file-000.parquet")
    (root / "meta/info.json").write_text(json.dumps(info))
    return root


def episode(opening: float, count: int = 20) -> dict[str, np.ndarray]:
    """Return a pull to an opening [m] with a force of ten times as much."""
    s = np.linspace(0.0, opening, count)
    return {"observation.state": np.column_stack([s, 10.0 * s])}


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    return write(tmp_path / "set", HAND, [[episode(0.1), episode(0.2, 30)], [episode(0.3)]])


def test_each_episode_is_a_recording_whichever_file_has_it(dataset: Path) -> None:
    pulls = read(dataset)
    assert [pull.opening[-1] for pull in pulls] == pytest.approx([0.1, 0.2, 0.3])
    assert [pull.force[-1] for pull in pulls] == pytest.approx([1.0, 2.0, 3.0])
    assert [len(pull.opening) for pull in pulls] == [20, 30, 20]
    assert [pull.step for pull in pulls] == pytest.approx([0.02] * 3, rel=1e-5)


def test_episodes_are_chosen_by_number(dataset: Path) -> None:
    assert [pull.opening[-1] for pull in read(dataset, [2, 0])] == pytest.approx([0.3, 0.1])
    with pytest.raises(InputError, match="no episode 7; it has 0, 1, 2"):
        read(dataset, [7])


@pytest.mark.parametrize("names", [["opening", "force"], [None, None]])
def test_a_feature_of_one_number_has_it_without_a_list(dataset: Path, names: list[str | None]) -> None:
    info = json.loads((dataset / "meta/info.json").read_text())
    for file in (0, 1):
        path = dataset / PATH.format(chunk_index=0, file_index=file)
        table = pq.read_table(path)
        values = np.array(table["observation.state"].to_pylist(), np.float32)
        table = table.drop(["observation.state"])
        for k, one in enumerate(("observation.opening", "observation.force")):
            table = table.append_column(one, pa.array(values[:, k]))
            name = names[k] and [names[k]]
            info["features"][one] = {"dtype": "float32", "shape": [1], "names": name}
        pq.write_table(table, path)
    info["features"].pop("observation.state", None)
    (dataset / "meta/info.json").write_text(json.dumps(info))
    assert [pull.opening[-1] for pull in read(dataset)] == pytest.approx([0.1, 0.2, 0.3])
    assert read(dataset)[2].force[-1] == pytest.approx(3.0)


def test_frames_are_in_their_order(dataset: Path) -> None:
    file = dataset / PATH.format(chunk_index=0, file_index=0)
    table = pq.read_table(file)
    pq.write_table(table.take(np.random.default_rng(0).permutation(len(table))), file)
    assert (np.diff(read(dataset, [1])[0].opening) > 0.0).all()


@pytest.mark.parametrize("apart", [True, False])
def test_a_robots_joints_and_torques_are_columns(tmp_path: Path, apart: bool) -> None:
    spec = robot.load("panda")
    q, torque = np.arange(20 * 9).reshape(20, 9) * 0.01, -np.arange(20 * 7).reshape(20, 7) * 0.1
    if apart:
        features = {"observation.state": [f"{j}.pos" for j in spec.joints], "observation.effort": list(spec.arm_joints)}
        frames = {"observation.state": q, "observation.effort": torque}
    else:
        features = {"observation.state": [*(f"{j}_torque" for j in spec.arm_joints), *spec.joints]}
        frames = {"observation.state": np.hstack([torque, q])}
    root = write(tmp_path / "set", features, [[frames]])
    assert {*spec.recorded} <= {*header(root)}
    (found,) = read_recordings(root, spec)
    assert found.q == pytest.approx(q, rel=1e-6) and found.torque == pytest.approx(torque, rel=1e-6)


def test_what_is_none_or_lacks_something_is_refused(dataset: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no LeRobot dataset"):
        read(tmp_path)
    with pytest.raises(InputError, match="no 'panda_joint1' among the names of its features, time, opening, force"):
        read_recordings(dataset, robot.load("panda"))
    info = json.loads((dataset / "meta/info.json").read_text())
    (dataset / "meta/info.json").write_text(json.dumps(info | {"codebase_version": "v2.1"}))
    with pytest.raises(InputError, match="codebase_version v2.1; v3.0 is read"):
        read(dataset)
    (dataset / "meta/info.json").write_text(json.dumps(info))
    first, last = (dataset / PATH.format(chunk_index=0, file_index=file) for file in (0, 1))
    last.write_bytes(first.read_bytes())
    with pytest.raises(InputError, match="file-001.parquet: no frames of episode 2"):
        read(dataset)
    last.write_bytes(b"cut off")
    with pytest.raises(InputError, match="file-001.parquet: cannot be read"):
        read(dataset)


def test_a_dataset_of_too_few_frames_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root, stage = write(tmp_path / "set", HAND, [[episode(0.1, 5)]]), write_cabinet(tmp_path / "room.usda")
    assert cli.main(["identify", f"stage={stage}", f"pulls=[{root}]", f"out={tmp_path / 'a.usda'}"]) == 2
    error = capsys.readouterr().err
    assert "episode 0: 5 samples" in error and error.count("\n") == 1
