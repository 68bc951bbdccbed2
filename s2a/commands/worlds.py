"""The keys that training, evaluation and the benchmark share: the worlds, and what is done in them."""

from dataclasses import dataclass
from pathlib import Path

from s2a import tasks
from s2a.core.bounds import Count, CountFromZero
from s2a.core.errors import InputError
from s2a.motion.trajectory import PlannerConfig
from s2a.robot import Robot
from s2a.sim.simulation import SimConfig
from s2a.sim.world import SimStage
from s2a.tasks import MdpSettings, MetricSettings, pool


@dataclass(frozen=True)
class EpisodesConfig:
    """Worlds, and what is done in them.

    Attributes:
        stage: the sim.usd; or the index that `s2a pool` writes, *.json, of whose parts every world has one.
        num_envs: worlds that are stepped together; under torchrun, of each process.
        device: cpu, cuda:0, or auto: a GPU where there is one, and each process of torchrun its own.
        seed: seed of the start noise, and of a network that is trained.
        robot: the robot that the stage was prepared for, such as panda or baxter.
        sim: physics settings.
        task: task settings.
        metrics: thresholds of the metrics.
        planner: the planner's motion.
    """

    stage: Path
    num_envs: Count
    device: str
    seed: CountFromZero
    robot: Robot
    sim: SimConfig
    task: MdpSettings
    metrics: MetricSettings
    planner: PlannerConfig


@dataclass(frozen=True)
class WorldsConfig(EpisodesConfig):
    """Worlds of one part of a room, or of the parts of many.

    Attributes:
        part: id of the articulated part; null: the only one of the stage.
        also: ids of further articulated parts and free objects that move, or all; everything else is static.
    """

    part: str | None
    also: str | tuple[str, ...]

    @property
    def further(self) -> tuple[str, ...]:
        """The ids of `also`."""
        return (self.also,) if isinstance(self.also, str) else self.also

    def read_stages(self) -> list[SimStage]:
        """Read the stages of all parts; InputError as for one, or where a pool is to have one part."""
        kind = tasks.task(self.task.name)
        where = (self.stage, self.part, self.robot.name, self.further)
        return tasks.read_stages(kind, *where, self.task, self.planner)

    def read_stage(self) -> SimStage:
        """Read the stage; InputError for a wrong or unphysical one, or a robot that was changed on the command line."""
        if pool.is_index(self.stage):
            raise InputError(
                f"{self.stage} is the index of a pool, which s2a train and s2a evaluate take; give a sim.usd"
            )
        return self.read_stages()[0]
