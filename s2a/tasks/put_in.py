"""Putting a free object into an articulated part: open it, put the object in, shut it."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp
from scipy.spatial.transform import Rotation

from s2a.core.bounds import Fraction, Positive
from s2a.motion import put_in
from s2a.motion.places import at_zero
from s2a.motion.trajectory import Trajectory
from s2a.scene.articulation import lever_arm, travel
from s2a.sim.contacts import query_mesh
from s2a.sim.world import SimStage
from s2a.tasks.base import Instruction, Results, terms
from s2a.tasks.mdp import carrying, observations, rewards
from s2a.tasks.pick_place import PickPlace, PickPlaceConfig, PickPlaceMetrics
from s2a.tasks.state import watch_others


@dataclass(frozen=True)
class PutInConfig(PickPlaceConfig):
    """The decision process; `start` is that of `PickPlaceConfig`, `place` the id of the part into which the object is put.

    Attributes:
        opening: opening of the part as the path of its grasp point [m]; 95 % of the travel where that is less.
        closed_fraction: fraction of its travel up to which the part counts as closed.
    """

    opening: Positive
    closed_fraction: Fraction


@dataclass(frozen=True)
class PutInMetrics(PickPlaceMetrics):
    """Thresholds of what is reported.

    Attributes:
        min_ride: minimum path of the part towards closed with the object in it, untouched by the robot [m].
    """

    min_ride: Positive


class PutIn(PickPlace):
    """Put the object of every world into its part."""

    Config, Metrics = PutInConfig, PutInMetrics
    INSTRUCTION = Instruction(
        "put the {part} into the {into}",
        takes=("object", "part"),
        needs="Opens the part, puts the free object in, and shuts it again, all by itself: the part must be shut before, and "
        "needs no open or close. Parts that slide have a floor; parts that turn hardly ever do.",
        begins="shut",
        leaves="shut",
    )
    REWARDS = {
        **terms(rewards.distance, rewards.pinch, rewards.place),
        "stored": rewards.rest,
        "action": rewards.action,
    }
    OBSERVATIONS = {"": (*observations.OBJECT, observations.container_coordinate)}
    RESULTS = Results(
        rates={
            "success": carrying.success,
            "stored": carrying.placed,
            **terms(
                carrying.carried,
                carrying.released_at_rest,
                carrying.shut_with_it,
                carrying.undisturbed,
                carrying.grasped,
            ),
        },
        values=terms(
            carrying.remaining,
            carrying.position_error,
            carrying.angle_error,
            carrying.carried_fraction,
            carrying.drift,
            carrying.disturbance,
        ),  # fmt: skip
        logged=("success", "stored", "carried", "grasped"),
        success="success",
        version=3,
    )
    Stage: ClassVar[type[SimStage]] = put_in.PutStage

    read_stage = staticmethod(put_in.read_stage)

    def trajectory(self, settings: Any) -> Trajectory:
        """Return the planned trajectory."""
        assert isinstance(self.sim.stage, put_in.PutStage)
        return put_in.trajectory(self.sim, self.sim.stage, settings)

    def bind(self) -> None:
        """Set the part as the container of the place: its inside, and the place with the part at zero."""
        super().bind()
        sim, stage = self.sim, self.sim.stage
        assert isinstance(stage, put_in.PutStage)
        part, place = stage.room.articulations[stage.part], self.world.place
        point, inside = np.array(part.grasp.point), stage.put.inside
        goal = at_zero(stage.room, stage.part, stage.goal, stage.opened)
        self.surfaces.append(query_mesh(stage.surface))
        place.container, place.hulls = sim.body(stage.part), self.surfaces[1].id
        place.coord = sim.axis_of(stage.part)[0]
        place.lever = lever_arm(part.joint, point)
        place.shut = self.config.closed_fraction * travel(part.joint, point) / place.lever
        place.goal = wp.transform(*goal[:3], *goal[3:])
        turn = Rotation.from_matrix(inside.frame[:3, :3]).as_quat()
        place.inside, place.half = wp.transform(*inside.frame[:3, 3], *turn), wp.vec3(*inside.half)
        self.world.place = place
        watch_others(self.world, sim, (place.container,))
        self.thresholds = {**self.thresholds, "shut": place.shut, "ride": self.metrics.min_ride}


TASK = PutIn
