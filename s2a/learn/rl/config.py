"""The settings of proximal policy optimisation, rsl-rl's names for them, and the processes that train one policy."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeVar

import torch

from s2a.core.bounds import Count, CountFromZero, Fraction, NotEmpty, NotNegative, Positive
from s2a.core.errors import InputError

# What ends a training before it is saved
BROKEN = (
    "the policy has non-finite parameters; continue from the last checkpoint (resume=true), or train again with a smaller "
    "ppo.learning_rate or ppo.reward_scale"
)


@dataclass(frozen=True)
class PpoConfig:
    """rsl-rl's settings.

    Attributes:
        iterations: number of iterations of collecting and learning.
        num_steps_per_env: control steps per world and iteration.
        num_learning_epochs: passes over them.
        num_mini_batches: parts of a pass.
        learning_rate: rate at the start; adapted to keep the divergence at `desired_kl`.
        critic_learning_rate: the critic's own, which is not adapted; null: it has the actor's. Where the divergence holds the
            actor's at its lowest, 1e-5, a critic with the same does not follow. Needs `cuda_graph`.
        desired_kl: divergence of a policy from the one before it.
        gamma: discount of a control step.
        lam: lambda of the generalised advantage estimate.
        clip_param: clip of the probability ratio, and of the value's change where `use_clipped_value_loss` is true.
        use_clipped_value_loss: clip the value's change. It is clipped in units of the return, so that returns in the hundreds
            are learned slowly.
        reward_scale: factor of the reward that rsl-rl is given.
        value_loss_coef: weight of the value's loss.
        entropy_coef: weight of the entropy.
        max_grad_norm: norm to which the gradient is clipped.
        hidden_dims: widths of the layers of actor and critic (ELU).
        init_std: standard deviation of the first policy's actions; of another run's too, where this one begins with it.
        min_std: lower bound of an action's standard deviation.
        imitation_iterations: number of the first iterations, in which the policy does not improve by its own reward, but imitates
            the planner in the states to which it comes itself, as DAgger does (Ross et al. 2011); the critic learns meanwhile.
            Needs `cuda_graph`. A run that begins with another's policy does not imitate.
        critic_iterations: number of first iterations of a run that begins with a policy without a critic (init=pretrained),
            in which the critic alone learns. Needs `cuda_graph`.
        save_interval: iterations between checkpoints.
        target: rate of the task's first logged column at which a training ends (`Runner.measure`). What it begins with is
            measured too; an .onnx that is far from it imitates the planner in `critic_iterations`. null: a training does all its
            iterations.
        cuda_graph: collecting and updating never wait for the device, and an update is replayed as captured graphs on a GPU;
            the arithmetic is the same. Of the two below, it needs neither.
        fused_adam: take the optimiser's step in one kernel instead of some ten.
        torch_compile_mode: mode of torch.compile for the networks, and the loss if `cuda_graph` is true; null: not compiled.
        tf32: multiply matrices in TensorFloat-32 (ten bits of mantissa) on a GPU that can.
    """

    iterations: Count
    num_steps_per_env: Count
    num_learning_epochs: Count
    num_mini_batches: Count
    learning_rate: Positive
    critic_learning_rate: Positive | None
    desired_kl: Positive
    gamma: Fraction
    lam: Fraction
    clip_param: Positive
    use_clipped_value_loss: bool
    reward_scale: Positive
    value_loss_coef: NotNegative
    entropy_coef: float
    max_grad_norm: Positive
    hidden_dims: Annotated[tuple[Count, ...], NotEmpty()]
    init_std: Positive
    min_std: Positive
    imitation_iterations: CountFromZero
    critic_iterations: CountFromZero
    save_interval: Count
    target: Fraction | None
    cuda_graph: bool
    fused_adam: bool
    torch_compile_mode: Literal["default", "max-autotune-no-cudagraphs"] | None
    tf32: bool


# Settings that rsl-rl's algorithm has under the same name
OF_THE_ALGORITHM = (
    "num_learning_epochs", "num_mini_batches", "learning_rate", "desired_kl", "gamma", "lam", "clip_param",
    "use_clipped_value_loss", "value_loss_coef", "entropy_coef", "max_grad_norm",
)  # fmt: skip


def rsl_rl_settings(config: PpoConfig, privileged: bool = False) -> dict[str, Any]:
    """Return the settings under rsl-rl's names; `privileged`: the critic is told more than the actor sees."""
    hidden = list(config.hidden_dims)
    network = {"class_name": "MLPModel", "hidden_dims": hidden, "activation": "elu", "obs_normalization": True}
    gaussian = "s2a.learn.rl.cuda_graph_ppo:LazyGaussian" if config.cuda_graph else "GaussianDistribution"
    own = {
        "imitation_iterations": config.imitation_iterations,
        "compile_mode": config.torch_compile_mode,
        "critic_rate": config.critic_learning_rate,
    }
    noise = {"init_std": config.init_std, "std_range": (config.min_std, 1.0e6), "std_type": "scalar"}
    return {
        "num_steps_per_env": config.num_steps_per_env,
        "save_interval": config.save_interval,
        "obs_groups": {"actor": ["policy"], "critic": ["policy", "privileged"] if privileged else ["policy"]},
        "torch_compile_mode": config.torch_compile_mode,
        "check_for_nan": False,  # the environment resets worlds that are not finite, and counts them
        "algorithm": {
            "class_name": "s2a.learn.rl.cuda_graph_ppo:GraphPpo" if config.cuda_graph else "PPO",
            "schedule": "adaptive",
            **{name: getattr(config, name) for name in OF_THE_ALGORITHM},
            **(own if config.cuda_graph else {}),
        },
        "actor": {**network, "distribution_cfg": {"class_name": gaussian, **noise}},
        "critic": network,
    }


Item = TypeVar("Item")


def rank() -> int:
    """Return which of the processes this is; 0, the only one where torchrun was not used, writes all files."""
    return int(os.environ.get("RANK", "0"))


def count() -> int:
    """Return how many processes there are."""
    return int(os.environ.get("WORLD_SIZE", "1"))


def own_device(device: str) -> str:
    """Return the device of this process for the user's key `device`.

    Raises:
        InputError: there are several processes, and the key gives all the same GPU.
    """
    if count() == 1 or device == "cpu":
        return device
    own = f"cuda:{os.environ.get('LOCAL_RANK', '0')}" if torch.cuda.is_available() else "cpu"
    if device not in ("auto", own):
        raise InputError(f"key 'device' is {device!r}; under torchrun every process takes its own: give auto or cpu")
    return own


def own_seed(seed: int, iteration: int = 0) -> int:
    """Return a seed for this process: `seed` itself for the first process of a run that begins at iteration 0.

    A run that goes on at another iteration would otherwise draw the noise of its beginning again.
    """
    return seed + 1_000_003 * rank() + 7_919 * iteration


def own_items(items: Sequence[Item]) -> list[Item]:
    """Return every n-th of some items for n processes, so that each is one process's; all where there are fewer than n."""
    return list(items[rank() :: count()]) if len(items) >= count() else list(items)


def add_up(total: torch.Tensor) -> torch.Tensor:
    """Return the sum of a tensor over all processes; each has to call this."""
    if torch.distributed.is_initialized():
        torch.distributed.all_reduce(total)
    return total


def part() -> None:
    """End the processes' connection, if there is one."""
    if torch.distributed.is_initialized():
        torch.distributed.destroy_process_group()
