"""Many rooms, each from its scan to entries of a pool: every one in a process of its own, stored, and resumed."""

from __future__ import annotations

import contextlib
import glob
import hashlib
import json
import os
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Protocol

from s2a import scan
from s2a.core.config import is_job
from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write
from s2a.core.progress import track
from s2a.core.provenance import provenance
from s2a.core.workers import apart
from s2a.motion.trajectory import Demonstration, PlannerConfig
from s2a.prepare.part import ALL
from s2a.prepare.room import PrepareConfig, prepare
from s2a.robot.spec import RobotSpec
from s2a.scene.scene import Scene
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import SimRoom
from s2a.sim.simulation import SimConfig
from s2a.tasks import MdpSettings, pool, task
from s2a.tasks.pool import PoolPart

INDEX = "pool.json"
CUT_OFF = "cut off"  # Reason of a room whose process ended before it could write another
Row = dict[str, Any]
# The context of a stage, by its name: its seconds go to the room's row, which is stored
Timed = Callable[[str], contextlib.AbstractContextManager[None]]


class Settings(Protocol):
    """Keys that all commands over rooms have."""

    @property
    def out(self) -> Path: ...  # noqa: D102
    @property
    def robot(self) -> RobotSpec: ...  # noqa: D102
    @property
    def prepare(self) -> PrepareConfig: ...  # noqa: D102
    @property
    def sim(self) -> SimConfig: ...  # noqa: D102
    @property
    def task(self) -> MdpSettings: ...  # noqa: D102
    @property
    def planner(self) -> PlannerConfig: ...  # noqa: D102


class RoomJob:
    """One annotated scan on its way to parts of a pool; other sources and further stages are subclasses.

    Attributes:
        config: the command's keys.
        name: of the room's files.
        source: where it comes from, for its row.
        settings: what it depends on, as JSON: keys, and the state of the capture.
        ROOMS: keys that say which rooms there are, not what one is like.
        visuals: Write the room's visuals too.
    """

    ROOMS: ClassVar[tuple[str, ...]] = ("scans", "out", "jobs")
    visuals = True

    def __init__(self, config: Settings, name: str, source: Path | str) -> None:
        """Begin a row with nothing made. `source`: the capture, or words for a room without one."""
        self.config, self.name, self.source = config, name, str(source)
        values: Row = {key: value for key, value in asdict(config).items() if key not in self.ROOMS}  # type: ignore[call-overload]
        if isinstance(source, Path):
            values["capture"] = state(source)
        self.settings = json.loads(json.dumps(values, default=str))
        self.file, self.place = config.out / f"{name}.usd", config.out / name
        self.row = {"settings": self.settings, **empty(name, self.source, CUT_OFF)}

    def stored(self) -> Row:
        """Return what is stored of the room; empty where nothing is; InputError where it was made otherwise."""
        file = self.config.out / f"{self.name}.json"
        if not file.is_file():
            return {}
        # A row of s2a pool before it had reasons of rooms is of one that is done; its parts are named by room and part.
        row: Row = {**empty(self.name, self.source, ""), **json.loads(file.read_text())}
        row["left_out"] = {part.removeprefix(f"{self.name}/"): why for part, why in row["left_out"].items()}
        if row.get("settings") != self.settings:
            also = f" and {self.place}" if self.place.is_dir() else ""
            raise InputError(
                f"{file}: made with other settings, or the capture has changed; give another out, or delete that file{also}"
            )
        return row

    def store(self, row: Row) -> None:
        """Write a row of the room."""
        with atomic_write(self.config.out / f"{self.name}.json") as out:
            out.write_text(json.dumps(row, indent=1))

    def scanned(self, timed: Timed, temporary: Path) -> Path:
        """Return the folder of the annotated scan; what lies in the temporary folder goes once the room is prepared."""
        return Path(self.source)

    def checked(self, scene: Scene, place: Path, timed: Timed) -> None:
        """Add to the row what is known of a scan before it is prepared."""

    def handles(self, scene: Scene, place: Path) -> dict[str, str]:
        """Return by part what its handle is."""
        return {part: "scanned" if scene.handle_parts(part) else "none" for part in scene.movable}

    def tried(self, scene: Scene, room: SimRoom, motions: Mapping[str, Demonstration], timed: Timed) -> None:
        """Add to the row what planned parts came to."""

    def make(self, timed: Timed) -> None:
        """Go through the stages; what was left out, and why, is in the row."""
        left_out = self.row["left_out"]
        with tempfile.TemporaryDirectory() as temporary:
            place = self.scanned(timed, Path(temporary))
            scene = scan.read(place)
            if not scene.movable:
                raise InputError(
                    f"no part that moves was proposed in {place}; mark some with s2a annotate scan={place} out=DIR, and give DIR"
                )
            self.checked(scene, place, timed)
            with timed("prepare"):
                room = prepare(scene, ALL, self.config.prepare, (), self.config.robot)
                visuals = atomic_write(sim_stage.visuals_file(self.file)) if self.visuals else None
                with visuals or contextlib.nullcontext(Path(temporary) / "visuals.usd") as beside:
                    with atomic_write(self.file) as file:
                        sim_stage.write(room, file, beside)
            handles = self.handles(scene, place)
        for part in scene.movable:
            if part not in room.articulations:
                left_out.setdefault(part, "s2a prepare leaves it out")
        motions: dict[str, Demonstration] = {}
        with timed("plan"):
            for part in room.articulations:
                try:
                    if part not in left_out:
                        motions[part] = self._planned(room, part)
                except InputError as error:
                    left_out[part] = str(error).removeprefix(f"{self.file}: ")
        self.row["verdicts"] = {part: {} for part in motions}
        self.tried(scene, room, motions, timed)
        kinds = {part: room.articulations[part].joint.kind for part in motions}
        self.row["parts"] = [
            asdict(PoolPart(self.file.name, part, kinds[part], handles[part], self._motion(part))) for part in motions
        ]

    def _planned(self, room: SimRoom, part: str) -> Demonstration:
        """Return the planner's motion of a part, and write it; InputError where there is none."""
        config = self.config
        base = room.articulations[part].bases[config.robot.name]
        if not base.free:
            raise InputError(f"no base pose is free; nearest one: {base.reason}")
        path_of = partial(task(config.task.name).tool_path, config=config.task)
        motion = pool.planned(self.file, part, config.robot, config.sim, config.planner, path_of)
        with atomic_write(config.out / self._motion(part)) as out:
            pool.save_motion(motion, out)
        return motion

    def _motion(self, part: str) -> str:
        return f"{self.name}_{part}.npz"


