"""Training a policy by proximal policy optimisation: rsl-rl around the environment, with checkpoints that hold the whole run."""

import contextlib
import copy
import io
import json
import math
import os
import shutil
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from datetime import timedelta
from pathlib import Path
from typing import Any

import torch
from rsl_rl.runners import OnPolicyRunner
from rsl_rl.utils.logger import Logger
from tensordict import TensorDict
from torch import nn

from s2a.core import config
from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write
from s2a.core.progress import is_terminal, note, track
from s2a.core.provenance import curve
from s2a.learn.evaluate import rate, run_episodes
from s2a.learn.rl import config as processes
from s2a.learn.rl import policy_file, run_folder
from s2a.learn.rl.adapter import TERM, RslRlEnv
from s2a.learn.rl.config import BROKEN, PpoConfig, rsl_rl_settings
from s2a.learn.rl.run_folder import BEST
from s2a.motion.policy import Planner
from s2a.tasks.env import VecEnv
from s2a.tasks.state import ERRORS

# What belongs to an input that a network did not have: it is seen as it is, and counts for nothing
UNSEEN = {"obs_normalizer._mean": 0.0, "obs_normalizer._var": 1.0, "obs_normalizer._std": 1.0, "mlp.0.weight": 0.0}


def widened(
    saved: Mapping[str, torch.Tensor], own: Mapping[str, torch.Tensor], count: int, given: int
) -> dict[str, torch.Tensor]:
    """Return saved weights as a network takes them that has further inputs; it gives what the saved one gives.

    Args:
        saved: of a network and its normaliser, under rsl-rl's names.
        own: those of the network that is to begin so; what the saved one lacks stays.
        count: how many numbers the policy observed.
        given: how many it observes; the further ones come after these, and what else is new, which a critic alone is told, at
            the end.
    """
    weights = dict(own) | dict(saved)
    for name, value in UNSEEN.items():
        before = weights[name]
        further = own[name].shape[1] - before.shape[1]
        if further > 0:
            new = before.new_full((len(before), further), value)
            observed, privileged = new.tensor_split([given - count], dim=1)
            weights[name] = torch.cat([before[:, :count], observed, before[:, count:], privileged], dim=1)
    return weights


NEAR = 0.03  # How far below the target the rate under exploration noise may be where the policy without it is measured
IMITATE_BELOW = 0.5  # Measured rate of a policy to begin with below which it imitates the planner first
# Measured rate below which a training with a target ends, once it has done this fraction of its iterations. A door
# that was at 1 % under exploration noise after 0.2 of them was at 99 % after 0.45
HOPELESS, BY = 0.05, 0.6


class Ended(Exception):
    """A training is over before its last iteration; the text says why."""


class LazyLogger(Logger):
    """rsl-rl's logger, which looks at the finished episodes once an iteration; what it logs is the same.

    rsl-rl asks the GPU after every step which episodes have ended, so that no step is launched while the one before it runs.
    """

    cur_reward_sum: torch.Tensor
    cur_episode_length: torch.Tensor

    def __init__(self, *args: Any, **kwargs: Any) -> None:
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

    def log(
        self, it: int, start_it: int, total_it: int, collect_time: float, learn_time: float, *args: Any, **kwargs: Any
    ) -> None:
        """Take over the episodes that have ended, in their order, and log; where nobody sees a bar, with a line on stderr."""
        if self._kept:
            done, reward, length = (torch.stack(x) for x in zip(*self._kept, strict=True))
            self._kept.clear()
            self.rewbuffer.extend(reward[done].tolist())
            self.lenbuffer.extend(length[done].tolist())
        rates = {name: float(value) for name, value in (self.ep_extras[-1] if self.ep_extras else {}).items()}
        super().log(it, start_it, total_it, collect_time, learn_time, *args, **kwargs)
        if self.writer is not None and not is_terminal():
            note(
                f"train: iteration {it + 1} of {total_it}; {self._line(rates, collect_time + learn_time, total_it - it - 1)}"
            )

    def _line(self, rates: Mapping[str, float], seconds: float, left: int) -> str:
        """Return an iteration that took some seconds in words: reward, the first rates, speed, time for those that are left."""
        episodes = f"reward {sum(self.rewbuffer) / len(self.rewbuffer):.4g}" if self.rewbuffer else "no episode ended"
        known = [(name, rate) for name, rate in rates.items() if math.isfinite(rate) and not name.startswith(TERM)]
        steps = self.cfg["num_steps_per_env"] * self.num_envs * self.gpu_world_size / max(seconds, 1e-9)
        shown = [f"{name} {rate:.3g}" for name, rate in known[:2]]
        return ", ".join([episodes, *shown, f"{steps:.0f} steps/s", f"{timedelta(seconds=round(seconds * left))} left"])


