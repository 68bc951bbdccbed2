"""Command `s2a prepare`: turn a geometric stage into a simulation-ready one."""

import time

from s2a.prepare.room import PrepareSettings, prepare_stage
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import Articulation, Reduction, SimRoom

Config = PrepareSettings


def run(config: Config) -> str:
    """Read the stage, prepare its parts, write the room, and return what is in it.

    Raises:
        InputError: a part is not in the stage or does not move; an object cannot be extracted from the room.
    """
    start = time.perf_counter()
    room = prepare_stage(config)
    visuals = sim_stage.visuals_file(config.out)
    sizes = " and ".join(f"{path.stat().st_size / 1e6:.2f} MB" for path in (config.out, visuals))
    head = f"{config.out}, {visuals.name}: {_count(room)}; {sizes}, {time.perf_counter() - start:.1f} s"
    return "\n".join([head, *map(_said, room.reductions), *(f"  {note}" for note in room.notes), *_lines(room)])


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
    missed = "" if reduction.reached else f", though {reduction.asked} were requested"
    return (
        f"  {reduction.group}: {reduction.after} of {reduction.before} faces{missed}; "
        f"off by {1e3 * reduction.mean:.2f} mm on average, {1e3 * reduction.p99:.2f} mm at 99 %"
    )
