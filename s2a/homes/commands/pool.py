"""Command `s2a pool`: prepare the parts of many virtual rooms, to train one policy on all."""

from __future__ import annotations

import contextlib
import json
import logging
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, cast, get_args

from s2a import scan
from s2a.core import workers
from s2a.core.bounds import Count, CountFromZero
from s2a.core.errors import InputError
from s2a.core.outputs import Output, atomic_write
from s2a.core.progress import StdoutFilter, track
from s2a.core.provenance import provenance
from s2a.homes.capture import AnnotationConfig
from s2a.homes.room import handle_of
from s2a.homes.sample import RoomKind, SampleConfig, sample
from s2a.homes.scanner import ScannerConfig
from s2a.learn.perception import depth_camera as cloud
from s2a.learn.perception.depth_camera import DepthCameraConfig, VisibleRoom
from s2a.motion.trajectory import PlannerConfig
from s2a.prepare.part import ALL
from s2a.prepare.room import PrepareConfig, prepare
from s2a.robot import Robot
from s2a.scene.usd import sim_stage
from s2a.sim.simulation import SimConfig
from s2a.sim.world import stage_of
from s2a.tasks import MdpSettings, pool, task


@dataclass(frozen=True)
class Config:
    """Keys of `s2a pool`.

    Attributes:
        rooms: kinds of rooms.
        first: first seed.
        count: how many seeds of each kind.
        homes: further rooms by kind and seed, kitchen_22.
        out: folder of the pool; rooms that are in it already are kept.
        jobs: rooms that are made at once.
        leave_out: families or styles of handles that are not taken.
        frames: of a depth camera that are taken of each part, for s2a perceive; 0: none.
        depth_camera: the camera that takes them.
        detail: the scanner of the rooms, as of s2a sample.
        annotator: the errors of their annotation, likewise.
        robot: the robot, as panda or baxter.
        prepare: how the scenes are prepared.
        sim: how physics is stepped where the parts are trained on: how fast a motion may be.
        task: what the robot has to do with each part.
        planner: the planner's motion.
    """

    rooms: tuple[RoomKind, ...]
    first: CountFromZero
    count: Count
    homes: tuple[str, ...]
    out: Output
    jobs: Count
    leave_out: tuple[str, ...]
    frames: CountFromZero
    depth_camera: DepthCameraConfig
    detail: ScannerConfig
    annotator: AnnotationConfig
    robot: Robot
    prepare: PrepareConfig
    sim: SimConfig
    task: MdpSettings
    planner: PlannerConfig


INDEX = "pool.json"
WHICH = ("rooms", "first", "count", "homes", "leave_out")
"""Keys that say which rooms and parts, not what a room is like."""
Made = dict[str, Any]
"""A room's entries, and why others of its parts are left out."""


def run(config: Config) -> str:
    """Make the rooms that are missing, write the index, and return what is in it."""
    specs = rooms_of(config)
    config.out.mkdir(parents=True, exist_ok=True)
    made = list(track(_all(config, specs), "rooms", len(specs)))
    parts = [pool.PoolPart(**entry) for room in made for entry in room["parts"]]
    entries = [part for part in parts if is_taken(part.handle, config)]
    left_out = {part: why for room in made for part, why in room["left_out"].items()}
    about = {key: getattr(config, key) for key in WHICH}
    pool.write(config.out / INDEX, entries, left_out, {**about, **provenance("cpu")})
    slides = sum(entry.kind == "prismatic" for entry in entries)
    return f"{config.out / INDEX}: {len(entries)} parts of {len(specs)} rooms, {slides} of them slide; {len(left_out)} left out"


def rooms_of(config: Config) -> list[tuple[RoomKind, int]]:
    """Return kind and seed of each room, once; InputError where there is none, or for a home that is none."""
    seeds = range(config.first, config.first + config.count)
    specs: dict[tuple[RoomKind, int], None] = dict.fromkeys((kind, seed) for seed in seeds for kind in config.rooms)
    for home in config.homes:
        kind, _, seed = home.rpartition("_")
        if kind not in get_args(RoomKind) or not seed.isdecimal():
            raise InputError(f"key 'homes' has {home!r}; give a kind of room and a seed, as kitchen_22")
        specs[cast(RoomKind, kind), int(seed)] = None
    if not specs:
        raise InputError("keys 'rooms' and 'homes' are empty; give one kind of room or more: rooms=[kitchen,office]")
    return list(specs)


