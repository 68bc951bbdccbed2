"""The environment as rsl-rl sees it."""

from collections.abc import Callable
from typing import Any

import torch
from rsl_rl.env import VecEnv as RslRlVecEnv
from tensordict import TensorDict

from s2a.motion.policy import Planner
from s2a.tasks.env import VecEnv
from s2a.tasks.state import ERRORS

# Factor a control step by which finished episodes count less in the logged rates: about two episodes' length
RECENT = 0.999

TERM = "rew_"  # Prefix of the reward terms among what is logged
TEACHER = "teacher"  # Name of the teacher's actions among the observations


class RslRlEnv(RslRlVecEnv):
    """Counts episodes and logs their rates, beside what rsl-rl asks for.

    Observations and rewards are copies: rsl-rl keeps the observation it acted on across the step, which overwrites the
    environment's own buffer in place.

    Attributes:
        names: of `counted` and `recent`: "episodes", then the environment's columns.
        counted: sums over all finished episodes, shape [name], float64.
        recent: the same, where an episode that ended k control steps ago counts as RECENT ** k, float32.
        unaided: number of those that did not begin on a demonstration, and of those among them that `score` counts, likewise.
    """

    def __init__(
        self,
        env: VecEnv,
        reward_scale: float,
        on_step: Callable[[], object] = lambda: None,
        log_every: int = 1,
        teacher: Planner | None = None,
    ) -> None:
        """Wrap an environment; `on_step` is called after every control step, every `log_every`th one is logged.

        What the teacher would do is among the observations, for the algorithm alone.
        """
        self.env, self._reward_scale, self._on_step = env, reward_scale, on_step
        self.num_envs, self.num_actions = env.num_envs, env.num_actions
        self.max_episode_length = env.max_episode_length
        self.device = env.sim.device
        self.cfg: dict = {}
        self.names = ("episodes", *env.columns)
        self.counted = torch.zeros(len(self.names), device=self.device, dtype=torch.float64)
        self.recent = torch.zeros(len(self.names), device=self.device)
        self.unaided = torch.zeros(2, device=self.device)
        self._scored = env.columns.index(env.task.RESULTS.logged[0])
        self._terms = torch.zeros(len(env.task.REWARDS), device=self.device)
        self._log_every, self._steps = log_every, 0
        self._teacher, self._taught = teacher, self._advice(teacher)

    @property
    def episode_length_buf(self) -> torch.Tensor:
        """Control steps since each world's reset; assigning copies, and leaves the episodes that it cuts short uncounted."""
        return self.env.episode_step

    @episode_length_buf.setter
    def episode_length_buf(self, value: torch.Tensor) -> None:
        self.env.episode_step.copy_(value)
        self.env.uncounted.fill_(1)

    @property
    def warm(self) -> bool:
        """More than an episode's time has passed; what ends earlier is what succeeded early."""
        return self._steps > self.max_episode_length

    @property
    def score(self) -> float:
        """Rate of the task's first logged column over the recent unaided episodes; NaN before the worlds are warm.

        Where all episodes begin on demonstrations, these count.
        """
        episodes, hits = self.unaided
        if self.warm and not episodes:
            episodes, hits = self.recent[0], self.recent[1 + self._scored]
        return float(hits / episodes) if self.warm else float("nan")

    def get_observations(self) -> TensorDict:
        """Return copies of the observation [world observation] and of what the critic is told besides."""
        seen = {"policy": self.env.observation.clone()}
        if self.env.task.privileged:
            seen["privileged"] = self.env.privileged.clone()
        if self._taught is not None:
            seen[TEACHER] = self._taught
        return TensorDict(seen, batch_size=[self.num_envs])

    def step(self, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict]:
        """Apply actions [world action]; return observations, rewards, dones, and what is logged."""
        env = self.env
        unaided = (env.begun < 0) & (env.uncounted == 0)  # of the running episodes; the step begins new ones
        env.step(actions)
        ended = unaided & (env.done == 1)
        hits = torch.where(ended, env.result[:, self._scored], 0.0)
        self.unaided.mul_(RECENT).add_(torch.stack([ended.sum(), hits.sum()]))
        self.counted.add_(env.counts)
        self.recent.mul_(RECENT).add_(env.counts)
        env.counts.zero_()
        self._terms.add_(env.terms.mean(dim=0))
        self._on_step()
        self._steps += 1
        self._taught = self._advice(self._teacher)
        extras: dict[str, Any] = {"time_outs": env.time_out.float()}
        if self._steps % self._log_every == 0:
            extras["log"] = self._log()
        return self.get_observations(), env.reward * self._reward_scale, env.done.long(), extras

    def _advice(self, teacher: Planner | None) -> torch.Tensor | None:
        """Return what a teacher would do in the present state, once a control step."""
        return None if teacher is None else teacher(self.env.observation).clamp(-1.0, 1.0)

    def state_dict(self) -> dict[str, Any]:
        """Return all that an interrupted run needs to go on as if it had not been: worlds, random states, counts."""
        states = {"torch": torch.get_rng_state()}
        if torch.device(self.device).type == "cuda":
            states["cuda"] = torch.cuda.get_rng_state(self.device)
        totals = {"counted": self.counted, "recent": self.recent, "unaided": self.unaided, "terms": self._terms}
        sums = {name: values.clone() for name, values in totals.items()}
        taught = {"teacher": self._teacher.state_dict(), "taught": self._taught} if self._teacher else {}
        return {
            "worlds": self.env.state_dict(),
            "rng": states,
            "steps": self._steps,
            "names": self.names,
            **sums,
            **taught,
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go on from what `state_dict` returned."""
        self.env.load_state_dict(state["worlds"])
        self._steps = state["steps"]
        saved = {name: i for i, name in enumerate(state["names"])}
        columns = [(i, saved[name]) for i, name in enumerate(self.names) if name in saved]
        for name in ("counted", "recent"):
            for i, k in columns:
                getattr(self, name)[i] = state[name][k]
        if "unaided" in state:  # runs before it was kept go on with an empty one
            self.unaided.copy_(state["unaided"])
        if len(state["terms"]) == len(self._terms):
            self._terms.copy_(state["terms"])
        if self._teacher:
            self._teacher.load_state_dict(state["teacher"])
            self._taught = state["taught"]
        torch.set_rng_state(state["rng"]["torch"].cpu())
        if "cuda" in state["rng"] and torch.device(self.device).type == "cuda":
            torch.cuda.set_rng_state(state["rng"]["cuda"].cpu(), self.device)

    def _log(self) -> dict[str, torch.Tensor]:
        """Return rates over the recent episodes, NaN before the worlds are warm, and the mean of each reward term."""
        sums = self.recent if self.warm else torch.full_like(self.recent, torch.nan)
        recent, task = dict(zip(self.names, sums.unbind(), strict=True)), self.env.task
        terms = (self._terms / self._log_every).unbind()
        self._terms = torch.zeros_like(self._terms)
        logged = (*task.RESULTS.logged, *task.RESULTS.values, *ERRORS)
        rates = {name: recent[name] / recent["episodes"] for name in logged}  # rsl_rl's logger: Episode/NAME
        return rates | {f"{TERM}{name}": mean for name, mean in zip(task.REWARDS, terms, strict=True)}
