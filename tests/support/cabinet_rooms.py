"""A hand-made room for tests: a cabinet with the dimensions of the Sektion cabinet of the reference task."""

from __future__ import annotations

import numpy as np
import trimesh

from s2a.scene.scene import Joint, Mesh, Part, Scene

CABINET_HEIGHT = 0.4
"""[m] of the cabinet's middle above the floor; the upper bar then lies at 0.727 m."""


def box(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> trimesh.Trimesh:
    """Return an axis-parallel box from its ranges [m]."""
    return trimesh.creation.box(bounds=np.array([x, y, z]).T)


def clean_cabinet_room(yaw: float = 0.0) -> Scene:
    """Return a room of clean solids: floor, two walls, a table and the cabinet, which opens along +x turned by yaw
    [rad]."""
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1.0]])
    parts = {
        "wall_1": _part(
            "wall", turn, [box((-0.37, -0.33), (-2, 2), (0, 2.5)), box((-0.37, 2.5), (-2.04, -2), (0, 2.5))]
        ),
        "floor_2": _part("floor", turn, [box((-0.37, 2.5), (-2, 2), (-0.05, 0))]),
        "cabinet_3": _part("cabinet", turn, _shifted(_cabinet_body())),
        "table_4": _part("table", turn, [box((0.2, 0.9), (0.8, 1.6), (0.70, 0.74)), *_legs()], color=(150, 100, 60)),
    }
    for number, height in ((7, 0.3172), (8, 0.18795)):
        joint = Joint(
            "prismatic", tuple(turn @ [1.0, 0, 0]), tuple(turn @ [0.0515, 0, CABINET_HEIGHT + height]), (0, 0.4)
        )
        parts[f"drawer_{number}"] = _part("drawer", turn, _shifted(_drawer(), height), "cabinet_3", joint)
        handle = _part("handle", turn, _shifted(_handle(), height), f"drawer_{number}", color=(40, 40, 45))
        parts[f"handle_{number + 4}"] = Part(handle.label, handle.mesh, handle.parent, "fixed", True)
    for number, side in ((5, 1), (6, -1)):
        hinge = turn @ [0.3162, side * 0.3757, CABINET_HEIGHT - 0.12973]
        limits = (0.0, 1.57) if side > 0 else (-1.57, 0.0)
        panel = box((0.306, 0.326), sorted((side * 0.002, side * 0.38)), (-0.381, 0.122))
        knob = trimesh.creation.cylinder(
            0.015, 0.0265, transform=trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0])
        )
        knob.apply_translation([0.339, side * 0.05, 0.06])
        joint = Joint("revolute", (0.0, 0.0, 1.0), tuple(hinge), limits)
        parts[f"door_{number}"] = _part("door", turn, _shifted([panel]), "cabinet_3", joint)
        handle = _part("knob", turn, _shifted([knob]), f"door_{number}", color=(40, 40, 45))
        parts[f"knob_{number + 10}"] = Part(handle.label, handle.mesh, handle.parent, "fixed", True)
    return Scene("sektion", parts)


def _part(label, turn, solids, parent=None, motion="fixed", color=(200, 190, 175)) -> Part:  # noqa: ANN001
    mesh = trimesh.util.concatenate(solids)
    colors = np.tile(np.array(color, np.uint8), (len(mesh.vertices), 1))
    return Part(label, Mesh(mesh.vertices @ turn.T, mesh.faces, colors), parent, motion)


def _shifted(solids: list[trimesh.Trimesh], height: float = 0.0) -> list[trimesh.Trimesh]:
    """Move solids from the cabinet's frame (and up by `height`) into the room's."""
    return [solid.copy().apply_translation([0, 0, CABINET_HEIGHT + height]) for solid in solids]


def _cabinet_body() -> list[trimesh.Trimesh]:
    return [
        box((-0.305, -0.286), (-0.381, 0.381), (-0.381, 0.381)),
        box((-0.305, 0.305), (0.362, 0.381), (-0.381, 0.381)),
        box((-0.305, 0.305), (-0.381, -0.362), (-0.381, 0.381)),
        box((-0.305, 0.305), (-0.381, 0.381), (-0.381, -0.362)),
        box((-0.2848, 0.3248), (-0.381, 0.381), (0.382, 0.402)),
    ]


def _drawer() -> list[trimesh.Trimesh]:
    """Return front panel and tray in the frame of the drawer joint, whose origin lies at x 0.0515."""
    solids = [
        box((0.2542, 0.2732), (-0.3794, 0.3794), (-0.0619, 0.0619)),
        box((-0.2575, 0.2542), (0.3456, 0.3496), (-0.0429, 0.0429)),
        box((-0.2575, 0.2542), (-0.3496, -0.3456), (-0.0429, 0.0429)),
        box((-0.2575, -0.2535), (-0.3496, 0.3496), (-0.0429, 0.0429)),
        box((-0.2575, 0.2542), (-0.3496, 0.3496), (-0.0429, -0.0409)),
    ]
    return [solid.apply_translation([0.0515, 0, 0]) for solid in solids]


def _handle() -> list[trimesh.Trimesh]:
    solids = [box((0.2971, 0.3113), (-0.0841, 0.0841), (-0.0024, 0.0214))]
    solids += [box((0.2732, 0.2971), sorted((s * 0.049, s * 0.0841)), (-0.0024, 0.0214)) for s in (1, -1)]
    return [solid.apply_translation([0.0515, 0, 0]) for solid in solids]


def _legs() -> list[trimesh.Trimesh]:
    return [box((x, x + 0.05), (y, y + 0.05), (0, 0.70)) for x in (0.2, 0.85) for y in (0.8, 1.55)]