def home_of(config: Config, kind: RoomKind, seed: int, out: Path) -> SampleConfig:
    """Return the settings of the scan of one home, all closed, which is written to a folder."""
    return SampleConfig(kind, seed, config.detail, config.annotator, None, 0, 0, out)


def is_taken(handle: str, config: Config) -> bool:
    """Return whether no handle of a part, "bar, knob", is of those that are left out."""
    return not set(handle.split(", ")) & set(config.leave_out)


def _all(config: Config, specs: list[tuple[RoomKind, int]]) -> Iterator[Made]:
    if config.jobs == 1:
        yield from map(partial(_quiet_room, config), specs)
        return
    with workers.processes(config.jobs) as helpers:
        yield from helpers.map(partial(_quiet_room, config), specs)


def _quiet_room(config: Config, spec: tuple[RoomKind, int]) -> Made:
    """Return a room's parts without a warning of each of its steps or what libraries print; both go on afterwards."""
    before = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        with contextlib.redirect_stdout(StdoutFilter()):  # a helper has none of its own
            return _room(config, spec)
    finally:
        logging.disable(before)


def _room(config: Config, spec: tuple[RoomKind, int]) -> Made:
    """Return a room's parts; scan, prepare and plan it unless that was done before."""
    kind, seed = spec
    name = f"{kind}_{seed}"
    done = config.out / f"{name}.json"
    if done.is_file():
        earlier: Made = json.loads(done.read_text())
        if earlier["settings"] != _settings(config):
            raise InputError(f"{done}: made with other settings; give another out, or delete that folder")
        return earlier
    file = config.out / f"{name}.usd"
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "scan"
        sample(home_of(config, kind, seed, place), place)
        scene = scan.read(place)
        truth = json.loads((place / "truth/truth.json").read_text())["parts"]
        room = prepare(scene, ALL, config.prepare, (), config.robot)
        with atomic_write(file) as out:  # without its visuals, which no training loads
            sim_stage.write(room, out, Path(folder) / "visuals.usd")
    made: Made = {"settings": _settings(config), "parts": [], "left_out": {}}
    visible = VisibleRoom(room) if config.frames else None
    for part, articulation in room.articulations.items():
        try:
            if not articulation.bases[config.robot.name].free:
                raise InputError("no base pose is free")
            motion = f"{name}_{part}.npz"
            path_of = partial(task(config.task.name).tool_path, config=config.task)
            planned = pool.planned(file, part, config.robot, config.sim, config.planner, path_of)
            with atomic_write(config.out / motion) as out:
                pool.save_motion(planned, out)
        except InputError as error:
            made["left_out"][f"{name}/{part}"] = str(error).removeprefix(f"{file}: ")
            continue
        facts = [truth[i] for i in scene.grasp_parts(part) if i in truth]
        handles = {style for one in facts if (style := handle_of(one))}
        handle = ", ".join(sorted(handles)) or "none"
        seen = ""
        if visible is not None:
            stage = stage_of(file, room, part, robot=config.robot.name)
            clouds = cloud.take(visible, stage, config.depth_camera, config.frames, seed)
            if not clouds:
                made["left_out"][f"{name}/{part}"] = "no camera frame shows it"
                continue
            seen = f"{name}_{part}_frames.npz"
            with atomic_write(config.out / seen) as out:
                cloud.save(clouds, out)
        made["parts"].append(asdict(pool.PoolPart(file.name, part, articulation.joint.kind, handle, motion, seen)))
    with atomic_write(done) as out:
        out.write_text(json.dumps(made, indent=1))
    return made


def _settings(config: Config) -> Any:
    """Return what a room depends on besides its kind and seed, as JSON reads it."""
    values = asdict(config)
    for key in (*WHICH, "out", "jobs"):
        values.pop(key)
    return json.loads(json.dumps(values, default=str))
