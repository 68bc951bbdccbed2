"""Command `s2a optimize`: find the best time law with which an arm pulls a part, by gradient."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path

from s2a import tasks
from s2a.core.errors import InputError
from s2a.core.outputs import Output, atomic_write
from s2a.joints.pull_optimize import PullConfig, optimize
from s2a.joints.pulled import pulled
from s2a.motion import trajectory
from s2a.motion.open import planned_path
from s2a.motion.trajectory import PlannerConfig
from s2a.robot import Robot
from s2a.scene.usd.sim_read import refuse_unphysical
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import read_stage

KNOTS = 6  # Four coefficients are bound by rest at both ends


@dataclass(frozen=True)
class Config:
    """Keys of `s2a optimize`.

    Attributes:
        stage: the sim.usd, or the layer of s2a identify over it.
        part: id of the articulated part; null: the only one of the stage.
        out: the file to write, for `planner.pull_law`.
        offset: distance by which an earlier pull of the part ended beyond its prediction [m].
        robot: the robot that the stage was prepared for, such as panda or baxter.
        sim: physics settings: resistance where nothing was identified, gains and limits of the arm.
        task: task settings: a part is opened by the planner's opening, or closed from the start of an episode.
        planner: the planner's motion.
        pull: costs and bounds of the pull.
    """

    stage: Path
    part: str | None
    out: Output
    offset: float
    robot: Robot
    sim: SimConfig
    task: tasks.MdpSettings
    planner: PlannerConfig
    pull: PullConfig


def run(config: Config) -> str:
    """Optimise a pull, write its time law, and say what the model predicts."""
    low, high = config.pull.min_seconds, config.pull.max_seconds
    if low > high:
        raise InputError(
            f"keys 'pull.min_seconds' ({low}) and 'pull.max_seconds' ({high}): the first is above the second"
        )
    if config.pull.knots < KNOTS:
        raise InputError(
            f"key 'pull.knots' is {config.pull.knots}; a set-point's spline has {KNOTS} coefficients or more"
        )
    refuse_unphysical(config.stage)
    stage = read_stage(config.stage, config.part, robot=config.robot.name)
    sim = Simulation(stage, config.sim, 1)
    tool_path = partial(tasks.task(config.task.name).tool_path, config=config.task)
    target = pulled(sim, *planned_path(sim, config.planner, tool_path, exact=True), config.offset)
    (optimum,), rounds = optimize([target], config.pull)
    with atomic_write(config.out) as out:
        trajectory.write(optimum.law, out)
    end = min(round(optimum.law.seconds * config.pull.rate), len(optimum.opening) - 1)
    missed = 1e3 * (optimum.opening[end] + config.offset - optimum.law.goal)
    lines = [
        f"{config.out}: pull of {stage.target} in {rounds} evaluations",
        f"  {optimum.law.goal:.3f} m in {optimum.law.seconds:.2f} s, with {optimum.force.max():.1f} N at most",
        f"  predicted to end {missed:+.1f} mm from the goal, at {1e3 * optimum.speed[end]:.1f} mm/s",
    ]
    return "\n".join(lines)
