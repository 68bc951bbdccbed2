"""How the planner opens a part: to its handle, then with it along its joint."""

from __future__ import annotations

from s2a.robot.tool_path import PathSettings, ToolPath, opening_coordinate, part_path
from s2a.sim.world import SimStage


def tool_path(stage: SimStage, motion: PathSettings, config: object = None) -> ToolPath:  # noqa: ARG001
    """Return the tool path that opens a stage's part by `motion.opening` [m], or by 95 % of its travel."""
    end = opening_coordinate(stage.joint, stage.grasp[:3], motion.opening)
    return part_path(stage.joint, stage.grasp, motion.approach, end, motion.depth)
