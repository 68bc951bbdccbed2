"""Command `s2a dataset`: take many captures through all stages, to an index of parts and a verdict a room."""

from __future__ import annotations

import contextlib
import glob
import hashlib
import json
import os
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
from PIL import Image

from s2a import scan as scans
from s2a.annotate import files as annotated_files
from s2a.certify.check_suite import CertifyConfig, certify
from s2a.certify.report import number
from s2a.commands import annotate, import_
from s2a.core import config as configuration
from s2a.core.bounds import Count
from s2a.core.check import failed
from s2a.core.errors import InputError
from s2a.core.outputs import Output, atomic_write
from s2a.core.progress import StdoutFilter, track
from s2a.core.provenance import provenance
from s2a.core.workers import apart
from s2a.learn.evaluate import run_episodes
from s2a.motion.policy import Planner
from s2a.motion.trajectory import Demonstration, PlannerConfig
from s2a.prepare.part import ALL
from s2a.prepare.room import PrepareConfig, prepare
from s2a.robot import Robot
from s2a.scan import folder, imported, labelled_boxes, recording_formats, registry
from s2a.scan.evidence import Bounds, annotation
from s2a.scan.formats.articulate3d import read_overlaps
from s2a.scene.geometry.camera import framing_pose, front_of
from s2a.scene.geometry.mesh_ops import merge, painted
from s2a.scene.geometry.render import CAMERA, render
from s2a.scene.scene import Scene
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import SimRoom
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import stage_of
from s2a.tasks import MdpSettings, MetricSettings, make_env, pool, task

INDEX = "pool.json"
STEPS = 2200
"""Control steps of an episode, as of s2a bench: 37 s, which the planner takes on a careful arm."""
COLORS = {"opened": (40, 150, 70), "taken": (60, 120, 220), "left out": (210, 60, 50)}
"""Of fronts in a room's image: opened by the planner in half of the episodes or more; in the index; not in it."""
CUT_OFF = "cut off"
"""Reason of a room whose process ended before it could write another."""
Row = dict[str, Any]


@dataclass(frozen=True)
class Config:
    """Keys of `s2a dataset`.

    Attributes:
        scans: captures, or patterns of them as DIR/*: folders of scans, annotated or not, meshes, recordings.
        out: folder of the data set; rooms that are in it already are kept.
        jobs: rooms that are made at once, each in a process of its own.
        stages: what is done beyond the preparation: check the annotation, export both flavours of USD, certify, run the planner.
        episodes: of the planner, for each part.
        robot: the robot, as panda or baxter.
        prepare: how the scenes are prepared.
        sim: how physics is stepped.
        task: what the robot has to do with each part.
        metrics: what is reported of an episode.
        planner: the planner's motion.
        certify: the check suite and its bounds.
    """

    scans: str | tuple[str, ...]
    out: Output
    jobs: Count
    stages: tuple[Literal["check", "export", "certify", "planner"], ...]
    episodes: Count
    robot: Robot
    prepare: PrepareConfig
    sim: SimConfig
    task: MdpSettings
    metrics: MetricSettings
    planner: PlannerConfig
    certify: CertifyConfig


def run(config: Config) -> str:
    """Make the rooms that are missing or failed, write the index, and return what is in it.

    Raises:
        InputError: no capture, two of one name, or rooms in `out` that were made with other settings or of another capture.
    """
    captures = list(captures_of(config.scans))
    config.out.mkdir(parents=True, exist_ok=True)
    missing = [capture for capture in captures if _row(config, capture).get("failed", CUT_OFF)]
    for index, _ in track(apart(_room, config, missing, config.jobs), "rooms", len(missing)):
        row = _row(config, missing[index])
        if not row or row["failed"] == CUT_OFF:
            stage = list(row.get("seconds", {}) or {"begin": 0})[-1]
            reason = f"its process ended after stage {stage!r}; is there enough memory? try jobs=1"
            _keep(config, missing[index], {**_begun(config, missing[index]), **row, "failed": reason})
    return _indexed(config.out, [_row(config, capture) for capture in captures])


def overview(place: Path) -> str:
    """Join the data sets of a sweep's jobs to one index in the sweep's folder; return what is in it."""
    rows = []
    jobs = [file.parent.parent for file in place.glob("*/.hydra/overrides.yaml")]
    for job in sorted(jobs, key=lambda path: (len(path.name), path.name)):
        indices = sorted(job.glob(f"*/{INDEX}"))
        for index in indices:
            rows += [_moved(row, index.parent.relative_to(place)) for row in json.loads(index.read_text())["verdicts"]]
        if not indices:
            source = " ".join((job / ".hydra/overrides.yaml").read_text().split())
            rows.append(_empty(f"job {job.name}", source, "the job wrote no index; see its log below .submitit"))
    return _indexed(place, rows) if rows else ""


