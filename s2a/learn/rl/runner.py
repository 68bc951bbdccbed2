"""rsl-rl's runner with checkpoints that hold the whole run, and processes that may be on a CPU."""

from __future__ import annotations

import math
import shutil
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from rsl_rl.runners import OnPolicyRunner
from rsl_rl.utils.logger import Logger

from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write
from s2a.learn.rl import config, policy_file
from s2a.learn.rl.adapter import RslRlEnv
from s2a.learn.rl.config import BROKEN
from s2a.learn.rl.run_folder import BEST

UNSEEN = {"obs_normalizer._mean": 0.0, "obs_normalizer._var": 1.0, "obs_normalizer._std": 1.0, "mlp.0.weight": 0.0}
"""What belongs to an input that a network did not have: it is seen as it is, and counts for nothing."""


def widened(
    saved: Mapping[str, torch.Tensor], own: Mapping[str, torch.Tensor], known: int, given: int
) -> dict[str, torch.Tensor]:
    """Return saved weights as a network takes them that has further inputs; it gives what the saved one gives.

    Args:
        saved: of a network and its normaliser, under rsl-rl's names.
        own: those of the network that is to begin so; what the saved one lacks stays.
        known: how many numbers the policy observed.
        given: how many it observes; the further ones come after these, and what else is new, which a critic alone is told, at
            the end.
    """
    weights = dict(own) | dict(saved)
    for name, value in UNSEEN.items():
        before = weights[name]
        further = own[name].shape[1] - before.shape[1]
        if further > 0:
            new = before.new_full((len(before), further), value)
            observed, told = new.tensor_split([given - known], dim=1)
            weights[name] = torch.cat([before[:, :known], observed, before[:, known:], told], dim=1)
    return weights


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


