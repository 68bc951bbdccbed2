"""sim.usd -> the same room for other simulators."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from s2a.certify.convert import mjcf, urdf
from s2a.certify.convert.links import LinkedRoom, read_links
from s2a.core.outputs import atomic_write, refuse_loss
from s2a.scene.usd.sim_read import refuse_unphysical
from s2a.sim.solver import SimConfig

WRITERS = {"mjcf": mjcf, "urdf": urdf}


@dataclass(frozen=True)
class Config:
    """Keys of `s2a convert`.

    Attributes:
        stage: the sim.usd.
        out: folder that receives room.xml or room.urdf, and the meshes.
        to: format.
        parts: articulated parts and free objects that move: all, the id of one, or several; all others are frozen.
        sim: how physics is stepped here; the joint's spring and damping, the time step and the solver's settings are handed on.
    """

    stage: Path
    out: Path
    to: Literal["mjcf", "urdf"]
    parts: str | tuple[str, ...]
    sim: SimConfig


def run(config: Config) -> str:
    """Write the room in another format; return what is in it.

    Raises:
        InputError: no simulation-ready stage; an id that cannot move; `out` is a file, or a folder of something else.
    """
    writer = WRITERS[config.to]
    refuse_loss(config.out, writer.FILE, [config.stage])
    refuse_unphysical(config.stage)
    linked = read_links(config.stage, config.parts, config.sim)
    with atomic_write(config.out, writer.FILE) as folder:
        folder.mkdir()
        writer.write(linked, config.sim, folder)
    return "\n".join([f"{config.out / writer.FILE}: {_count(linked)}", *_lost(config, linked)])


def _count(linked: LinkedRoom) -> str:
    jointed = sum(i in linked.room.articulations for i in linked.active)
    hulls = sum(len(link.colliders) for link in linked.links.values())
    surfaces = sum(len(link.visuals) for link in linked.links.values())
    return (
        f"{jointed} articulated parts and {len(linked.active) - jointed} free objects move; "
        f"{hulls} convex hulls, {surfaces} surfaces"
    )


def _lost(config: Config, linked: LinkedRoom) -> list[str]:
    """Return a line about what URDF cannot hold."""
    if config.to != "urdf":
        return []
    joint = config.sim.joint
    unit = "N/m at the grasp point" if joint.spring == "grasp" else "N/m or N m/rad"
    lines = [f"  {urdf.PAIRS}: {len(linked.filtered())} pairs of links that do not collide"]
    if joint.stiffness:
        lines.append(
            f"  without the spring of {joint.stiffness:g} {unit} that closes each part, which URDF cannot hold"
        )
    return lines
