"""A part, what resists it, and the arm that pulls it, as a simulation has them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.joints.moving_body import Moving, moving
from s2a.planner.arm import Arm, arm_along
from s2a.robot.tool_path import ToolPath
from s2a.scene.usd.resistance import Resistance, SoftClose
from s2a.sim.simulation import Simulation


@dataclass(frozen=True)
class Pulled:
    """A part and the arm that pulls it.

    Attributes:
        body: with the stage's mass.
        dynamics: what resists at its grasp point, as joint_kernels.PARAMETERS name it.
        arm: the arm along the part's path.
        offset: how much farther than predicted an earlier pull of the part ended [m]: a grip off the handle's middle bends the
            arm.
        closing: The path leads from the goal's distance to shut, else from shut to the goal; openings are along it.
    """

    body: Moving
    dynamics: tuple[float, ...]
    arm: Arm
    offset: float = 0.0
    closing: bool = False

    @property
    def goal(self) -> float:
        """How far the part shall go [m]."""
        return float(self.arm.path[-1])


def pulled(sim: Simulation, path: ToolPath, arm: np.ndarray, offset: float = 0.0) -> Pulled:
    """Return the target of a simulation's stage, of which a joint path [pose arm] follows a tool path.

    Its dynamics are the simulation's own: those identified where the stage has them.
    """
    stage, config = sim.stage, sim.config.joint
    part, body = stage.room.articulations[stage.target], moving(stage.room, stage.target)
    damping, spring = (x / body.lever**2 for x in (config.joint_damping(part), config.joint_stiffness(part)))
    known, lever = part.resistance or Resistance(), abs(body.lever)
    soft = known.soft_close or SoftClose(0.0, 0.0, 0.0)
    dry = (part.friction / lever, known.breakaway / lever)
    dynamics = (1.0, damping, *dry, spring, soft.force / lever, soft.damping / lever**2)
    closing = abs(float(path.q[-1])) < abs(float(path.q[path.grasp]))
    return Pulled(body, dynamics, arm_along(sim, path, arm), offset, closing)