def _moved(row: Row, folder_: Path) -> Row:
    """Return a row whose files are named relative to a folder above."""
    moved = [
        {**part, "room": str(folder_ / part["room"]), "motion": str(folder_ / part["motion"])} for part in row["parts"]
    ]
    return {**row, "parts": moved, "image": row["image"] and str(folder_ / row["image"])}


def _indexed(out: Path, rows: list[Row]) -> str:
    """Write the index of some rooms; return what is in it."""
    entries = [pool.PoolPart(**entry) for row in rows for entry in row["parts"]]
    left_out = {f"{row['name']}/{part}": why for row in rows for part, why in row["left_out"].items()}
    shown = [{key: value for key, value in row.items() if key != "settings"} for row in rows]
    pool.write(out / INDEX, entries, left_out, {"verdicts": shown, **provenance("cpu")})
    bad = [row for row in rows if row["failed"]]
    lines = [f"  {row['name']} failed: {row['failed']}" for row in bad]
    counts = f"{len(entries)} parts of {len(rows)} rooms; {len(left_out)} parts left out, {len(bad)} rooms failed"
    return "\n".join(
        [f"{out / INDEX}: {counts}", *lines, f"  next: s2a report path={out / INDEX} out={out / 'rooms.html'}"]
    )


def captures_of(patterns: str | tuple[str, ...]) -> dict[Path, str]:
    """Return the name of each capture by its path, patterns expanded; InputError for none, or two of one name."""
    names: dict[Path, str] = {}
    for pattern in (patterns,) if isinstance(patterns, str) else patterns:
        paths = [Path(text) for text in sorted(glob.glob(os.path.expanduser(pattern)))]
        if not paths:
            raise InputError(
                f"key 'scans' has {pattern!r}, which is no file or folder; give captures, or a pattern as DIR/*"
            )
        for path in paths:
            name = _name(path)
            twin = next((other for other, taken in names.items() if taken == name and other != path), None)
            if twin is not None:
                raise InputError(f"key 'scans': {twin} and {path} are both named {name!r}; rename one, or link to it")
            names[path] = name
    if not names:
        raise InputError("key 'scans' is empty; give captures: scans=[DIR/*]")
    return names


def _row(config: Config, capture: Path) -> Row:
    """Return what is kept of a room; empty where nothing is; InputError where it was made otherwise."""
    file = config.out / f"{_name(capture)}.json"
    if not file.is_file():
        return {}
    row: Row = json.loads(file.read_text())
    if row["settings"] != _settings(config, capture):
        raise InputError(
            f"{file}: made with other settings, or the capture has changed; give another out, or delete that file and "
            f"{file.with_suffix('')}"
        )
    return row


def _keep(config: Config, capture: Path, row: Row) -> None:
    with atomic_write(config.out / f"{_name(capture)}.json") as out:
        out.write_text(json.dumps(row, indent=1))


def _name(capture: Path) -> str:
    return capture.name if capture.is_dir() else capture.stem


def _settings(config: Config, capture: Path) -> Any:
    """Return what a room depends on, as JSON reads it: all keys but those of the run, and the capture's files."""
    values = asdict(config)
    for key in ("scans", "out", "jobs"):
        values.pop(key)
    names = sorted(path for path in capture.rglob("*") if path.is_file()) if capture.is_dir() else [capture]
    about = [(str(path.relative_to(capture)), path.stat().st_size, path.stat().st_mtime_ns) for path in names]
    values["capture"] = hashlib.sha256(json.dumps([str(capture.resolve()), about]).encode()).hexdigest()
    return json.loads(json.dumps(values, default=str))


def _begun(config: Config, capture: Path) -> Row:
    return {"settings": _settings(config, capture), **_empty(_name(capture), str(capture), CUT_OFF)}


def _empty(name: str, source: str, reason: str) -> Row:
    row: Row = {"name": name, "source": source, "failed": reason, "image": ""}
    return row | {"seconds": {}, "parts": [], "left_out": {}, "verdicts": {}}


