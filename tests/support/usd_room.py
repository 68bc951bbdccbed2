"""A hand-made room with every case that the USD flavours have to hold."""

from __future__ import annotations

import math

import numpy as np
import trimesh

from s2a.scene.scene import Joint, Mesh, Part, Scene

DIRTY = "hande \"base\"\n\\ $é\u0301 書 ''' \x01\t."
"""A label as nobody should write one."""


def box(center: tuple[float, float, float], size: tuple[float, float, float], seed: int | None = None) -> Mesh:
    """Return a box; with a seed, each of its vertices has a colour of its own."""
    mesh = trimesh.creation.box(size)
    colors = None if seed is None else np.random.default_rng(seed).integers(0, 256, (8, 3), dtype=np.uint8)
    return Mesh(mesh.vertices + np.asarray(center), mesh.faces, colors)


def unit(x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return a direction of unit length."""
    length = math.hypot(x, y, z)
    return (x / length, y / length, z / length)


def room() -> Scene:
    """Return a cabinet with a drawer (which carries a flap) and an empty door; a lone door, a cup, odd leftovers."""
    none, no_faces = np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32)
    slide = Joint("prismatic", unit(1.0, 0.02, 0.003), (1.25, 1.0, 0.5), (-0.01, 0.4))
    drop = Joint("revolute", unit(1e-4, -1.0, 2e-4), (1.26, 1.0, 0.55), (0.0, math.pi / 2))
    swing = Joint("revolute", (0.0, 0.0, -1.0), (-1.45 + 1e-9, 0.1, 1.0 / 3.0), (-0.2, 1.5707))
    backwards = Joint("revolute", (-1.0, 0.0, 0.0), (0.9, 1.0, 0.2), (0.0, 1.0))
    parts = {
        "wall_1": Part("wall", box((0, 2, 1), (4, 0.1, 2), seed=1)),
        "picture_2": Part(DIRTY, box((0, 1.94, 1), (0.4, 0.02, 0.3), seed=2), "wall_1"),
        "cabinet_3": Part("cabinet", box((1, 1, 0.5), (0.5, 0.5, 1), seed=3), mass=21.123456789012345),
        "drawer_7": Part("drawer", box((1.26, 1, 0.5), (0.02, 0.4, 0.2), seed=7), "cabinet_3", slide),
        "handle_base_8": Part("handle base", box((1.28, 1, 0.5), (0.02, 0.1, 0.02), seed=8), "drawer_7"),
        "handle_9": Part("handle", box((1.3, 1, 0.5), (0.01, 0.2, 0.02), seed=9), "handle_base_8", graspable=True),
        "flap_10": Part("flap", box((1.26, 1, 0.58), (0.01, 0.2, 0.05)), "drawer_7", drop, graspable=True),
        "door_20": Part("door", box((-1, 0.1, 1), (0.9, 0.04, 2), seed=20), None, swing),
        "door_21": Part("door", Mesh(none, no_faces, none), "cabinet_3", backwards),
        "cup_22": Part("cup", box((0, 0, 1), (0.1, 0.1, 0.1)), None, "free", mass=0.2),
        "crumbs_23": Part("crumbs", Mesh(np.arange(9.0).reshape(3, 3) / 7, no_faces), "cabinet_3"),
        "書_24": Part("", Mesh(none, no_faces)),
    }
    return Scene("036bce3393", parts, (3.5e5, 5.6e6 + 0.1, -0.123456789))
