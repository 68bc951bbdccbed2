"""rsl-rl's log without waiting for the device after every step."""

from __future__ import annotations

from typing import Any

import torch
from rsl_rl.utils.logger import Logger


class LazyLogger(Logger):
    """rsl-rl's logger, which looks at the finished episodes once an iteration; what it logs is the same.

    rsl-rl asks the GPU after every step which episodes have ended, so that no step is launched while the one before it runs.
    """

    cur_reward_sum: torch.Tensor
    cur_episode_length: torch.Tensor

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        """Begin with no step kept."""
        super().__init__(*args, **kwargs)
        self._kept: list[tuple[torch.Tensor, ...]] = []

    def state_dict(self) -> dict[str, Any]:
        """Return what the running episodes and the recent ones came to."""
        running = {"reward": self.cur_reward_sum.clone(), "length": self.cur_episode_length.clone()}
        return running | {"rewards": list(self.rewbuffer), "lengths": list(self.lenbuffer)}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go on from what `state_dict` returned."""
        self.cur_reward_sum.copy_(state["reward"])
        self.cur_episode_length.copy_(state["length"])
        self.rewbuffer.extend(state["rewards"])
        self.lenbuffer.extend(state["lengths"])

    def process_env_step(
        self,
        rewards: torch.Tensor,
        dones: torch.Tensor,
        extras: dict,
        intrinsic_rewards: torch.Tensor | None = None,  # noqa: ARG002 (of an exploration that s2a does not use)
    ) -> None:
        """Add a step to the running episodes, and keep on the device which ended."""
        if self.writer is None:
            return
        if "log" in extras:
            self.ep_extras.append(extras["log"])
        done = dones > 0
        reward, length = self.cur_reward_sum + rewards, self.cur_episode_length + 1
        self._kept.append((done, reward, length))
        self.cur_reward_sum, self.cur_episode_length = (x.masked_fill(done, 0.0) for x in (reward, length))

    def log(self, *args: Any, **kwargs: Any) -> None:
        """Take over the episodes that have ended, in their order, and log."""
        if self._kept:
            done, reward, length = (torch.stack(x) for x in zip(*self._kept, strict=True))
            self._kept.clear()
            self.rewbuffer.extend(reward[done].tolist())
            self.lenbuffer.extend(length[done].tolist())
        super().log(*args, **kwargs)