def _room(config: Config, capture: Path) -> None:
    """Make one room, and keep its row after each stage; whatever is raised is its reason."""
    # What an earlier process spent on stages whose outputs are kept counts on.
    row = {**_begun(config, capture), "seconds": _row(config, capture).get("seconds", {})}
    stage = "begin"

    @contextlib.contextmanager
    def timed(name: str) -> Iterator[None]:
        nonlocal stage
        stage, begun = name, time.perf_counter()
        yield
        row["seconds"][name] = round(time.perf_counter() - begun, 1)
        _keep(config, capture, row)

    _keep(config, capture, row)
    try:
        with contextlib.redirect_stdout(StdoutFilter()):
            _Room(config, capture, row).make(timed)
        row["failed"] = ""
    except InputError as error:
        row["failed"] = f"{stage}: {error}"
    except Exception as error:  # a bug, or no memory, in one room of many
        row["failed"] = f"{stage}: {type(error).__name__}: {' '.join(str(error).split())[:300]}"
    _keep(config, capture, row)


class _Room:
    """One capture on its way to a row of the index."""

    def __init__(self, config: Config, capture: Path, row: Row) -> None:
        self.config, self.capture, self.row = config, capture, row
        self.place = config.out / row["name"]
        self.file = config.out / f"{row['name']}.usd"

    def make(self, timed: Any) -> None:
        """Go through the stages; what was left out, and why, is in the row."""
        stages, left_out = self.config.stages, self.row["left_out"]
        place = self._annotated(timed)
        scene = scans.read(place)
        if not scene.movable:
            raise InputError(
                f"no part that moves was proposed in {place}; mark some with s2a annotate scan={place} out=DIR, and give DIR"
            )
        self._draw(scene, {})
        if "check" in stages:
            with timed("check"):
                left_out |= self._contradicted(scene, place)
        if "export" in stages:
            with timed("export"):
                scans.export(place, self.place)
        with timed("prepare"):
            room = prepare(scene, ALL, self.config.prepare, (), self.config.robot)
            with atomic_write(sim_stage.visuals_file(self.file)) as beside, atomic_write(self.file) as file:
                sim_stage.write(room, file, beside)
        for part in scene.movable:
            if part not in room.articulations:
                left_out.setdefault(part, "s2a prepare leaves it out")
        with timed("plan"):
            motions = self._planned(room)
        self.row["verdicts"] = {part: {} for part in motions}
        if "certify" in stages:
            with timed("certify"):
                self._certify()
        if "planner" in stages and motions:
            with timed("planner"):
                self._open(room, motions)
        self._draw(scene, self.row["verdicts"])
        handles = _handles(place, scene)
        kinds = {part: room.articulations[part].joint.kind for part in motions}
        parts = [
            pool.PoolPart(self.file.name, part, kinds[part], handles[part], self._motion(part)) for part in motions
        ]
        self.row["parts"] = [asdict(part) for part in parts]

    def _annotated(self, timed: Any) -> Path:
        """Return the folder of the annotated scan; import and proposals are kept in the room's own folder."""
        place = self.capture
        if not place.is_dir() or recording_formats.recognise(place) or not _is_scan(place):
            source, place = place, self.place / "scan"
            if not (place / imported.RECORD).is_file():
                with timed("import"):
                    self._import(source, place)
        elif _moves(place):
            return place
        proposed = self.place / "annotated"
        if not (proposed / annotated_files.RECORD).is_file():
            with timed("annotate"):
                keys = {"scan": str(place), "out": str(proposed), "auto": True, "page": False}
                annotate.run(_loaded("annotate", annotate.Config, keys))
        return proposed

    def _import(self, source: Path, place: Path) -> None:
        if recording_formats.recognise(source):
            keys = {"frames": str(source)}
        else:
            keys = {"mesh": str(_mesh(source) if source.is_dir() else source)}
        import_.run(_loaded("import", import_.Config, {**keys, "out": str(place)}))

    def _contradicted(self, scene: Scene, place: Path) -> dict[str, str]:
        """Return what the surface says against parts, by their ids; InputError where it contradicts the whole room."""
        reasons: dict[str, str] = {}
        for check in failed(annotation.check(scene, Bounds(), read_overlaps(place))):
            line = (check.part, *scene.ancestors(check.part)) if check.part in scene.parts else ()
            owner = next((part for part in line if part in scene.movable), "")
            if not owner:
                raise InputError(str(check))
            reasons.setdefault(owner, f"check {check.name}: {check.message}")
        return reasons

    def _planned(self, room: SimRoom) -> dict[str, Demonstration]:
        """Return the planner's motion of each part that has one, and write it."""
        config, motions = self.config, dict[str, Demonstration]()
        for part, articulation in room.articulations.items():
            if part in self.row["left_out"]:
                continue
            try:
                if not articulation.bases[config.robot.name].free:
                    raise InputError(f"no base pose is free: {articulation.bases[config.robot.name].reason}")
                path_of = partial(task(config.task.name).tool_path, config=config.task)
                motions[part] = pool.planned(self.file, part, config.robot, config.sim, config.planner, path_of)
            except InputError as error:
                self.row["left_out"][part] = str(error).removeprefix(f"{self.file}: ")
                continue
            with atomic_write(config.out / self._motion(part)) as out:
                pool.save_motion(motions[part], out)
        return motions

    def _motion(self, part: str) -> str:
        return f"{self.row['name']}_{part}.npz"

    def _certify(self) -> None:
        for report in certify(self.file, self.config.certify, None, self.config.robot.name):
            if report.target in self.row["verdicts"]:
                reasons = "; ".join(
                    f"{c.name} at {c.prim or '/scene'}: {number(c)} {c.message}".strip() for c in report.failed
                )
                self.row["verdicts"][report.target] |= {"certified": report.passed, "failed_checks": reasons}

    def _open(self, room: SimRoom, motions: dict[str, Demonstration]) -> None:
        """Run the planner in worlds of all parts of the room together; its rates become the parts' verdicts."""
        config = self.config
        stages = [stage_of(self.file, room, part, robot=config.robot.name) for part in motions]
        sim = Simulation(stages, config.sim, len(stages) * config.episodes, "cpu")
        env = make_env(sim, replace(config.task, episode_steps=STEPS), config.metrics, {}, config.planner.seed)
        planner = Planner(env, config.planner, list(motions.values()))
        env.lengthen(planner.episode_steps)
        done = run_episodes(env, planner)
        for index, part in enumerate(motions):
            mine = sim.stage_of_env == index
            rates = {name: float(done[name].numpy()[mine].mean()) for name in env.task.RESULTS.rates}
            self.row["verdicts"][part] |= rates

    def _draw(self, scene: Scene, verdicts: dict[str, Any]) -> None:
        """Write the image of the room, its fronts coloured by what became of them."""
        surfaces = []
        for part, item in scene.parts.items():
            owner = next((i for i in (part, *scene.ancestors(part)) if i in scene.movable), None)
            verdict = verdicts.get(owner) if owner else None
            color = COLORS["left out"] if verdict is None else COLORS["taken"]
            color = COLORS["opened"] if verdict and verdict.get("success", 0.0) >= 0.5 else color
            surfaces.append(painted(item.mesh, color) if owner else item.mesh)
        fronts = [scene.parts[part].mesh for part in scene.movable]
        camera = replace(CAMERA, width=640, height=480, elevation=0.75)
        front = front_of(fronts)
        pose = framing_pose(
            merge([item.mesh for item in scene.parts.values()]).vertices,
            np.array([1.0, 0.0, 0.0]) if front is None else front,
            camera,
        )
        self.row["image"] = f"{self.row['name']}.jpg"
        with atomic_write(self.config.out / self.row["image"]) as out:
            Image.fromarray(render(surfaces, pose, camera)).save(out, format="JPEG", quality=85)


