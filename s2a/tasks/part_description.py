"""A part as a policy observes it: numbers in the robot's base frame, of the truth of a stage or of an estimate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.robot.tool_path import matrices
from s2a.scene.articulation import opening_direction, opening_sign
from s2a.sim.world import SimStage

NUMBERS = 21
"""Length of a description as a vector."""
DIRECTIONS = (3, 6, 9, 12)
"""Where in it across, inwards, axis and along begin."""
SIDEWAYS = np.array([0.0, 0.3, 1.0])
"""Of the two directions across a handle, which differ by half a turn of the gripper, the one that points this way is taken."""


@dataclass(frozen=True)
class Description:
    """A part at its scanned pose, in the robot's base frame.

    Attributes:
        point: the grasp point [m], shape [3].
        across: the grasp frame's y, along which the fingers close, shape [3].
        inwards: its z, into the furniture, shape [3].
        axis: of the joint, positive opens, shape [3].
        along: the direction in which the grasp point moves first when the part opens, shape [3].
        size: extents of the grasp region along the grasp frame's axes [m], shape [3].
        slides: 1 for a slide, 0 for a hinge; of an estimate anything between.
        lever_arm: of a hinge [m], 0 for a slide.
        travel: path of the grasp point to the open limit [m].
    """

    point: np.ndarray
    across: np.ndarray
    inwards: np.ndarray
    axis: np.ndarray
    along: np.ndarray
    size: np.ndarray
    slides: float
    lever_arm: float
    travel: float

    def vector(self) -> np.ndarray:
        """Return the numbers in the order of the attributes, shape [NUMBERS], float32."""
        vectors = (self.point, self.across, self.inwards, self.axis, self.along, self.size)
        return np.concatenate([*vectors, [self.slides, self.lever_arm, self.travel]]).astype(np.float32)


def of_vector(numbers: np.ndarray) -> Description:
    """Return the description that `Description.vector` gave."""
    point, across, inwards, axis, along, size = numbers[:18].astype(float).reshape(6, 3)
    slides, lever_arm, travel = map(float, numbers[18:NUMBERS])
    return Description(point, across, inwards, axis, along, size, slides, lever_arm, travel)


def truth(stage: SimStage) -> Description:
    """Return the description of a stage's part."""
    to_base = np.linalg.inv(matrices(stage.base[None])[0])
    grasp = to_base @ matrices(stage.grasp[None])[0]
    across = grasp[:3, 1] * (1.0 if grasp[:3, 1] @ SIDEWAYS >= 0.0 else -1.0)
    turn, slides = to_base[:3, :3], stage.joint.kind == "prismatic"
    return Description(
        point=grasp[:3, 3],
        across=across,
        inwards=grasp[:3, 2],
        axis=turn @ (opening_sign(stage.joint) * np.array(stage.joint.axis)),
        along=turn @ opening_direction(stage.joint, stage.grasp[:3]),
        size=np.array(stage.grasp_size),
        slides=float(slides),
        lever_arm=0.0 if slides else stage.lever_arm,
        travel=stage.travel,
    )
