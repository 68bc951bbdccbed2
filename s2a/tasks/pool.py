"""Parts of many rooms that are simulated together: an index of simulation-ready rooms, with a planned motion of each part."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from s2a.core.cache import UNREADABLE
from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write
from s2a.motion.open import Skill, demonstration
from s2a.motion.trajectory import Demonstration, PlannerConfig
from s2a.robot.spec import RobotSpec
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_read import refuse_unphysical
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import SimStage, read_stage, stage_of


@dataclass(frozen=True)
class PoolPart:
    """A part of a pool."""

    room: str  # its sim.usd, relative to the index
    part: str  # its id
    kind: str  # of its joint, prismatic or revolute
    # family or style of its handle, as the truth of a virtual scan says; of other scans: scanned, added or none
    handle: str
    motion: str  # file of the planner's motion, relative to the index


def entry_of(row: Mapping[str, str]) -> PoolPart:
    """Return the part of a row; those of earlier versions also name a file of camera frames."""
    return PoolPart(**{key: row[key] for key in row if key != "frames"})


def is_index(path: Path) -> bool:
    """Return whether a file is an index rather than a stage, by its name."""
    return path.suffix == ".json"


def write(path: Path, entries: Sequence[PoolPart], left_out: Mapping[str, str], about: Mapping[str, object]) -> None:
    """Write an index.

    Args:
        path: the index.
        entries: the parts.
        left_out: why others are not among them, by room and part.
        about: settings and versions.
    """
    content = {**about, "parts": [asdict(entry) for entry in entries], "left_out": dict(left_out)}
    with atomic_write(path) as out:
        out.write_text(json.dumps(content, indent=1) + "\n")


def read(path: Path) -> list[PoolPart]:
    """Return the parts of an index; InputError where it is none, or names no part."""
    if not path.is_file():
        raise InputError(
            f"{str(path)!r} does not exist; give a sim.usd, or the index that s2a pool or s2a dataset writes"
        )
    try:
        entries = [entry_of(row) for row in json.loads(path.read_text())["parts"]]
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: not an index of s2a pool ({error!r})") from error
    if not entries:
        raise InputError(f"{path}: has no parts; make a pool with more rooms")
    return entries


def stages(path: Path, robot: str) -> list[SimStage]:
    """Return the stages of an index's parts, in its order."""
    entries = read(path)
    rooms = {entry.room: None for entry in entries}
    for room in rooms:
        refuse_unphysical(path.parent / room)
    read_rooms = {room: sim_stage.read(path.parent / room, visuals=False) for room in rooms}
    return [stage_of(path.parent / each.room, read_rooms[each.room], each.part, robot=robot) for each in entries]


def planned(
    room: Path, part: str, robot: RobotSpec, sim: SimConfig, planner: PlannerConfig, tool_path: Skill
) -> Demonstration:
    """Return the planner's motion of a part of a simulation-ready room; InputError where the arm cannot reach along it."""
    return demonstration(Simulation(read_stage(room, part, robot=robot.name), sim, 1), planner, tool_path)


def save_motion(motion: Demonstration, path: Path) -> None:
    """Write a motion as an npz file."""
    np.savez_compressed(
        path,
        targets=motion.targets.astype(np.float32),
        positions=motion.positions.astype(np.float32),
        grasped=motion.grasped,
    )


def load_motion(path: Path) -> Demonstration:
    """Read a motion that `save` wrote; InputError where the file is none."""
    try:
        with np.load(path) as file:
            return Demonstration(file["targets"], file["positions"], int(file["grasped"]))
    except UNREADABLE as error:
        raise InputError(f"{path}: not a motion of s2a pool ({error}); make the pool again") from error


def motions(index: Path) -> list[Demonstration]:
    """Return the motions of a pool's parts, in its order; InputError where the index or one of them is damaged."""
    return [load_motion(index.parent / entry.motion) for entry in read(index)]
