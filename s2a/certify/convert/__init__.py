"""A simulation-ready room for other simulators: MJCF for MuJoCo, URDF for PyBullet, ROS, SAPIEN and Drake.

Both formats are written from the same Newton model (`s2a.certify.convert.links`), so that what is frozen, cut and filtered is
what the simulation here has.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from s2a.certify.convert import mjcf, urdf
from s2a.certify.convert.links import LinkedRoom, read_links
from s2a.core.outputs import Output, atomic_write, refuse_loss
from s2a.scene.usd.sim_read import refuse_unphysical
from s2a.sim.solver import SimConfig

WRITERS = {"mjcf": mjcf, "urdf": urdf}
"""Formats by name; FILE of each is the file to load."""


@dataclass(frozen=True)
class ConvertSettings:
    """Keys of `s2a convert`: what is written, and how.

    Attributes:
        stage: the sim.usd.
        out: folder that receives room.xml or room.urdf, and the meshes.
        to: format.
        parts: articulated parts and free objects that move: all, the id of one, or several; all others are frozen.
        sim: physics settings; the joint's spring and damping, the time step and the solver's settings are exported.
    """

    stage: Path
    out: Output
    to: Literal["mjcf", "urdf"]
    parts: str | tuple[str, ...]
    sim: SimConfig


def convert(settings: ConvertSettings) -> LinkedRoom:
    """Write the room of a sim.usd in another format into a folder, which replaces an earlier one; return its links.

    Raises:
        InputError: no simulation-ready stage; an id that cannot move; `out` is a file, or a folder of something else.
    """
    writer = WRITERS[settings.to]
    refuse_loss(settings.out, writer.FILE, [settings.stage])
    refuse_unphysical(settings.stage)
    linked = read_links(settings.stage, settings.parts, settings.sim)
    with atomic_write(settings.out, writer.FILE) as folder:
        folder.mkdir()
        writer.write(linked, settings.sim, folder)
    return linked