def captures_of(patterns: str | tuple[str, ...]) -> dict[Path, str]:
    """Return the name of each capture by its path, patterns expanded; InputError for none."""
    names: dict[Path, str] = {}
    for pattern in (patterns,) if isinstance(patterns, str) else patterns:
        paths = [Path(text) for text in sorted(glob.glob(os.path.expanduser(pattern)))]
        if not paths:
            raise InputError(
                f"key 'scans' has {pattern!r}, which is no file or folder; give captures, or a pattern as DIR/*"
            )
        for path in paths:
            names[path] = path.name if path.is_dir() else path.stem
    if not names:
        raise InputError("key 'scans' is empty; give captures: scans=[DIR/*]")
    return names


def state(capture: Path) -> str:
    """Return a checksum of a capture's path, and of names, sizes and times of its files."""
    names = sorted(path for path in capture.rglob("*") if path.is_file()) if capture.is_dir() else [capture]
    about = [(str(path.relative_to(capture)), path.stat().st_size, path.stat().st_mtime_ns) for path in names]
    return hashlib.sha256(json.dumps([str(capture.resolve()), about]).encode()).hexdigest()


def empty(name: str, source: str, reason: str) -> Row:
    """Return the row of a room in which nothing was made."""
    row: Row = {"name": name, "source": source, "failed": reason, "image": ""}
    return row | {"seconds": {}, "parts": [], "left_out": {}, "verdicts": {}}


def make(jobs: Sequence[RoomJob], out: Path, at_once: int) -> list[Row]:
    """Make the rooms that are missing or failed; return the rows of all.

    `at_once`: rooms that are made at once, each in a process of its own.

    Raises:
        InputError: two rooms of one name, one of the index's, or one in `out` that was made with other settings or of another
            capture.
    """
    sources: dict[str, str] = {Path(INDEX).stem: INDEX}
    for job in jobs:
        if job.name in sources:
            raise InputError(
                f"{sources[job.name]} and {job.source} are both named {job.name!r}; rename one, or give a link of another name"
            )
        sources[job.name] = job.source
    out.mkdir(parents=True, exist_ok=True)
    missing = [job for job in jobs if job.stored().get("failed", CUT_OFF)]
    for index, _ in track(apart(_make, None, missing, at_once), "rooms", len(missing)):
        job = missing[index]
        row = job.stored()
        if not row or row["failed"] == CUT_OFF:
            stage = list(row.get("seconds", {}) or {"begin": 0})[-1]
            reason = f"its process ended after stage {stage!r}; is there enough memory? try jobs=1"
            job.store({**job.row, **row, "failed": reason})
    return [job.stored() for job in jobs]


