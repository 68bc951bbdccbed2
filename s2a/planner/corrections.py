"""What a planner changes of its trajectory as it sees the room: all that a task's motion asks for."""

from __future__ import annotations

from functools import partial

import torch

from s2a.planner.held_object import HeldObject, target_in_tool
from s2a.planner.moved_part import MovedPart, PartOff
from s2a.planner.pace import Pace
from s2a.planner.regrasp import Regrasp
from s2a.planner.shifted_object import ShiftedObject
from s2a.planner.trajectory import Trajectory
from s2a.sim.simulation import Simulation


class Corrections:
    """What is added to the arm's targets of a trajectory that is the same in all worlds, and how fast they follow it then."""

    def __init__(self, sim: Simulation, trajectory: Trajectory, rate: float) -> None:
        """Find where the trajectory picks, places and shuts; each may be missing.

        Args:
            sim: whose worlds.
            trajectory: all of it.
            rate: control steps a second.
        """
        aligned, picked, shutting = trajectory.aligned, trajectory.picked, trajectory.shutting
        self._shifted = ShiftedObject(sim, trajectory, picked) if picked else None
        off = None
        if aligned and shutting:
            off = partial(PartOff(sim, shutting.part).off, float(trajectory.part[aligned.seen]))
        self._held = HeldObject(sim, trajectory, aligned, partial(target_in_tool, sim), off) if aligned else None
        self._moved = MovedPart(sim, trajectory, shutting) if shutting else None
        self._regrasp = Regrasp(sim, trajectory, self._shifted) if self._shifted and trajectory.again else None
        self._pace = Pace(sim, trajectory, sim.plan_limits, rate)

    def begin(self, worlds: torch.Tensor) -> None:
        """See where the object stands in worlds whose episode begins, shape [world], bool."""
        if self._shifted and bool(worlds.any()):
            self._shifted.see(worlds)
            self._pace.fit(self._shifted.window, worlds, self)

    def see(self, step: torch.Tensor) -> None:
        """See the object in the gripper, and the part, in worlds that have come so far; steps, shape [world]."""
        for each in (self._held, self._moved):
            worlds = each.see(step) if each else None
            if each and worlds is not None:
                self._pace.fit(each.window, worlds, self)
        again = self._regrasp.see(step) if self._regrasp else None
        if self._shifted and again is not None:
            self._pace.fit(self._shifted.window, again, self)

    def after(self, place: torch.Tensor) -> torch.Tensor:
        """Return where on the trajectory each world is a control step later, shape [world]; whole where nothing is added."""
        following = self._pace.after(place)
        return self._regrasp.after(place, following) if self._regrasp else following

    def __call__(self, step: torch.Tensor) -> torch.Tensor | float:
        """Return what to add to the arm's targets, shape [world arm], at these steps of the trajectory, shape [world]."""
        added: torch.Tensor | float = 0.0
        for each in (self._shifted, self._held, self._moved, self._regrasp):
            if each is not None:
                added = added + each(step)
        return added
