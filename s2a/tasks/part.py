"""What tasks with an articulated part share; `part_functions` has what their kernels ask, `part_observation` what is seen."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
from typing import Any

import numpy as np
import warp as wp

from s2a.env.state import State
from s2a.env.task import Task
from s2a.tasks import part_observation
from s2a.tasks.part_handles import PartHandles


@wp.kernel
def clear_region_force(h: PartHandles):
    """Forget the forces of the control step before."""
    world = wp.tid()
    h.contacts.peak[world] = 0.0
    for finger in range(2):
        h.region_force[world, finger] = 0.0


@wp.kernel
def update_region_force(h: PartHandles):
    """Keep each finger's maximum force on the region in the control step."""
    world = wp.tid()
    for finger in range(2):
        h.region_force[world, finger] = wp.max(h.region_force[world, finger], h.contacts.on_region[world, finger])


class PartTask(Task):
    """A task with an articulated part: the shared observation, and the kernels `reset`, `update`, `write_result` of KERNELS."""

    KERNELS: Any

    def launch(self, kernel: wp.Kernel, state: State) -> None:
        """Launch a kernel of (state, handles) in all worlds."""
        wp.launch(kernel, dim=len(state.done), inputs=[state, self.handles])

    def persistent(self) -> dict[str, wp.array]:
        """Return also the grasp that is seen, where it differs from the true one."""
        p = self.handles.p
        known = {"seen": p.seen} if self._is_misplaced else {}
        if p.is_estimated:
            known |= {"frame": p.frame, "tracked": p.tracked, "tool_before": p.tool_before}
        return super().persistent() | known

    def seen_grasp(self) -> np.ndarray | None:
        """Return the grasp that is seen, where it differs from the true one."""
        return self.handles.p.seen.numpy() if self._is_misplaced else None

    @property
    def _is_misplaced(self) -> bool:
        return bool(self.handles.p.is_estimated) or part_observation.is_misplaced(self.config)

    def reset(self, state: State) -> None:
        """Start a new episode where one ended, with a new error of the grasp that is seen."""
        part_observation.misplace_grasp(state, self.handles.p, self.config)
        self.launch(self.KERNELS.reset, state)

    def update(self, state: State) -> None:
        """Keep what reward terms and results read, and what the robot's own motion tells of the part."""
        part_observation.track(state, self.handles.p)
        self.launch(self.KERNELS.update, state)

    def observe(self, state: State) -> None:
        """Write the observations, and what a critic alone is told."""
        part_observation.observe(state, self.handles.p, self.config)

    def result(self, state: State) -> None:
        """Write how finished episodes went."""
        self.launch(self.KERNELS.write_result, state)
