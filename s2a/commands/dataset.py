"""Command `s2a dataset`: take many captures through all stages, to an index of parts and a verdict per room."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
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
from s2a.learn import rooms
from s2a.learn.evaluate import run_episodes
from s2a.learn.rooms import Timed
from s2a.motion.policy import Planner
from s2a.motion.trajectory import Demonstration, PlannerConfig
from s2a.prepare.room import PrepareConfig
from s2a.robot import Robot
from s2a.scan import folder, imported, labelled_boxes, recording_formats
from s2a.scan.evidence import Bounds, annotation
from s2a.scan.folder import formats
from s2a.scan.formats.articulate3d import read_overlaps
from s2a.scene.geometry.camera import framing_pose, front_of
from s2a.scene.geometry.mesh_ops import merge, painted
from s2a.scene.geometry.render import CAMERA, render
from s2a.scene.scene import Scene
from s2a.scene.usd.sim_scene import SimRoom
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import stage_of
from s2a.tasks import MdpSettings, MetricSettings, make_env

STEPS = 2200  # Control steps of an episode, as of s2a bench: 37 s, which the planner takes on a careful arm
# Of fronts in a room's image: opened by the planner in half of the episodes or more; in the index; not in it
COLORS = {"opened": (40, 150, 70), "taken": (60, 120, 220), "left out": (210, 60, 50)}


@dataclass(frozen=True)
class Config:
    """Keys of `s2a dataset`.

    Attributes:
        scans: captures, or patterns of them as DIR/*: folders of scans, annotated or not, meshes, recordings.
        out: folder of the data set; rooms that are in it already are kept.
        jobs: rooms that are made at once, each in a process of its own.
        stages: stages besides the preparation: check the annotation, export both flavours of USD, certify, run the planner.
        episodes: number of the planner's episodes per part.
        robot: the robot, such as panda or baxter.
        prepare: preparation of the scenes.
        sim: physics settings.
        task: task settings.
        metrics: thresholds of the metrics.
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


overview = rooms.overview  # Of a sweep: the data sets of its jobs as one


def run(config: Config) -> str:
    """Make the rooms that are missing or failed, write the index, and return what is in it.

    Raises:
        InputError: no capture, two of one name, rooms in `out` that were made with other settings or of another capture, or no
            part in the end.
    """
    captures = [CaptureJob(config, path, name) for path, name in rooms.captures_of(config.scans).items()]
    return rooms.write_index(config.out, rooms.make(captures, config.out, config.jobs))


class CaptureJob(rooms.RoomJob):
    """One capture, annotated or not, on its way to a row of the index."""

    config: Config

    def __init__(self, config: Config, capture: Path, name: str) -> None:
        super().__init__(config, name, capture)
        self.capture = capture

    def scanned(self, timed: Timed, temporary: Path) -> Path:
        """Return the folder of the annotated scan; import and proposals are stored in the room's own folder."""
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

    def checked(self, scene: Scene, place: Path, timed: Timed) -> None:
        """Draw the room; leave out parts that the surface contradicts; export both flavours of USD."""
        self._draw(scene, {})
        if "check" in self.config.stages:
            with timed("check"):
                self.row["left_out"] |= self._contradicted(scene, place)
        if "export" in self.config.stages:
            with timed("export"):
                scans.export(place, self.place)

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

    def handles(self, scene: Scene, place: Path) -> dict[str, str]:
        """Return by part what its handle is: added where it was completed, scanned, or none."""
        record = place / annotated_files.RECORD
        rows = json.loads(record.read_text())["parts"] if record.is_file() else []
        if len(rows) != len(scene.movable):
            return super().handles(scene, place)
        kinds = ["added" if row["completed_handle"] else "scanned" if row["handle_faces"] else "none" for row in rows]
        return dict(zip(scene.movable, kinds, strict=True))

    def tried(self, scene: Scene, room: SimRoom, motions: Mapping[str, Demonstration], timed: Timed) -> None:
        """Certify the room, run the planner on its parts, and draw what became of them."""
        if "certify" in self.config.stages:
            with timed("certify"):
                self._certify()
        if "planner" in self.config.stages and motions:
            with timed("planner"):
                self._open(room, motions)
        self._draw(scene, self.row["verdicts"])

    def _certify(self) -> None:
        for report in certify(self.file, self.config.certify, None, self.config.robot.name):
            if report.target in self.row["verdicts"]:
                reasons = "; ".join(
                    f"{c.name} at {c.prim or '/scene'}: {number(c)} {c.message}".strip() for c in report.failed
                )
                self.row["verdicts"][report.target] |= {"certified": report.passed, "failed_checks": reasons}

    def _open(self, room: SimRoom, motions: Mapping[str, Demonstration]) -> None:
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
    return any(reader.recognise(path) for reader in formats("s2a.scan.formats"))


def _is_scan(path: Path) -> bool:
    """Return whether a folder is of a known layout of scans, or of s2a import, whose meshes are z up in metres."""
    return _is_annotation(path) or (path / imported.RECORD).is_file() or folder.scannet_mesh(path) is not None


def _moves(path: Path) -> bool:
    """Return whether a scan has an annotation with a part that moves."""
    return _is_annotation(path) and bool(scans.read(path).movable)


def _mesh(path: Path) -> Path:
    """Return the only file of a folder that s2a import reads; InputError for none, or several."""
    readers = formats("s2a.scan.meshes")
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