class Runner(OnPolicyRunner):
    """Trains; checkpoints appear whole or not at all, and a run that goes on from one equals a run that was not cut.

    Attributes:
        seconds: of training so far, in the processes before this one too.
        best: best score (`RslRlEnv.score`) of a checkpoint so far; NaN before the first.
        target: measured rate at which training ends; None: at its last iteration.
        iterations: number of the run's iterations.
        measured: what the best checkpoint came to, once that is known.
    """

    env: RslRlEnv
    seconds = 0.0
    best = math.nan
    target: float | None = None
    iterations = 0
    measured: dict[str, float]

    def __init__(self, env: RslRlEnv, settings: dict[str, Any], log_dir: str | None, device: str) -> None:
        super().__init__(env, settings, log_dir, device)
        place = (self.is_distributed, self.gpu_world_size, self.gpu_global_rank)
        self.logger = LazyLogger(log_dir, self.cfg, env.cfg, env.num_envs, *place, device)
        self._resumed = False
        self._clock = time.perf_counter()
        self.measured = {}

    @torch.inference_mode()
    def measure(self, again: bool = False) -> dict[str, float]:
        """Run the mean actions for one episode in every world from a fresh reset; training goes on as if it had not been done.

        Start noise is drawn by the iteration's number, `again` for other draws.

        Returns:
            "episodes": number of those that did not begin on a demonstration; "rate": of the task's first logged column among
            them, with the Wilson 95 % interval "low" to "high".
        """
        worlds, running = self.env.env, self.env.state_dict()
        begun: list[torch.Tensor] = []  # on which step of a demonstration each world's episode began
        policy = self.get_inference_policy(device=str(self.device))
        worlds.reset_all(2 * self.current_learning_iteration + again)
        column = run_episodes(
            worlds,
            lambda observation: policy(TensorDict({"policy": observation}, batch_size=[len(observation)])),
            lambda: None if begun else begun.append(worlds.begun.cpu().clone()),
        )
        self.env.load_state_dict(running)
        self.alg.train_mode()
        hits = column[worlds.task.RESULTS.logged[0]][begun[0] < 0]
        return {"episodes": len(hits), **rate(float(hits.sum()), len(hits))}

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
            self._keep(path)
        if self.target is not None:
            self._judge(path, score)

    def _keep(self, path: str) -> None:
        """Copy a checkpoint to BEST."""
        with atomic_write(Path(path).with_name(BEST)) as out:
            shutil.copyfile(path, out)

    def _judge(self, path: str, score: float) -> None:
        """End a training that has reached its target, or will not; a rate under noise is NaN before the worlds are warm."""
        assert self.target is not None
        late = self.current_learning_iteration >= BY * self.iterations
        if not (score >= self.target - NEAR or (late and score < HOPELESS)):
            return
        measured = self.measure()
        if measured["rate"] >= self.target:
            self.confirm(path)
        if late and measured["rate"] < HOPELESS:
            raise Ended(
                f"{measured['rate']:.1%} are measured after {self.current_learning_iteration} of {self.iterations} iterations; "
                "s2a evaluate images= shows where the arm stays; try another base or part"
            )

    def confirm(self, path: str) -> None:
        """End with a checkpoint that was measured at the target, if other draws say so too: of many measurements one is lucky."""
        assert self.target is not None
        measured = self.measure(again=True)
        if measured["rate"] >= self.target:
            self.measured = measured
            self._keep(path)
            raise Ended(f"{measured['rate']:.1%} are measured, the target is {self.target:.0%}")

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
            observed, given = (each["obs_normalizer._mean"].shape[1] for each in (saved["actor"], actor.state_dict()))
            if observed > given:
                raise InputError(
                    f"key 'init': {checkpoint} observes {observed} numbers, and this run gives {given}; give the keys of "
                    "its task, as task.describe_part=true task.fine_grasp=true"
                )
            for name, network in (("actor", actor), ("critic", critic)):
                if name in saved:
                    network.load_state_dict(widened(saved[name], network.state_dict(), observed, given))
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
                processes.rank() == 0
            ):  # the worlds of the other processes were not saved, and begin with seeds of their own
                self.env.load_state_dict(infos["run"])
            self.logger.load_state_dict(infos["log"])
            self.seconds, self.best = infos["seconds"], infos["best"]
        except InputError:
            raise
        except Exception as error:  # of torch, pickle, zipfile: whatever a damaged file makes them raise
            why = (str(error) or type(error).__name__).splitlines()[0]
            raise InputError(
                f"{checkpoint}: not a checkpoint that this run can continue from ({why}); delete it to continue from an "
                "earlier one, or train into another folder"
            ) from error
        self._resumed = processes.rank() == 0
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
        if processes.count() == 1 or torch.device(self.device).type != "cpu":
            super()._configure_multi_gpu()
            return
        rank, count = processes.rank(), processes.count()
        self.gpu_world_size, self.gpu_global_rank, self.gpu_local_rank, self.is_distributed = count, rank, rank, True
        self.cfg["multi_gpu"] = {"global_rank": rank, "local_rank": rank, "world_size": count}
        torch.distributed.init_process_group(backend="gloo", rank=rank, world_size=count)