class Runner(OnPolicyRunner):
    """Trains; checkpoints appear whole or not at all, and a run that goes on from one equals a run that was not cut.

    Attributes:
        seconds: of training so far, in the processes before this one too.
        best: best score (`RslRlEnv.score`) of a checkpoint so far; NaN before the first.
    """

    env: RslRlEnv
    seconds = 0.0
    best = math.nan

    def __init__(self, env: RslRlEnv, settings: dict[str, Any], log_dir: str | None, device: str) -> None:
        """Build what learns and what logs."""
        super().__init__(env, settings, log_dir, device)
        place = (self.is_distributed, self.gpu_world_size, self.gpu_global_rank)
        self.logger = LazyLogger(log_dir, self.cfg, env.cfg, env.num_envs, *place, device)
        self._resumed = False
        self._clock = time.perf_counter()

    def learn(self, num_learning_iterations: int, init_at_random_ep_len: bool = False) -> None:
        """Train, and keep the time; worlds that were resumed keep their episode clocks."""
        self._clock = time.perf_counter()
        super().learn(num_learning_iterations, init_at_random_ep_len and not self._resumed)
        self._keep_time()

    def save(self, path: str, infos: dict | None = None) -> None:
        """Write a checkpoint, and copy it to BEST where none before scored higher.

        Raises:
            InputError: a parameter of the policy is not finite.
        """
        self._keep_time()
        if not all(bool(p.isfinite().all()) for group in self.alg.optimizer.param_groups for p in group["params"]):
            raise InputError(BROKEN)
        score = self.env.score
        better = math.isfinite(score) and not score <= self.best
        self.best = score if better else self.best
        run = {"seconds": self.seconds, "best": self.best, "score": score, "log": self.logger.state_dict()}
        with atomic_write(Path(path)) as out:
            super().save(str(out), run | {"run": self.env.state_dict()})
        if better:
            with atomic_write(Path(path).with_name(BEST)) as out:
                shutil.copyfile(path, out)

    def load(
        self, path: str, load_cfg: dict | None = None, strict: bool = True, map_location: str | None = None
    ) -> dict:
        """Load a checkpoint without executing anything in it; see OnPolicyRunner.load."""
        loaded = torch.load(path, weights_only=True, map_location=map_location)
        if self.alg.load(loaded, load_cfg, strict):
            self.current_learning_iteration = loaded["iter"]
        return loaded["infos"]

    def begin_with(self, checkpoint: Path) -> None:
        """Take a checkpoint's networks, or an .onnx policy's, with as much noise as this run asks for.

        They may have been told less; see `widened`.

        Raises:
            InputError: they do not fit, or the file is damaged.
        """
        actor, critic = self.alg.get_policy(), self.alg.critic
        noise = {"distribution.std_param": actor.state_dict()["distribution.std_param"].clone()}
        try:
            if checkpoint.suffix == ".pt":
                saved = torch.load(checkpoint, weights_only=True, map_location=str(self.device))
                saved = {"actor": saved["actor_state_dict"] | noise, "critic": saved["critic_state_dict"]}
            else:
                saved = {"actor": policy_file.weights(checkpoint)}
            known, given = (each["obs_normalizer._mean"].shape[1] for each in (saved["actor"], actor.state_dict()))
            if known > given:
                raise InputError(
                    f"key 'init': {checkpoint} observes {known} numbers, and this run gives {given}; give the keys of its task, "
                    "as task.describe_part=true task.fine_grasp=true"
                )
            for name, network in (("actor", actor), ("critic", critic)):
                if name in saved:
                    network.load_state_dict(widened(saved[name], network.state_dict(), known, given))
        except InputError:
            raise
        except Exception as error:  # of torch, pickle, zipfile: whatever a damaged or foreign file makes them raise
            why = (str(error) or type(error).__name__).splitlines()[0]
            raise InputError(f"key 'init': {checkpoint} has no networks that fit this run ({why})") from error

    def keep_normalizer(self) -> None:
        """Let the policy go on to see observations as it has learned to.

        A normaliser that follows other rooms than it was made in changes what the policy does, without its gradient and without a
        divergence that would show it.
        """
        self.alg.get_policy().obs_normalizer.until = 0

    def resume(self, checkpoint: Path) -> None:
        """Go on after the iteration that a checkpoint was written in, as if the run had not been cut.

        Raises:
            InputError: the checkpoint is damaged or of another version.
        """
        try:
            infos = self.load(str(checkpoint), map_location=str(self.device))
            if (
                config.rank() == 0
            ):  # the worlds of the other processes were not saved, and begin with seeds of their own
                self.env.load_state_dict(infos["run"])
            self.logger.load_state_dict(infos["log"])
            self.seconds, self.best = infos["seconds"], infos["best"]
        except InputError:
            raise
        except Exception as error:  # of torch, pickle, zipfile: whatever a damaged file makes them raise
            why = (str(error) or type(error).__name__).splitlines()[0]
            raise InputError(
                f"{checkpoint}: not a checkpoint that this run can go on from ({why}); delete it to go on from an "
                "earlier one, or train into another folder"
            ) from error
        self._resumed = config.rank() == 0
        self.current_learning_iteration += 1
        batch = self.cfg["num_steps_per_env"] * self.env.num_envs * self.gpu_world_size
        self.logger.tot_timesteps = self.current_learning_iteration * batch
        self.logger.tot_time = self.seconds

    def _keep_time(self) -> None:
        now = time.perf_counter()
        self.seconds += now - self._clock
        self._clock = now

    def _configure_multi_gpu(self) -> None:
        """Join the other processes, on CPUs too, where rsl-rl itself refuses."""
        if config.count() == 1 or torch.device(self.device).type != "cpu":
            super()._configure_multi_gpu()
            return
        rank, count = config.rank(), config.count()
        self.gpu_world_size, self.gpu_global_rank, self.gpu_local_rank, self.is_distributed = count, rank, rank, True
        self.cfg["multi_gpu"] = {"global_rank": rank, "local_rank": rank, "world_size": count}
        torch.distributed.init_process_group(backend="gloo", rank=rank, world_size=count)