def _loaded(command: str, cls: type[Any], keys: dict[str, Any]) -> Any:
    """Return a command's settings: its defaults and some keys."""
    return configuration.load(cls, {**configuration.compose(command, (), cls), **keys})


def _is_annotation(path: Path) -> bool:
    return any(reader.recognise(path) for reader in registry.formats("s2a.scan.formats"))


def _is_scan(path: Path) -> bool:
    """Return whether a folder is of a known layout of scans, or of s2a import, whose meshes are z up in metres."""
    return _is_annotation(path) or (path / imported.RECORD).is_file() or folder.scannet_mesh(path) is not None


def _moves(path: Path) -> bool:
    """Return whether a scan has an annotation with a part that moves."""
    return _is_annotation(path) and bool(scans.read(path).movable)


def _mesh(path: Path) -> Path:
    """Return the only file of a folder that s2a import reads; InputError for none, or several."""
    readers = registry.formats("s2a.scan.meshes")
    files = [
        file
        for file in sorted(path.iterdir())
        if any(reader.recognise(file) for reader in readers) or labelled_boxes.recognise_quest(file)
    ]
    if len(files) != 1:
        names = ", ".join(file.name for file in files[:4]) or "none"
        raise InputError(
            f"{path}: expected a scan, a recording or one mesh file (found: {names}); give one of its files"
        )
    return files[0]


def _handles(place: Path, scene: Scene) -> dict[str, str]:
    """Return by part what its handle is: added where it was completed, scanned, or none."""
    record = place / annotated_files.RECORD
    if record.is_file() and len(rows := json.loads(record.read_text())["parts"]) == len(scene.movable):
        pairs = zip(scene.movable, rows, strict=True)
        return {
            part: "added" if row["completed_handle"] else "scanned" if row["handle_faces"] else "none"
            for part, row in pairs
        }
    return {part: "scanned" if scene.handle_parts(part) else "none" for part in scene.movable}