def make_runner(env: RslRlEnv, config: PpoConfig, log_dir: Path | None) -> Runner:
    """Return rsl-rl's runner, which holds actor, critic, optimiser and normaliser."""
    torch.backends.cuda.matmul.allow_tf32 = config.tf32
    settings = copy.deepcopy(rsl_rl_settings(config, env.env.task.privileged > 0))
    runner = Runner(env, settings, str(log_dir) if log_dir else None, device=str(env.device))
    if config.fused_adam and not config.cuda_graph:  # rsl-rl knows an optimiser by its name alone
        groups = runner.alg.optimizer.param_groups
        runner.alg.optimizer = torch.optim.Adam(groups[0]["params"], lr=config.learning_rate, fused=True)
    return runner


def train(
    env: VecEnv,
    config: PpoConfig,
    out: Path,
    checkpoint: Path | None = None,
    init: Path | None = None,
    teacher: Callable[[], Planner] | None = None,
) -> dict[str, Any]:
    """Train a policy and write checkpoints, the TensorBoard log and rsl-rl's own report (train.log) into `out`.

    Args:
        env: the worlds of this process.
        config: rsl-rl's settings.
        out: the folder.
        checkpoint: one in `out`, after which training goes on; None: it begins.
        teacher: makes whom the policy imitates in the first iterations, if it does. A run that begins with another's networks
            imitates where it has a target and these are measured below IMITATE_BELOW.
        init: of another run, with whose networks a training begins that does not go on; None: with random ones.

    Returns:
        The iteration it began with, environment steps (of all processes), seconds, environment steps a second of this
        process's training, the finished episodes and how many had each of ERRORS, the sums over recent episodes by name (of
        all processes; zeros before the worlds are warm), "target", "measured" (`Runner.measure`) and "ended" (why) where there is
        a target, and the curve: what was logged, a row an iteration.
    """
    lead = processes.rank() == 0
    first = run_folder.iteration(checkpoint) + 1 if checkpoint else 0
    if lead:
        out.mkdir(parents=True, exist_ok=True)
        run_folder.cut(out, first)
        with atomic_write(out / "policy.json") as file:
            file.write_text(json.dumps(asdict(config), indent=1))
    todo = max(0, config.iterations - first)
    all_steps = range(todo * config.num_steps_per_env)  # of which a log has a line an iteration
    steps = iter(track(all_steps, "train") if lead and is_terminal() else all_steps)
    with Path(out / "train.log" if lead else os.devnull).open("a") as log, contextlib.redirect_stdout(log):
        each = config.num_steps_per_env

        def begun(teacher: Callable[[], Planner] | None) -> tuple[RslRlEnv, Runner]:
            advice = teacher() if teacher else None
            adapter = RslRlEnv(env, config.reward_scale, lambda: next(steps, None), log_every=each, teacher=advice)
            runner = make_runner(adapter, config, out)
            if checkpoint:
                runner.resume(checkpoint)
            elif init:
                runner.begin_with(init)
            if init:
                runner.keep_normalizer()
            return adapter, runner

        goes_on = checkpoint is not None and _imitates(checkpoint)
        adapter, runner = begun(teacher if init is None or goes_on else None)
        start = runner.measure()["rate"] if init and config.target is not None and not checkpoint else math.nan
        if teacher and start < IMITATE_BELOW:
            adapter, runner = begun(teacher)
        before, why, learned = runner.seconds, "", False
        runner.target, runner.iterations = config.target, config.iterations
        if todo:
            try:
                if config.target is not None and start >= config.target:
                    runner.save(str(out / "model_0.pt"))
                    runner.confirm(str(out / "model_0.pt"))
                learned = True
                runner.learn(todo, init_at_random_ep_len=True)
            except Ended as end:
                why = str(end)
        if config.target is not None and not runner.measured and (out / BEST).is_file():
            runner.load(str(out / BEST), {"actor": True}, map_location=str(env.sim.device))
            runner.measured = runner.measure()
    next(steps, None)
    counted = dict(zip(adapter.names, processes.add_up(adapter.counted).tolist(), strict=True))
    recent = processes.add_up(adapter.recent * adapter.warm)
    done = runner.current_learning_iteration + 1 - first if learned else 0
    processes.part()
    batch = config.num_steps_per_env * env.num_envs * processes.count()
    return {
        "first_iteration": first,
        "env_steps": (first + done) * batch,
        "seconds": runner.seconds,
        "env_steps_per_second": done * batch / max(runner.seconds - before, 1e-9),
        **{name: int(counted[name]) for name in ("episodes", *ERRORS)},
        "recent": dict(zip(adapter.names, recent.tolist(), strict=True)),
        **({"target": config.target, "measured": runner.measured, "ended": why} if config.target is not None else {}),
        "curve": curve(out) if lead else [],
    }


