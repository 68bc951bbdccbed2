"""PPO without waiting for the device: rsl-rl's own arithmetic, a mini-batch as two captured graphs.

rsl-rl waits for the GPU some six times a mini-batch (the divergence, the losses) and launches some hundred small kernels in
between; with 8 x 8 mini-batches of networks as small as these, that is most of an update.
"""

import contextlib
import math
from collections.abc import Callable, Iterator
from itertools import chain
from typing import Any

import torch
from rsl_rl.algorithms import PPO
from rsl_rl.modules import GaussianDistribution
from torch import nn

from s2a.core.errors import InputError
from s2a.learn.rl import config
from s2a.learn.rl.adapter import TEACHER
from s2a.learn.rl.config import BROKEN

LOWEST_RATE = 1e-5  # Down to which the learning rate adapts, as rsl-rl has it


class LazyGaussian(GaussianDistribution):
    """rsl-rl's distribution; torch.normal, which it samples with, waits for the device to see that no deviation is negative."""

    def sample(self) -> torch.Tensor:
        """Draw as torch.normal does."""
        return torch.randn_like(self.mean) * self.std + self.mean


class GraphPpo(PPO):
    """rsl-rl's PPO for plain networks; losses, divergence and learning rate stay on the device until an update ends.

    On a GPU the first update warms up, the second is captured, and it and all later ones are replayed. On a CPU there is
    nothing to capture. With several processes, gradients and divergence are averaged in one message between the graphs.
    """

    learning_rate: float

    def __init__(
        self,
        *args: Any,
        imitation_iterations: int = 0,
        compile_mode: str | None = None,
        critic_rate: float | None = None,
        **kwargs: Any,
    ) -> None:
        """Build rsl-rl's algorithm, with an optimiser whose learning rate is a tensor.

        `compile_mode` is torch.compile's for the loss and its gradient; None: they are not compiled. `critic_rate` is the
        critic's learning rate, which no divergence changes; None: it has the actor's.

        In the first `imitation_iterations` updates the actor's loss is the squared difference of its mean action to the
        teacher's, summed over the joints, at the first learning rate, and the value's change is not clipped. Where there is no
        teacher, the policy stays as it is, and the critic alone learns.
        """
        super().__init__(*args, **kwargs)
        self._imitating, self._first_rate = imitation_iterations, self.learning_rate
        self._cuda = torch.device(self.device).type == "cuda"
        if self._cuda:
            torch.cuda.set_device(self.device)  # torch captures what the current device does, which is else the first
        self._rate = torch.tensor(self.learning_rate, device=self.device)
        self._parameters = list(chain(self._raw_actor.parameters(), self._raw_critic.parameters()))
        self._critic_rate = None if critic_rate is None else torch.tensor(critic_rate, device=self.device)
        networks = (self._raw_actor, self._raw_critic)
        groups: list[dict[str, Any]] = [{"params": self._parameters}]
        if self._critic_rate is not None:
            groups = [{"params": list(network.parameters())} for network in networks]
            groups[1]["lr"] = self._critic_rate
        self.optimizer = torch.optim.Adam(groups, lr=self._rate, fused=True, capturable=self._cuda)
        size = self.storage.num_envs * self.storage.num_transitions_per_env
        self._index = torch.zeros(size // self.num_mini_batches, dtype=torch.long, device=self.device)
        self._losses = torch.zeros(3, device=self.device)
        # All gradients side by side, and the divergence; the parameters' own gradients are views of it.
        self._packed = torch.zeros(sum(p.numel() for p in self._parameters) + 1, device=self.device)
        for p, view in zip(
            self._parameters, self._packed[:-1].split([p.numel() for p in self._parameters]), strict=True
        ):
            p.grad = view.view_as(p)
        self._batch: tuple[torch.Tensor, ...] = ()
        self._taught: torch.Tensor | None = None
        self._updates = 0
        self._replays: tuple[Callable[[], object], ...] = ()
        self._loss = (
            torch.compile(self._objective, mode=compile_mode, dynamic=False) if compile_mode else self._objective
        )

    def update(self) -> dict[str, float]:
        """Run all epochs over the stored steps and return the mean losses.

        Raises:
            InputError: a loss or a parameter is not finite.
        """
        size = len(self._index)
        explained = 1.0 - (self.storage.returns - self.storage.values).var() / self.storage.returns.var()
        indices = torch.randperm(self.num_mini_batches * size, device=self.device)
        self._fill()
        self._losses.zero_()
        with self._aside():
            differentiate, apply = self._pieces()
            for start in list(range(0, len(indices), size)) * self.num_learning_epochs:
                self._index.copy_(indices[start : start + size])
                differentiate()
                config.add_up(self._packed)
                apply()
        self._updates += 1
        if self._imitating:
            self._imitating -= 1
            if not self._imitating:  # another arithmetic is captured from here on
                self._updates, self._replays = 0, ()
                if self._taught is None:
                    self._begin_gently()
        count = self.num_learning_epochs * self.num_mini_batches
        with torch.no_grad():
            norms = torch.stack([p.norm() for p in self._parameters])
            seen = torch.stack([norms.sum(), explained, self._packed[-1]])
            value, surrogate, entropy, norm, explained, divergence = torch.cat([self._losses / count, seen]).tolist()
        if not math.isfinite(value + surrogate + entropy + norm):  # before anything of it is saved
            raise InputError(BROKEN)
        self.learning_rate = float(self._rate)
        observations = self.storage.observations.flatten(0, 1)
        self._raw_actor.update_normalization(observations)
        self._raw_critic.update_normalization(observations)
        self.storage.clear()
        losses = {"value": value, "surrogate": surrogate, "entropy": entropy}
        return losses | {"explained_variance": explained, "divergence": divergence}

    def save(self) -> dict:
        """Return what a checkpoint holds, as rsl-rl has it."""
        saved = super().save()
        for group in saved["optimizer_state_dict"]["param_groups"]:
            group["lr"] = float(group["lr"])
        return saved

    def load(self, loaded_dict: dict, load_cfg: dict | None, strict: bool) -> bool:
        """Load a checkpoint; what was captured is forgotten."""
        with_iteration = super().load(loaded_dict, load_cfg, strict)
        self.learning_rate = float(self.optimizer.param_groups[0]["lr"])
        self._rate.fill_(self.learning_rate)
        for group, rate in zip(self.optimizer.param_groups, (self._rate, self._critic_rate), strict=False):
            group.update(lr=rate, fused=True, capturable=self._cuda)
        self._updates, self._replays = 0, ()
        if with_iteration:
            self._imitating = max(0, self._imitating - 1 - loaded_dict["iter"])
        return with_iteration

    def _begin_gently(self) -> None:
        """Let a policy that waited for its critic begin to learn with Adam's first step, at the lowest rate.

        In updates without a gradient Adam's moments come to nothing, and the steps after them, which it then takes for not the
        first ones, are three to seven times the rate: the policy would be lost before its divergence is known.
        """
        for parameter in self._raw_actor.parameters():
            for moment in self.optimizer.state[parameter].values():
                moment.zero_()
        self._rate.fill_(LOWEST_RATE)

    def _fill(self) -> None:
        """Lay out the stored steps where the graphs read them: most lie there always, three are new in every update."""
        st = self.storage
        observations = st.observations.flatten(0, 1)
        new = [model.get_latent(observations) for model in (self._raw_actor, self._raw_critic)]
        new.append(st.advantages.flatten(0, 1).squeeze(1))
        if self._imitating:
            has_teacher = TEACHER in st.observations.keys()  # noqa: SIM118  a TensorDict's "in" looks for values
            self._taught = st.observations[TEACHER].flatten(0, 1) if has_teacher else None
        if not self._batch:
            stored = (st.actions, st.values, st.returns, st.actions_log_prob.squeeze(2), *st.distribution_params)
            self._batch = (*(torch.empty_like(x) for x in new), *(x.flatten(0, 1) for x in stored))
        with torch.no_grad():
            for buffer, value in zip(self._batch, new, strict=False):
                buffer.copy_(value)

    def _pieces(self) -> tuple[Callable[[], object], ...]:
        """Return the two halves of a mini-batch, before and after the processes exchange gradients."""
        halves = (self._differentiate, self._apply)
        if not self._cuda or self._updates == 0:
            return halves
        if not self._replays:
            self._replays = tuple(_capture(half) for half in halves)
        return self._replays

    def _differentiate(self) -> None:
        """Compute gradients and divergence of the mini-batch that the index names."""
        loss, divergence, losses = self._loss(self._index, *self._batch, self._taught, bool(self._imitating))
        gradients = torch.autograd.grad(loss, self._parameters)
        self._packed.copy_(torch.cat([*(g.flatten() for g in gradients), divergence[None]]))
        self._losses.add_(losses)

    def _objective(self, index: torch.Tensor, *data: Any) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Return the loss, the divergence from the policy that collected, and the losses of value, policy and entropy."""
        *batch, taught, imitating = data
        seen, judged, advantage, action, old_value, goal, old_log, old_mean, old_std = (x[index] for x in batch)
        policy = self._raw_actor.distribution
        policy.update(self._raw_actor.mlp(seen))
        with torch.no_grad():
            divergence = policy.kl_divergence((old_mean, old_std), policy.params).mean()
        if imitating and taught is None:  # gradients of exactly zero: Adam would make steps of rounding errors
            surrogate = 0.0 * policy.mean.sum()
        elif imitating:
            surrogate = (policy.mean - taught[index]).square().sum(dim=1).mean()
        else:
            ratio = torch.exp(policy.log_prob(action) - old_log)
            limited = ratio.clamp(1.0 - self.clip_param, 1.0 + self.clip_param)
            surrogate = torch.max(-advantage * ratio, -advantage * limited).mean()
        value = self._raw_critic.mlp(judged)
        error = (value - goal).square()
        # A critic that begins has values of nothing: a change of 0.2 an iteration would take it hundreds to returns of 50.
        if self.use_clipped_value_loss and not imitating:
            near = old_value + (value - old_value).clamp(-self.clip_param, self.clip_param)
            error = torch.max(error, (near - goal).square())
        value_loss, entropy = error.mean(), policy.entropy.mean()
        curious = 0.0 if imitating else self.entropy_coef
        loss = surrogate + self.value_loss_coef * value_loss - curious * entropy
        return loss, divergence, torch.stack([value_loss, surrogate, entropy]).detach()

    def _apply(self) -> None:
        """Adapt the learning rate to the divergence, as rsl-rl does, and take a step."""
        self._packed.div_(config.count())
        divergence, rate = self._packed[-1], self._rate
        slower, faster = (rate / 1.5).clamp(min=LOWEST_RATE), (rate * 1.5).clamp(max=1e-2)
        timid = (divergence < 0.5 * self.desired_kl) & (divergence > 0.0)
        if self._imitating:
            rate.fill_(self._first_rate)
        else:
            rate.copy_(torch.where(divergence > 2.0 * self.desired_kl, slower, torch.where(timid, faster, rate)))
        nn.utils.clip_grad_norm_(self._raw_actor.parameters(), self.max_grad_norm)
        nn.utils.clip_grad_norm_(self._raw_critic.parameters(), self.max_grad_norm)
        self.optimizer.step()

    @contextlib.contextmanager
    def _aside(self) -> Iterator[None]:
        """Run the first update on a stream of its own, which capture asks of a warm-up."""
        if not self._cuda or self._updates > 0:
            yield
            return
        main, side = torch.cuda.current_stream(), torch.cuda.Stream()
        side.wait_stream(main)
        with torch.cuda.stream(side):
            yield
        main.wait_stream(side)


def _capture(function: Callable[[], None]) -> Callable[[], None]:
    graph = torch.cuda.CUDAGraph()
    with torch.cuda.graph(graph):
        function()
    return graph.replay
