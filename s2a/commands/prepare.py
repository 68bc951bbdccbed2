"""geometric.usd -> sim.usd: a simulation-ready room."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write
from s2a.prepare.refine import Refined, refine, sentence, with_joints
from s2a.prepare.refine_loss import RefineConfig
from s2a.prepare.room import ALL, PrepareConfig, prepare
from s2a.robot.spec import RobotSpec
from s2a.scene.usd import geometric, sim_stage
from s2a.scene.usd.sim_scene import Articulation, Reduction, SimRoom


@dataclass(frozen=True)
class Config:
    """Keys of `s2a prepare`.

    Attributes:
        stage: the geometric.usd.
        targets: articulated parts that a robot can move: all, the id of one such as drawer_7, or several; all others are frozen.
        free: ids of objects that lie about freely instead of being one with the room, such as [teddy_bear_12].
        out: the sim.usd to write; its visuals are written beside it.
        robot: the robot that is to move them.
        prepare: how the scene is prepared.
        refine_joints: Correct annotated joints by what the scan shows of their parts and furniture (docs/refinement.md).
        refine: how far furniture and annotations are trusted then.
    """

    stage: Path
    targets: str | tuple[str, ...]
    free: tuple[str, ...]
    out: Path
    robot: RobotSpec
    prepare: PrepareConfig
    refine_joints: bool
    refine: RefineConfig


def run(config: Config) -> str:
    """Read the stage, prepare its parts, write the room, and return what is in it.

    Raises:
        InputError: a part is not in the stage or does not move; an object cannot be extracted from the room.
    """
    if not config.targets:
        raise InputError(
            f"key 'targets' names no part; give targets={ALL}, targets=drawer_7 or targets=[drawer_6,drawer_7]"
        )
    start = time.perf_counter()
    scene = geometric.read(config.stage)
    refined = refine(scene, config.refine) if config.refine_joints else {}
    room = prepare(with_joints(scene, refined), config.targets, config.prepare, config.free, config.robot)
    room = _noted(room, refined)
    visuals = sim_stage.visuals_file(config.out)
    with atomic_write(visuals) as beside, atomic_write(config.out) as out:
        sim_stage.write(room, out, beside)
    sizes = " and ".join(f"{path.stat().st_size / 1e6:.2f} MB" for path in (config.out, visuals))
    head = f"{config.out}, {visuals.name}: {_count(room)}; {sizes}, {time.perf_counter() - start:.1f} s"
    return "\n".join([head, *map(_said, room.reductions), *(f"  {note}" for note in room.notes), *_lines(room)])


def _noted(room: SimRoom, refined: Mapping[str, Refined]) -> SimRoom:
    """Return a room that says of its refined joints how far they were moved."""
    noted = {
        part: replace(
            articulation,
            refinement=refined[part].change,
            notes=(*articulation.notes, sentence(part, refined[part].change)),
        )
        for part, articulation in room.articulations.items()
        if part in refined
    }
    return replace(room, articulations=room.articulations | noted)


def _count(room: SimRoom) -> str:
    hulls = sum(len(body.colliders) for body in room.bodies.values())
    return (
        f"{len(room.articulations)} articulated parts, {len(room.free)} free objects, "
        f"{hulls} convex hulls of furniture, {len(room.static_colliders)} of the room"
    )


def _lines(room: SimRoom) -> list[str]:
    """Return a line for each part and free object, and its notes."""
    lines = []
    for part, articulation in room.articulations.items():
        lines.append(
            f"  {part} on {articulation.parent}: {len(room.bodies[part].colliders)} hulls; {_stands(articulation)}"
        )
        lines += [f"    {note}" for note in articulation.notes]
    for body in room.free.values():
        lines.append(f"  {body.id} is free: {body.mass.mass:.2f} kg ({body.mass.source}), {len(body.colliders)} hulls")
    return lines


def _stands(articulation: Articulation) -> str:
    """Return the base poses of the robots, and whether they are free of collisions."""
    words = (
        f"{name}: {base.reason}"
        if base.free
        else f"warning: no base pose is free for {name}; nearest one: {base.reason}"
        for name, base in articulation.bases.items()
    )
    return "; ".join(words)


def _said(reduction: Reduction) -> str:
    """Return what decimation did to a group of surfaces, and whether it kept to what was asked."""
    missed = "" if reduction.reached else f", though {reduction.asked} were asked for"
    return (
        f"  {reduction.group}: {reduction.after} of {reduction.before} faces{missed}; "
        f"off by {1e3 * reduction.mean:.2f} mm on average, {1e3 * reduction.p99:.2f} mm at 99 %"
    )
