"""Recordings of how a part was pulled: its opening and the force on it, measured by a hand's sensor or by the robot's joints."""

import json
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from scipy.signal import savgol_filter
from scipy.spatial.transform import Rotation

from s2a.core.bounds import Positive
from s2a.core.errors import InputError
from s2a.joints.pulled import Moving
from s2a.robot import urdf
from s2a.robot.kinematics import kinematics
from s2a.robot.spec import RobotSpec
from s2a.scene.articulation import displace
from s2a.scene.usd.sim_stage import GRAVITY

VERSION = "v3."
# Features of this name are what was measured; `action`, which has the same joints, is what was commanded
OBSERVED = "observation."
# Endings of names by which datasets tell a joint's position from its torque, and what `s2a identify` has in their place
SUFFIXES = {".pos": "", ".torque": "_torque", ".effort": "_torque"}
# Last words of features whose names are joints, and whose numbers their torques
TORQUES = ("effort", "efforts", "torque", "torques")
CHOICE = "data/chunk_index", "data/file_index"  # Columns of `meta/episodes`: the file of an episode's frames
Column = tuple[str, int | None]  # A feature, and which of its numbers; None: it is one


def lerobot_tables(root: Path, columns: Sequence[str], episodes: Sequence[int]) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the frames of episodes of a dataset: what to call the episode, and its columns, shape [frame column].

    Args:
        root: folder of the dataset.
        columns: names; the first is `time`.
        episodes: their numbers; none: all.

    Raises:
        InputError: no dataset, another version; a column or an episode is missing; a file that cannot be read.
    """
    info = _info(root)
    available = _columns(info)
    missing = [name for name in columns if name not in available]
    if missing:
        raise InputError(
            f"{root}: no {missing[0]!r} among the names of its features, {', '.join(available)}; it needs {', '.join(columns)}"
        )
    chosen = [available[name] for name in columns]
    files = _files(root, info)
    unknown = [episode for episode in episodes if episode not in files]
    if unknown:
        raise InputError(f"{root}: no episode {unknown[0]}; it has {', '.join(map(str, sorted(files)))}")
    features = sorted({feature for feature, _ in chosen})
    for episode in episodes or sorted(files):
        yield f"{root}, episode {episode}", _frames(files[episode], episode, features, chosen)


def _info(root: Path) -> dict[str, Any]:
    path = root / "meta/info.json"
    try:
        info = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise InputError(
            f"{root}: no LeRobot dataset, {path.name} cannot be read ({error}); give a CSV file or a dataset's folder"
        ) from error
    version = str(info.get("codebase_version")) if isinstance(info, dict) else "none"
    if not version.startswith(VERSION) or not {"features", "data_path"} <= {*info}:
        raise InputError(
            f"{path}: codebase_version {version}; v3.0 is read: convert it with LeRobot's convert_dataset_v21_to_v30"
        )
    return info


def _columns(info: dict[str, Any]) -> dict[str, Column]:
    """Return where each named number is; of two with one name the first."""
    columns: dict[str, Column] = {"time": ("timestamp", None)}
    for feature, about in info["features"].items():
        if not feature.startswith(OBSERVED) or not str(about.get("dtype")).startswith("float"):
            continue
        given, short = about.get("names"), feature.removeprefix(OBSERVED)
        if isinstance(given, dict):  # {"motors": [...]}, of older recorders
            given = next(iter(given.values()), None)
        single = list(about.get("shape", ())) == [1]  # a number a row then, no list
        for i, name in enumerate(given or ([short] if single else [])):
            torque = short.split(".")[-1] in TORQUES and name != short
            columns.setdefault(_name(str(name), torque), (feature, None if single else i))
    return columns


def _name(name: str, torque: bool) -> str:
    """Return a name as `s2a identify` has it: `joint` for a position, `joint_torque`."""
    for ending, instead in SUFFIXES.items():
        if name.endswith(ending):
            return name.removesuffix(ending) + instead
    return f"{name}_torque" if torque and not name.endswith("_torque") else name


def _files(root: Path, info: dict[str, Any]) -> dict[int, Path]:
    files = {}
    for path in sorted((root / "meta/episodes").glob("*/*.parquet")):
        rows = _read(path, ["episode_index", *CHOICE])
        for episode, chunk, file in zip(*(rows[name] for name in ("episode_index", *CHOICE)), strict=True):
            files[int(episode)] = root / str(info["data_path"]).format(chunk_index=int(chunk), file_index=int(file))
    if not files:
        raise InputError(f"{root}: no episodes in meta/episodes; give the folder of a whole dataset")
    return files


def _frames(path: Path, episode: int, features: Sequence[str], columns: Sequence[Column]) -> np.ndarray:
    rows = _read(path, ["episode_index", "frame_index", *features])
    own = np.flatnonzero(np.array(rows["episode_index"]) == episode)
    if not len(own):
        raise InputError(f"{path}: no frames of episode {episode}; give the folder of a whole dataset")
    own = own[np.argsort(np.array(rows["frame_index"])[own], kind="stable")]
    values = {name: np.array([rows[name][i] for i in own], float) for name in features}
    table = [values[name] if i is None else values[name][:, i] for name, i in columns]
    return np.stack([column.reshape(len(own)) for column in table], axis=1)


def _read(path: Path, columns: list[str]) -> dict[str, list[Any]]:
    import pyarrow.parquet  # of the extra `collect`, which recordings in CSV do without

    try:
        return dict(pyarrow.parquet.read_table(path, columns=columns).to_pydict())
    except (OSError, pyarrow.ArrowException) as error:
        raise InputError(f"{path}: cannot be read ({error}); give the folder of a whole dataset") from error


# Of a recording: [s]; path of the grasp point from where it was scanned [m]; force on the part along that path [N],
# which opens it where it is above 0
COLUMNS = ("time", "opening", "force")
JITTER = 0.2  # Fraction of the mean time between samples by which one of them may differ


@dataclass(frozen=True)
class Pull:
    """Samples at one rate."""

    opening: np.ndarray  # path of the grasp point [m], shape [sample]
    force: np.ndarray  # along it [N] at the same times, shape [sample]
    step: float  # time between samples [s]


@dataclass(frozen=True)
class Noise:
    """Standard deviations of a recording's samples.

    Attributes:
        opening: [m].
        force: [N].
    """

    opening: Positive
    force: Positive


def read(path: Path, episodes: Sequence[int] = ()) -> list[Pull]:
    """Read recordings with the columns COLUMNS; see `tables`."""
    return [Pull(rows[:, 1], rows[:, 2], step) for rows, step in tables(path, COLUMNS, episodes)]


def header(path: Path) -> tuple[str, ...]:
    """Return the names of a CSV file's columns, or of a LeRobot dataset's; none where there is no file or no text in it."""
    if path.is_dir():
        return tuple(_columns(_info(path)))  # named as a recording's are (docs/identification.md)
    if not path.is_file():
        return ()
    with path.open(errors="replace") as file:
        return tuple(name.strip() for name in file.readline().split(","))


def tables(path: Path, columns: Sequence[str], episodes: Sequence[int] = ()) -> list[tuple[np.ndarray, float]]:
    """Return columns of recordings, shape [sample column], and the time between samples [s]; the first column is `time`.

    Args:
        path: a CSV file, one recording; or the folder of a LeRobot dataset, a recording an episode.
        columns: their names.
        episodes: of a dataset, by number; none: all.

    Raises:
        InputError: no such file; a column is missing; not numbers; times that do not rise evenly; fewer than 10 samples.
    """
    if path.is_dir():
        return [(rows, _step(where, rows)) for where, rows in lerobot_tables(path, columns, episodes)]
    rows = _csv(path, columns)
    return [(rows, _step(str(path), rows))]


def _csv(path: Path, columns: Sequence[str]) -> np.ndarray:
    if not path.is_file():
        raise InputError(
            f"no recording {str(path)!r}; give a CSV file with the columns {', '.join(columns)}, or a LeRobot dataset's folder"
        )
    if not path.read_bytes().strip():
        raise InputError(f"{path}: empty; give the columns {', '.join(columns)}")
    try:
        table = np.genfromtxt(path, delimiter=",", names=True, dtype=float, encoding="utf-8")
    except (ValueError, IndexError) as error:
        raise InputError(f"{path}: not a table ({error}); give the columns {', '.join(columns)}") from error
    names = table.dtype.names or ()
    missing = [name for name in columns if name not in names]
    if missing:
        raise InputError(
            f"{path}: no column {missing[0]!r} among {', '.join(names) or 'none'}; it needs {', '.join(columns)}"
        )
    return np.stack([np.atleast_1d(table[name]) for name in columns], axis=1)


def _step(where: str, rows: np.ndarray) -> float:
    """Return the time between samples [s] of a recording, shape [sample column]; `where` is what to call it."""
    if len(rows) < 10 or not np.isfinite(rows).all():
        raise InputError(
            f"{where}: {len(rows)} samples, or one that is not a number; record 10 or more numbers in each column"
        )
    gaps = np.diff(rows[:, 0])
    if gaps.min() <= 0.0 or np.abs(gaps - gaps.mean()).max() > JITTER * gaps.mean():
        raise InputError(f"{where}: samples {gaps.min():.4g} to {gaps.max():.4g} s apart; resample them at one rate")
    return float(gaps.mean())


def same_step(pulls: Sequence[Pull]) -> float:
    """Return the time between samples [s] of recordings that share it; InputError where they do not."""
    steps = [pull.step for pull in pulls]
    if max(steps) > (1.0 + JITTER) * min(steps):
        raise InputError(
            f"recordings with samples {min(steps):.4g} and {max(steps):.4g} s apart; resample them at one rate"
        )
    return float(np.mean(steps))


class ArmDynamics:
    """An arm without shapes, its fingers where they are told to be.

    Attributes:
        spec: the robot.
    """

    def __init__(self, spec: RobotSpec) -> None:
        """Read the robot's URDF: masses and inertias of its links, no rotors, no friction."""
        self.spec = spec
        robot = urdf.without_colliders(urdf.arm(spec))
        extension = ElementTree.SubElement(robot, "mujoco")
        ElementTree.SubElement(extension, "compiler", discardvisual="true", fusestatic="false")
        self._model = mujoco.MjModel.from_xml_string(ElementTree.tostring(robot, encoding="unicode"))
        self._data = mujoco.MjData(self._model)
        self._dofs = [self._model.joint(name).dofadr[0] for name in spec.joints]
        self._tool = self._model.body(spec.tool_link).id

    def wrench(
        self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, torque: np.ndarray, point: np.ndarray, gravity: bool
    ) -> np.ndarray:
        """Return force and torque [N, N m] that the tool exerts about a point, shape [sample 6], in the base frame.

        Args:
            q: of `spec.joints`, shape [sample joint].
            qd: likewise.
            qdd: likewise.
            torque: of the arm joints, on the side of their links [N m], shape [sample arm].
            point: base frame [m], shape [sample 3].
            gravity: the torques carry the robot's weight too; else it is carried beside them.
        """
        model, data, arm = self._model, self._data, self._dofs[: len(self.spec.arm_joints)]
        model.opt.gravity[2] = -GRAVITY if gravity else 0.0
        wrench = np.empty((len(q), 6))
        jacobian = np.zeros((6, model.nv))
        for i in range(len(q)):
            data.qpos[self._dofs], data.qvel[self._dofs], data.qacc[self._dofs] = q[i], qd[i], qdd[i]
            mujoco.mj_inverse(model, data)
            mujoco.mj_jac(model, data, jacobian[:3], jacobian[3:], point[i], self._tool)
            left = torque[i] - data.qfrc_inverse[arm]
            wrench[i] = np.linalg.lstsq(jacobian[:, arm].T, left, rcond=None)[0]
        return wrench


