"""The files that robomimic reads, and how they grow."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from s2a.core.errors import InputError
from s2a.learn.collect.episodes import Episode, Features, read_replay
from s2a.learn.collect.robomimic import INDEX, Robomimic
from s2a.learn.collect.video import DeflatedImages

RANGE = np.array([[-1.0, 0.0], [3.0, 0.04]])
COLUMNS = {"observation.state": ("a", "b"), "action": ("joint", "finger")}
SIZE = (6, 4)


def features(**more: object) -> Features:
    values = {"robot": "panda", "fps": 20, "columns": COLUMNS, "cameras": ("wrist",), "size": SIZE,
              "action_range": RANGE, "world": {"sim": {}, "task": {"name": "open_part"}}}  # fmt: skip
    return Features(**{**values, **more})  # type: ignore[arg-type]


def pixels(length: int, kind: str) -> np.ndarray:
    """Return images that all differ."""
    shape = (length, 4, 6, 3) if kind == "image" else (length, 4, 6)
    return np.random.default_rng(length).integers(0, 2**8, shape).astype(np.uint8 if kind == "image" else np.uint16)


def episode(folder: Path, length: int) -> Episode:
    """Return an episode whose joints stand in the middle of their range, but for the last frame at its end."""
    images = {}
    for kind in Robomimic.FILES:
        file = DeflatedImages(folder / f"{length}_{kind}", *SIZE, 20)
        for image in pixels(length, kind):
            file.add(image)
        images["wrist", kind] = file.close()
    targets = np.tile(RANGE.mean(axis=0), (length, 1)).astype(np.float32)
    targets[-1] = RANGE[1]
    columns = {"observation.state": np.arange(2 * length, dtype=np.float32).reshape(length, 2), "action": targets}
    origin = {"seed": 5, "world": 1, "worlds": 8}
    start = {"joint_q": np.ones(9)}
    return Episode(columns, images, "open the drawer", {"success": 1.0}, origin, np.zeros((3 * length, 2)), start)


def filled(root: Path, folder: Path, count: int) -> Robomimic:
    dataset = Robomimic(root, features())
    for k in range(count):
        dataset.add(episode(folder, k + 2))
    return dataset


def test_a_demonstration_is_where_robomimic_looks_for_it(tmp_path: Path) -> None:
    assert filled(tmp_path / "set", tmp_path, 2).frames == 5
    with h5py.File(tmp_path / "set" / INDEX) as file:
        assert file["data"].attrs["total"] == 5 and set(file["data"]) == {"demo_0", "demo_1"}
        env = json.loads(file["data"].attrs["env_args"])
        assert env["env_name"] == "s2a/open_part" and env["type"] == 2 and "sim" in env["env_kwargs"]
        demo = file["data/demo_1"]
        assert demo.attrs["num_samples"] == 3 and demo.attrs["instruction"] == "open the drawer"
        np.testing.assert_allclose(demo["actions"], [[0, 0], [0, 0], [1, 1]], atol=1e-6)
        np.testing.assert_allclose(demo["joint_targets"][-1], RANGE[1])
        assert demo["rewards"][:].tolist() == [0, 0, 1] == demo["dones"][:].tolist()
        assert np.array_equal(demo["obs/wrist_image"], pixels(3, "image"))
        for name, kind in (("wrist_depth", "depth"), ("wrist_segmentation_instance", "instances")):
            assert np.array_equal(demo[f"obs/{name}"][..., 0], pixels(3, kind))
        for name in demo["obs"]:
            now, following = demo[f"obs/{name}"][:], demo[f"next_obs/{name}"][:]
            assert np.array_equal(following[:-1], now[1:]) and np.array_equal(following[-1], now[-1]), name
    start, actions = read_replay(tmp_path / "set", 1)
    assert np.array_equal(start["joint_q"], np.ones(9)) and actions.shape == (9, 2)


def test_every_tenth_demonstration_is_held_out(tmp_path: Path) -> None:
    filled(tmp_path / "set", tmp_path, 11)
    with h5py.File(tmp_path / "set" / INDEX) as file:
        assert file["mask/valid"][:].tolist() == [b"demo_9"]
        assert len(file["mask/train"]) == 10 and b"demo_9" not in file["mask/train"][:]


def test_a_dataset_is_gone_on_with_and_what_was_not_finished_is_written_again(tmp_path: Path) -> None:
    filled(tmp_path / "set", tmp_path, 1)
    known = (tmp_path / "set" / INDEX).read_bytes()
    filled(tmp_path / "set", tmp_path, 1)
    (tmp_path / "set" / INDEX).write_bytes(known)  # as if killed before the links
    again = Robomimic(tmp_path / "set", features())
    assert again.count == 1
    again.add(episode(tmp_path, 7))
    with h5py.File(tmp_path / "set" / INDEX) as file:
        assert [len(file[f"data/demo_{k}/actions"]) for k in range(2)] == [2, 7]


def test_folders_that_hold_something_else_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "set").mkdir()
    (tmp_path / "set/thesis.txt").write_text("mine")
    with pytest.raises(InputError, match="holds files that are no dataset of robomimic; choose another place"):
        Robomimic(tmp_path / "set", features())
    filled(tmp_path / "other", tmp_path, 1)
    with pytest.raises(InputError, match="holds a dataset of other features or another fps"):
        Robomimic(tmp_path / "other", features(fps=10))
    (tmp_path / "other" / INDEX).write_bytes(b"no HDF5")
    with pytest.raises(InputError, match=r"demos\.hdf5: not of a dataset"):
        Robomimic(tmp_path / "other", features())
