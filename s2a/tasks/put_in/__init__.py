"""Putting a free object into an articulated part: open it, put the object in, shut it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import warp as wp
from scipy.spatial.transform import Rotation

from s2a.core.errors import InputError
from s2a.env.state import State
from s2a.motion import put_in
from s2a.motion.insides import at_zero
from s2a.motion.trajectory import Trajectory
from s2a.scene.articulation import lever_arm, travel
from s2a.sim.simulation import Simulation
from s2a.sim.world import SimStage, axis_of
from s2a.tasks.pick_place import PickPlaceTask
from s2a.tasks.pick_place import mdp as picking
from s2a.tasks.put_in import handles, mdp
from s2a.tasks.put_in.config import PutInConfig, PutInMetrics


class PutInTask(PickPlaceTask):
    """Put the object of every world into its part; observations are pick_place's, and the part's coordinate."""

    Config, Metrics, Handles = PutInConfig, PutInMetrics, handles.PutIn
    PERSISTENT = ("progress", "last", "last_in", "released", "released_in", "origin")
    REWARDS, METRICS, VALUES, METRICS_VERSION = mdp.REWARDS, mdp.METRICS, mdp.VALUES, 2
    INSTRUCTION = "put the {part} into the {into}"
    Stage: ClassVar[type[SimStage]] = put_in.PutStage
    LOGGED = ("success", "stored", "carried", "grasped")
    KERNELS: ClassVar[Any] = mdp

    stage: put_in.PutStage

    def __init__(self, sim: Simulation, config: PutInConfig, metrics: PutInMetrics) -> None:
        """Bind the task to worlds of a PutStage."""
        if not isinstance(sim.stage, put_in.PutStage):
            raise InputError("task put_in needs the stage that its own read_stage returns")
        super().__init__(sim, config, metrics)
        joint = self.stage.room.articulations[self.stage.part]
        p, h = self.handles, handles.PutIn()
        h.p = p
        h.part = sim.body(self.stage.part)
        h.coord = axis_of(sim.world, self.stage.part, joint.joint.kind)[0]
        point = np.array(joint.grasp.point)
        h.lever = lever_arm(joint.joint, point)
        h.shut = config.closed_fraction * travel(joint.joint, point) / h.lever
        h.min_ride = metrics.min_ride
        self.thresholds = {**self.thresholds, "shut": h.shut, "ride": h.min_ride}
        self._bind_part(h)
        self.handles = h
        self.observations += 1

    def _bind_part(self, h: handles.PutIn) -> None:
        """Give the handles what they need of the part, and their arrays."""
        sim, stage, n = self.sim, self.stage, self.sim.num_envs
        frame = stage.put.inside.frame
        turn = Rotation.from_matrix(frame[:3, :3]).as_quat()
        with wp.ScopedDevice(sim.device):
            surface = stage.surface
            self._part_surface = wp.Mesh(
                wp.array(np.asarray(surface.vertices, np.float32), dtype=wp.vec3),
                wp.array(np.asarray(surface.faces, np.int32).ravel(), dtype=int),
            )
            h.surface = self._part_surface.id
            h.inside, h.half = wp.transform(*frame[:3, 3], *turn), wp.vec3(*stage.put.inside.half)
            goal = at_zero(stage.room, stage.part, stage.goal, stage.opened)
            p = h.p
            p.goal = wp.transform(*goal[:3], *goal[3:])
            h.p = p
            others = [i for i in self.others if i != h.part]
            h.others = wp.array(others, dtype=int)
            h.origin = wp.zeros((n, max(1, len(others))), dtype=wp.vec3)
            h.progress = wp.zeros((n, len(handles.Progress)), dtype=float)
            for name in ("last", "last_in", "released", "released_in"):
                setattr(h, name, wp.zeros(n, dtype=wp.vec3))

    @staticmethod
    def read_stage(
        path: Path, part: str | None, robot: str | None, also: Sequence[str], config: Any, motion: Any
    ) -> put_in.PutStage:
        """Read the room, and plan for the object and the part."""
        return put_in.read_stage(path, part, robot, also, config, motion)

    def trajectory(self, settings: Any) -> Trajectory:
        """Return the planned trajectory."""
        return put_in.trajectory(self.sim, self.stage, settings)

    def after_substep(self, state: State) -> None:
        """Read the contacts, and attribute the object's path to what held it."""
        self.sensor.update()
        # After an odd number of physics steps the poses are in the simulation's other buffer.
        poses = self.sim.state.body_q.reshape(state.body_q.shape)
        coords = self.sim.state.joint_q.reshape(state.joint_q.shape)
        wp.launch(mdp.track, dim=len(state.done), inputs=[poses, coords, self.handles])

    def persistent(self) -> dict[str, wp.array]:
        """Return the arrays that a later step reads, those of picking among them."""
        return {**super().persistent(), "rested": self.handles.p.rested}

    def observe(self, state: State) -> None:
        """Write the observations."""
        wp.launch(picking.observe, dim=len(state.done), inputs=[state, self.handles.p])
        self.launch(mdp.observe_part, state, self.observations - 1)


TASK = PutInTask
