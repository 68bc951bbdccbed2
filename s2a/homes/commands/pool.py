"""Command `s2a pool`: prepare the parts of many virtual rooms, to train one policy on all."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, cast, get_args

from s2a.core.bounds import Count, CountFromZero
from s2a.core.errors import InputError
from s2a.core.outputs import Output
from s2a.homes.capture import AnnotationConfig
from s2a.homes.room import handle_of
from s2a.homes.sample import RoomKind, SampleConfig, sample
from s2a.homes.scanner import ScannerConfig
from s2a.learn import rooms
from s2a.learn.rooms import Timed
from s2a.motion.trajectory import PlannerConfig
from s2a.prepare.room import PrepareConfig
from s2a.robot import Robot
from s2a.scene.scene import Scene
from s2a.sim.simulation import SimConfig
from s2a.tasks import MdpSettings


@dataclass(frozen=True)
class Config:
    """Keys of `s2a pool`.

    Attributes:
        rooms: kinds of rooms.
        first: first seed.
        count: number of seeds of each kind.
        homes: further rooms by kind and seed, such as kitchen_22.
        scans: further rooms, not virtual: annotated folders of scans, or patterns of them as DIR/*.
        out: folder of the pool; rooms that are in it already are kept.
        jobs: rooms that are made at once.
        leave_out: families or styles of handles to leave out.
        visuals: Write what cameras see of the rooms, too, for s2a perceive and policies with depth cameras.
        detail: the scanner of the rooms, as of s2a sample.
        annotator: the errors of their annotation, likewise.
        robot: the robot, such as panda or baxter.
        prepare: preparation of the scenes.
        sim: physics settings of the training, which bound the speed of motions.
        task: task settings.
        planner: the planner's motion.
    """

    rooms: tuple[RoomKind, ...]
    first: CountFromZero
    count: Count
    homes: tuple[str, ...]
    scans: tuple[str, ...]
    out: Output
    jobs: Count
    leave_out: tuple[str, ...]
    visuals: bool
    detail: ScannerConfig
    annotator: AnnotationConfig
    robot: Robot
    prepare: PrepareConfig
    sim: SimConfig
    task: MdpSettings
    planner: PlannerConfig


# Keys that say which rooms and parts, not what a room is like
WHICH = ("rooms", "first", "count", "homes", "scans", "leave_out")


def run(config: Config) -> str:
    """Make the rooms that are missing or failed, write the index, and return what is in it; InputError where no part is."""
    scans = rooms.captures_of(config.scans) if config.scans else {}
    jobs: list[rooms.RoomJob] = [HomeJob(config, kind, seed) for kind, seed in rooms_of(config)]
    jobs += [PoolJob(config, name, path) for path, name in scans.items()]
    about = {key: getattr(config, key) for key in WHICH}
    rows = rooms.make(jobs, config.out, config.jobs)
    return rooms.write_index(config.out, rows, about, lambda part: is_taken(part.handle, config))


def rooms_of(config: Config) -> list[tuple[RoomKind, int]]:
    """Return kind and seed of each room, once; InputError where there is none, or for a home that is none."""
    seeds = range(config.first, config.first + config.count)
    specs: dict[tuple[RoomKind, int], None] = dict.fromkeys((kind, seed) for seed in seeds for kind in config.rooms)
    for home in config.homes:
        kind, _, seed = home.rpartition("_")
        if kind not in get_args(RoomKind) or not seed.isdecimal():
            raise InputError(f"key 'homes' has {home!r}; give a kind of room and a seed, as kitchen_22")
        specs[cast(RoomKind, kind), int(seed)] = None
    if not specs and not config.scans:
        raise InputError(
            "keys 'rooms', 'homes' and 'scans' are empty; give a kind of room or more: rooms=[kitchen,office]"
        )
    return list(specs)


def home_of(config: Config, kind: RoomKind, seed: int, out: Path) -> SampleConfig:
    """Return the settings of the scan of one home, all closed, which is written to a folder."""
    return SampleConfig(kind, seed, config.detail, config.annotator, None, 0, 0, out)


def is_taken(handle: str, config: Config) -> bool:
    """Return whether no handle of a part, "bar, knob", is of those that are left out."""
    return not set(handle.split(", ")) & set(config.leave_out)


class PoolJob(rooms.RoomJob):
    """An annotated scan on its way to parts of a pool."""

    ROOMS: ClassVar[tuple[str, ...]] = (*WHICH, "out", "jobs")
    config: Config  # the command's keys

    def __init__(self, config: Config, name: str, source: Path | str) -> None:
        """Begin a row with nothing made."""
        super().__init__(config, name, source)
        self.visuals = config.visuals


class HomeJob(PoolJob):
    """A virtual home on its way to parts of a pool; its scan is not stored."""

    def __init__(self, config: Config, kind: RoomKind, seed: int) -> None:
        """Begin a row with nothing made."""
        super().__init__(config, f"{kind}_{seed}", f"virtual {kind}, seed {seed}")
        self.kind, self.home_seed = kind, seed

    def scanned(self, timed: Timed, temporary: Path) -> Path:
        """Sample the home into the temporary folder."""
        place = temporary / "scan"
        with timed("sample"):
            sample(home_of(self.config, self.kind, self.home_seed, place), place)
        return place

    def handles(self, scene: Scene, place: Path) -> dict[str, str]:
        """Return by part the families or styles of its handles, of the truth: "bar, knob"."""
        truth = json.loads((place / "truth/truth.json").read_text())["parts"]
        styles = {
            part: {style for i in scene.grasp_parts(part) if i in truth and (style := handle_of(truth[i]))}
            for part in scene.movable
        }
        return {part: ", ".join(sorted(some)) or "none" for part, some in styles.items()}
