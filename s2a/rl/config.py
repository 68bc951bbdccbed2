"""The settings of proximal policy optimisation, and rsl-rl's names for them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

from s2a.ranges import Count, Fraction, NotEmpty, NotNegative, Positive

BROKEN = (
    "the policy is no number any more; go on from the last checkpoint (resume=true), or train anew with a smaller "
    "policy.learning_rate or policy.reward_scale"
)
"""What ends a training before it is saved."""


@dataclass(frozen=True)
class PpoConfig:
    """rsl-rl's settings.

    Attributes:
        iterations: of collecting and learning.
        steps: control steps a world collects for an iteration.
        epochs: passes over them.
        mini_batches: parts of a pass.
        learning_rate: at the start; adapted to keep the divergence at `desired_kl`.
        desired_kl: divergence of a policy from the one before it.
        gamma: discount of a control step.
        lam: of the generalised advantage estimate.
        clip: of the probability ratio, and of the value's change where `clip_value` is true.
        clip_value: whether the value's change is clipped. It is clipped in units of the return, so that returns in the hundreds
            are learned slowly.
        reward_scale: factor of the reward that rsl-rl is given.
        value_loss: weight of the value's loss.
        entropy: weight of the entropy.
        max_grad_norm: where the gradient is cut.
        hidden: widths of the layers of actor and critic (ELU).
        init_std: standard deviation of the first policy's actions.
        save_interval: iterations between checkpoints.
        graph: whether collecting and updating never wait for the device, and an update is replayed as captured graphs on a GPU;
            the arithmetic is the same. Of the two below, it needs neither.
        fused_adam: whether the optimiser's step is one kernel instead of some ten.
        compile: how torch.compile treats the networks; null: not at all.
    """

    iterations: Count
    steps: Count
    epochs: Count
    mini_batches: Count
    learning_rate: Positive
    desired_kl: Positive
    gamma: Fraction
    lam: Fraction
    clip: Positive
    clip_value: bool
    reward_scale: Positive
    value_loss: NotNegative
    entropy: float
    max_grad_norm: Positive
    hidden: Annotated[tuple[Count, ...], NotEmpty()]
    init_std: Positive
    save_interval: Count
    graph: bool
    fused_adam: bool
    compile: Literal["default", "max-autotune-no-cudagraphs"] | None


def rsl_rl_settings(config: PpoConfig) -> dict[str, Any]:
    """Return the settings under rsl-rl's names."""
    network = {
        "class_name": "MLPModel",
        "hidden_dims": list(config.hidden),
        "activation": "elu",
        "obs_normalization": True,
    }
    gaussian = "s2a.rl.cuda_graph_ppo:LazyGaussian" if config.graph else "GaussianDistribution"
    distribution = {"class_name": gaussian, "init_std": config.init_std, "std_type": "scalar"}
    return {
        "num_steps_per_env": config.steps,
        "save_interval": config.save_interval,
        "obs_groups": {"actor": ["policy"], "critic": ["policy"]},
        "torch_compile_mode": config.compile,
        "check_for_nan": False,  # the environment resets worlds that are not finite, and counts them
        "algorithm": {
            "class_name": "s2a.rl.cuda_graph_ppo:GraphPpo" if config.graph else "PPO",
            "num_learning_epochs": config.epochs,
            "num_mini_batches": config.mini_batches,
            "learning_rate": config.learning_rate,
            "schedule": "adaptive",
            "desired_kl": config.desired_kl,
            "gamma": config.gamma,
            "lam": config.lam,
            "clip_param": config.clip,
            "use_clipped_value_loss": config.clip_value,
            "value_loss_coef": config.value_loss,
            "entropy_coef": config.entropy,
            "max_grad_norm": config.max_grad_norm,
        },
        "actor": {**network, "distribution_cfg": distribution},
        "critic": network,
    }
