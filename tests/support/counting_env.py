"""An environment without physics, for tests of what learns in it."""

from __future__ import annotations

from types import SimpleNamespace

import torch

from s2a.tasks.state import ERRORS

OBSERVATIONS = 23
TASK = SimpleNamespace(
    REWARDS=("near", "far"),
    RESULTS=SimpleNamespace(
        names=("success", "tidy_success", "opening"), values=("opening",), logged=("tidy_success", "success"), version=1
    ),
    privileged=0,
    metrics=SimpleNamespace(error_fraction=0.01),
)
"""What a task says of itself to those who log."""


class CountingEnv:
    """An environment whose one observation buffer, overwritten in place, counts the steps."""

    def __init__(self, num_envs: int = 2) -> None:
        self.num_envs, self.num_actions, self.max_episode_length = num_envs, 9, 500
        self.sim = SimpleNamespace(device="cpu", config=SimpleNamespace(dt=0.01, njmax=1, nconmax=1))
        self.task, self.columns = TASK, (*TASK.RESULTS.names, *ERRORS)
        self.observation = torch.zeros(num_envs, OBSERVATIONS)
        self.reward, self.terms = torch.zeros(num_envs), torch.zeros(num_envs, len(TASK.REWARDS))
        self.done, self.time_out, self.episode_step, self.uncounted = torch.zeros(4, num_envs, dtype=torch.int32)
        self.begun = torch.full((num_envs,), -1, dtype=torch.int32)
        self.counts, self.result = torch.zeros(1 + len(self.columns)), torch.zeros(num_envs, len(self.columns))

    def step(self, action: torch.Tensor) -> None:
        """Count."""
        self.observation += 1.0
        self.reward.copy_(self.observation[:, 0])

    def finish(self, name: str, episodes: float = 1.0) -> None:
        """Count an episode that ended, with a column."""
        self.counts[0] += episodes
        self.counts[1 + self.columns.index(name)] += episodes

    def state_dict(self) -> dict[str, torch.Tensor]:
        """Return what the steps came to."""
        return {"observation": self.observation.clone()}

    def load_state_dict(self, state: dict[str, torch.Tensor]) -> None:
        """Go on from there."""
        self.observation.copy_(state["observation"])
