"""An environment without physics, for tests of what learns in it."""

from __future__ import annotations

from types import SimpleNamespace

import torch

from s2a.task.open_drawer import COUNTS, OBSERVATIONS, REWARD_TERMS


class CountingEnv:
    """An environment whose one observation buffer, overwritten in place, counts the steps."""

    def __init__(self) -> None:
        self.num_envs, self.num_actions, self.max_episode_length = 2, 9, 500
        self.sim = SimpleNamespace(device="cpu")
        self.observation = torch.zeros(2, OBSERVATIONS)
        self.reward, self.terms = torch.zeros(2), torch.zeros(2, len(REWARD_TERMS))
        self.done = self.time_out = self.episode_step = torch.zeros(2, dtype=torch.int32)
        self.counts, self.midway = torch.zeros(len(COUNTS)), torch.zeros(2)

    def step(self, action: torch.Tensor) -> None:
        """Count."""
        self.observation += 1.0
        self.reward.copy_(self.observation[:, 0])