SMOOTHED = 0.08  # [s] Length of the cubic by which positions are differentiated twice (Savitzky and Golay's filter)
AT_REST = 0.002  # [m] As long as the tool has moved less along the part's path, the pull has not begun
BEFORE = 0.3  # [s] Of rest before the pull that belong to it
FAR = 0.03  # [m] The tool's largest distance from the part's path during a pull; farther, it does not hold the part


@dataclass(frozen=True)
class Recording:
    """An arm's motion at one rate."""

    q: np.ndarray  # of the robot's joints, its fingers among them [rad, m], shape [sample joint]
    torque: np.ndarray  # of the arm joints, on the side of their links [N m], shape [sample arm]
    step: float  # time between samples [s]


def read_recordings(path: Path, spec: RobotSpec, episodes: Sequence[int] = ()) -> list[Recording]:
    """Read recordings with the columns `spec.recorded`; see `s2a.joints.pull.tables`."""
    joints = len(spec.joints)
    recordings = tables(path, spec.recorded, episodes)
    return [Recording(rows[:, 1 : 1 + joints], rows[:, 1 + joints :], step) for rows, step in recordings]


def recorded_pull(recording: Recording, spec: RobotSpec, base: np.ndarray, body: Moving, gravity: bool) -> Pull:
    """Return how the tool pulled a part: what it holds moves with it, and what it feels is what the part resists.

    The opening is how far the tool went along the part's path; the force is the work that it does along it, which counts its
    torque about a hinge's axis too.

    Args:
        recording: from before the grasp or from the grasp on, to the end of the pull.
        spec: the robot.
        base: pose of its base, scene frame, shape [7].
        body: the part; it was closed before.
        gravity: the torques carry the robot's weight too.

    Raises:
        InputError: the tool does not move along the part's path.
    """
    window = max(5, round(SMOOTHED / recording.step) | 1)
    if len(recording.q) < window:
        raise InputError(f"a recording of {len(recording.q)} samples; give {window} or more, {SMOOTHED} s")
    q, qd, qdd = (
        savgol_filter(recording.q, window, 3, deriv=order, delta=recording.step, axis=0) for order in range(3)
    )
    turn = Rotation.from_quat(base[3:])
    in_base = kinematics(spec).tool(recording.q[:, : len(spec.arm_joints)])[:, :3, 3]
    tool = turn.apply(in_base) + base[:3]
    opening, off = along(tool, body)
    held = slice(_first(opening, off, round(BEFORE / recording.step)), None)
    wrench = ArmDynamics(spec).wrench(q[held], qd[held], qdd[held], recording.torque[held], in_base[held], gravity)
    force, torque = turn.apply(wrench[:, :3]), turn.apply(wrench[:, 3:])
    return Pull(opening[held] - opening[held][0], _work(force, torque, tool[held], body), recording.step)