def _imitates(checkpoint: Path) -> bool:
    """Return whether a run that is to go on has a teacher; not where its checkpoint is damaged, which `Runner.resume` reports."""
    try:
        return "teacher" in torch.load(checkpoint, weights_only=True, map_location="cpu")["infos"]["run"]
    except Exception:  # as of Runner.resume
        return False


def load_model(env: VecEnv, checkpoint: Path) -> nn.Module:
    """Return a trained policy's network with its normaliser; nothing in the file is executed.

    Raises:
        InputError: the checkpoint, or the policy.json that train writes beside it, is missing, damaged or of another kind.
    """
    settings = checkpoint.parent / "policy.json"
    missing = [str(file) for file in (checkpoint, settings) if not file.is_file()]
    if missing:
        raise InputError(
            f"checkpoint {str(checkpoint)!r}: {missing[0]}: no such file; give the model_N.pt in a folder that s2a train wrote"
        )
    trained = _settings(settings)
    with contextlib.redirect_stdout(io.StringIO()):
        runner = make_runner(RslRlEnv(env, trained.reward_scale), trained, None)
    try:
        runner.load(str(checkpoint), {"actor": True}, map_location=str(env.sim.device))
    except Exception as error:  # of torch, pickle, zipfile: whatever a damaged or hostile file makes them raise
        why = (str(error) or "empty").splitlines()[0]
        raise InputError(f"{checkpoint}: not a checkpoint of this policy ({why})") from error
    return runner.get_inference_policy(device=str(env.sim.device))


def load_policy(env: VecEnv, checkpoint: Path) -> Callable[[torch.Tensor], torch.Tensor]:
    """Return a trained policy's mean action [world action] for an observation; InputError as load_model."""
    policy = load_model(env, checkpoint)
    return lambda observation: policy(TensorDict({"policy": observation}, batch_size=[len(observation)]))


def _settings(file: Path) -> PpoConfig:
    """Return how a policy was trained, without what only makes training fast."""
    try:
        trained = config.load(PpoConfig, json.loads(file.read_text()))
    except (OSError, ValueError, AttributeError, TypeError, InputError) as error:
        raise InputError(f"{file}: not what s2a train writes ({error}); train again") from error
    return replace(trained, cuda_graph=False, torch_compile_mode=None, fused_adam=False)