def _make(_: None, job: RoomJob) -> None:
    """Make one room, and store its row after each stage; whatever is raised is its reason."""
    # What an earlier process spent on stages whose outputs are there counts on.
    job.row["seconds"] = job.stored().get("seconds", {})
    stage = "begin"

    @contextlib.contextmanager
    def timed(name: str) -> Iterator[None]:
        nonlocal stage
        stage, begun = name, time.perf_counter()
        yield
        job.row["seconds"][name] = round(time.perf_counter() - begun, 1)
        job.store(job.row)

    job.store(job.row)
    try:
        job.make(timed)
        job.row["failed"] = ""
    except InputError as error:
        job.row["failed"] = f"{stage}: {error}"
    except Exception as error:  # a bug, or no memory, in one room of many
        job.row["failed"] = f"{stage}: {type(error).__name__}: {' '.join(str(error).split())[:300]}"
    job.store(job.row)


def write_index(
    out: Path,
    rows: Iterable[Row],
    about: Mapping[str, object] | None = None,
    taken: Callable[[PoolPart], bool] = lambda _: True,
    may_be_empty: bool = False,
) -> str:
    """Write the index of some rooms; return what is in it.

    Args:
        out: folder of the pool.
        rows: of the rooms.
        about: further facts.
        taken: true of a part that goes into the index.
        may_be_empty: no part need be in it, as in a job of a sweep, of which a room is a row of the sweep's index.

    Raises:
        InputError: no part is in it; it is written all the same, for s2a report.
    """
    rows = list(rows)
    entries = [entry for row in rows for part in row["parts"] if taken(entry := pool.entry_of(part))]
    left_out = {f"{row['name']}/{part}": why for row in rows for part, why in row["left_out"].items()}
    shown = [{key: value for key, value in row.items() if key != "settings"} for row in rows]
    pool.write(out / INDEX, entries, left_out, {**(about or {}), "verdicts": shown, **provenance("cpu")})
    bad = [row for row in rows if row["failed"]]
    slides = sum(entry.kind == "prismatic" for entry in entries)
    counts = f"{len(entries)} parts of {len(rows)} rooms, {slides} of them slide"
    counts += f"; {len(left_out)} parts left out, {len(bad)} rooms failed"
    page = f"s2a report path={out / INDEX} out={out / 'rooms.html'}"
    if not entries and not may_be_empty and not is_job():
        reasons = [f"{row['name']}: {row['failed']}" for row in bad] or [
            f"{part}: {why}" for part, why in left_out.items()
        ]
        first = f" ({reasons[0]})" if reasons else ""
        raise InputError(f"{out / INDEX}: {counts}{first}; for all reasons: {page}")
    lines = [f"  {row['name']} failed: {row['failed']}" for row in bad]
    return "\n".join([f"{out / INDEX}: {counts}", *lines, f"  next: {page}"])


def overview(place: Path) -> str:
    """Join the pools of a sweep's jobs to one index in the sweep's folder; return what is in it."""
    rows = []
    jobs = [file.parent.parent for file in place.glob("*/.hydra/overrides.yaml")]
    for job in sorted(jobs, key=lambda path: (len(path.name), path.name)):
        indices = sorted(job.glob(f"*/{INDEX}"))
        for index in indices:
            rows += [_moved(row, index.parent.relative_to(place)) for row in json.loads(index.read_text())["verdicts"]]
        if not indices:
            source = " ".join((job / ".hydra/overrides.yaml").read_text().split())
            rows.append(empty(f"job {job.name}", source, "the job wrote no index; see its log below .submitit"))
    return write_index(place, rows, may_be_empty=True) if rows else ""


def _moved(row: Row, folder: Path) -> Row:
    """Return a row whose files are named relative to a folder above."""
    names = ("room", "motion")
    parts = [{**part, **{key: str(folder / part[key]) for key in names if part.get(key)}} for part in row["parts"]]
    return {**row, "parts": parts, "image": row["image"] and str(folder / row["image"])}
