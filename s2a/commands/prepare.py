"""geometric.usd and a jointed part -> sim.usd."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from s2a.errors import InputError
from s2a.outputs import atomic_write
from s2a.prepare import PrepareConfig, prepare
from s2a.prepare.target import target_joint
from s2a.robot.spec import RobotSpec
from s2a.usd import geometric, sim_stage
from s2a.usd.sim_scene import Reduction, SimScene


@dataclass(frozen=True)
class Config:
    """Keys of `s2a prepare`.

    Attributes:
        stage: the geometric.usd.
        target: id of the part that the robot is to move, such as drawer_7, or several of them: a stage for each.
        free: ids of objects that lie about freely instead of being one with the room, such as [teddy_bear_12].
        out: the sim.usd to write; for several targets a folder, in which each becomes <target>.usd.
        robot: the robot that is to move it.
        prepare: how the scene is prepared.
    """

    stage: Path
    target: str | tuple[str, ...]
    free: tuple[str, ...]
    out: Path
    robot: RobotSpec
    prepare: PrepareConfig


def run(config: Config) -> str:
    """Read the stage, prepare every target, write its sim.usd, and return what is in it.

    Raises:
        InputError: no target is named, or one is not in the stage or does not move.
    """
    if not config.target:
        raise InputError("key 'target' names no part; give target=drawer_7 or target=[drawer_6,drawer_7]")
    scene = geometric.read(config.stage)
    if isinstance(config.target, str):
        return _write(prepare(scene, config.target, config.prepare, config.free, config.robot), config.out)
    for target in config.target:
        target_joint(scene, target)  # one that cannot move is refused before the first is worked on
    made = ((i, prepare(scene, i, config.prepare, config.free, config.robot)) for i in config.target)
    return "\n".join(_write(one, config.out / f"{i}.usd") for i, one in made)


def _write(scene: SimScene, path: Path) -> str:
    """Write a scene and return what is in it."""
    with atomic_write(path) as out:
        sim_stage.write(scene, out)
    moving, room = len(scene.target.colliders), len(scene.static_colliders)
    lines = [f"{path}: {scene.target.id} on {scene.carcass.id}; {moving} convex pieces, the room {room}"]
    lines += [_told(reduction) for reduction in scene.reductions]
    robot = "robot" if scene.base_free else "warning: no base pose is free; nearest one"
    lines += [f"  {robot}: {scene.base_reason}", *(f"  {note}" for note in scene.notes)]
    lines += [
        f"  {b.id} lies free: {b.mass.mass:.2f} kg ({b.mass.source}), {len(b.colliders)} pieces" for b in scene.free
    ]
    return "\n".join(lines)


def _told(reduction: Reduction) -> str:
    """Return what decimation did to a group of surfaces, and whether it kept to what was asked."""
    missed = "" if reduction.reached else f", though {reduction.asked} were asked for"
    return (
        f"  {reduction.group}: {reduction.after} of {reduction.before} faces{missed}; "
        f"off by {1e3 * reduction.mean:.2f} mm on average, {1e3 * reduction.p99:.2f} mm at 99 %"
    )
