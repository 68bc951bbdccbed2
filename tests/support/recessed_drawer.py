"""A drawer whose front has a recessed pull, as a scan shows it: flat sheets, all numbers known."""

from __future__ import annotations

import numpy as np
from box_room import joined, sheet

from s2a.scene.scene import Joint, Mesh, Part, Scene

HALF, HEIGHT = (0.2, 0.15), 0.6
"""[m] Half of the front's sides, and the height of its middle; its outer surface is x = 0, outwards is +x."""


def recessed_drawer(length: float = 0.13, width: float = 0.05, depth: float = 0.01) -> Scene:
    """Return a room with a drawer, whose pocket is so long, wide and deep [m]."""
    y, z, (b, c), h = length / 2, width / 2, HALF, HEIGHT
    up, along, cell = (0, 0, 1), (0, 1, 0), 0.005

    def plate(x: float, y0: float, y1: float, z0: float, z1: float) -> Mesh:
        return sheet((x, y0, z0), tuple(np.multiply(along, y1 - y0)), tuple(np.multiply(up, z1 - z0)), cell)

    front = joined(
        plate(0.0, -b, b, h - c, h - z), plate(0.0, -b, b, h + z, h + c), plate(0.0, -b, -y, h - z, h + z),
        plate(0.0, y, b, h - z, h + z),
    )  # fmt: skip
    inwards = (-depth, 0, 0)
    lining = joined(
        plate(-depth, -y, y, h - z, h + z),
        sheet((0, -y, h - z), (0, length, 0), inwards, cell / 2),
        sheet((0, -y, h + z), inwards, (0, length, 0), cell / 2),
        sheet((0, -y, h - z), inwards, (0, 0, width), cell / 2),
        sheet((0, y, h - z), (0, 0, width), inwards, cell / 2),
    )
    slide = Joint("prismatic", (1.0, 0.0, 0.0), (0.0, 0.0, h), (0.0, 0.4))
    parts = {
        "floor_1": Part("floor", sheet((-1, -1, 0), (3, 0, 0), (0, 2, 0))),
        "cabinet_2": Part("cabinet", Mesh(np.empty((0, 3)), np.empty((0, 3)))),
        "drawer_3": Part("drawer", front, "cabinet_2", slide),
        "handle_4": Part("handle", lining, "drawer_3", graspable=True),
    }
    return Scene("recessed", parts)
