"""An environment without physics, for tests of what learns in it."""

from __future__ import annotations

from types import SimpleNamespace

import torch

from s2a.tasks.open_part.config import COUNTS, OBSERVATIONS, REWARD_TERMS


class CountingEnv:
    """An environment whose one observation buffer, overwritten in place, counts the steps."""

    def __init__(self, worlds: int = 2) -> None:
        self.num_envs, self.num_actions, self.max_episode_length = worlds, 9, 500
        self.sim = SimpleNamespace(device="cpu")
        self.observation = torch.zeros(worlds, OBSERVATIONS)
        self.reward, self.terms = torch.zeros(worlds), torch.zeros(worlds, len(REWARD_TERMS))
        self.done = self.time_out = self.episode_step = torch.zeros(worlds, dtype=torch.int32)
        self.counts, self.midway = torch.zeros(len(COUNTS)), torch.zeros(worlds)

    def step(self, action: torch.Tensor) -> None:
        """Count."""
        self.observation += 1.0
        self.reward.copy_(self.observation[:, 0])