def along(points: np.ndarray, body: Moving) -> tuple[np.ndarray, np.ndarray]:
    """Return how far along the path of a part's grasp point other points [point 3] are [m], and how far from it [m].

    Each has shape [point]; the path is a line or a circle, without an end.
    """
    joint, axis = body.joint, np.array(body.joint.axis)
    if joint.kind == "prismatic":
        q = (points - body.point) @ axis
    else:
        start = _across(body.point - joint.origin, axis)
        arm = _across(points - joint.origin, axis)
        q = np.arctan2(np.cross(start, arm) @ axis, arm @ start)
    path = np.array([displace(body.point[None], joint, each)[0] for each in q])
    return q * body.lever, np.linalg.norm(points - path, axis=1)


def _across(arm: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Return what of an arm [.. 3] stands across an axis."""
    return arm - (arm @ axis)[..., None] * axis


def _first(opening: np.ndarray, off: np.ndarray, before: int) -> int:
    """Return the sample with which a pull begins: so many before the tool, near the part's path to the end, leaves the grasp."""
    away = np.flatnonzero(off > FAR)
    near = int(away[-1]) + 1 if len(away) else 0
    if near == len(off) or np.ptp(opening[near:]) < 5 * AT_REST:
        raise InputError(
            f"the tool ends {off[-1]:.3f} m from where the part's grasp point goes, or does not move along it; "
            "record a pull that holds the part, from where it is closed"
        )
    rest = near + np.flatnonzero(opening[near:] < opening[near:].min() + AT_REST)
    return max(int(rest[-1]) - before, int(rest[0]))


def _work(force: np.ndarray, torque: np.ndarray, points: np.ndarray, body: Moving) -> np.ndarray:
    """Return the work of forces and torques about points, each [sample 3], by the path of the grasp point [N], shape [sample]."""
    axis = np.array(body.joint.axis)
    if body.joint.kind == "prismatic":
        return force @ axis / body.lever
    return (np.cross(points - body.joint.origin, force) + torque) @ axis / body.lever
