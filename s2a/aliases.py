"""Old names in result files and run folders, by the names that took their place in November 2026."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

PPO = {
    "steps": "num_steps_per_env",
    "epochs": "num_learning_epochs",
    "mini_batches": "num_mini_batches",
    "clip": "clip_param",
    "clip_value": "use_clipped_value_loss",
    "value_loss": "value_loss_coef",
    "entropy": "entropy_coef",
    "hidden": "hidden_dims",
    "graph": "cuda_graph",
    "compile": "torch_compile_mode",
}
"""Settings of PPO, in policy.json and settings.json."""
METRICS = {
    "hook_success": "single_finger_success",
    "side_success": "off_handle_success",
    "wide": "open_30cm",
    "final_wide": "final_open_30cm",
    "static": "open_75pct_static",
    "final_static": "final_open_75pct_static",
    "full": "open_95pct",
    "final_full": "final_open_95pct",
}
"""Columns of evaluations; those that say by what the part was held counted steps then, not opening (metrics version 1)."""


def renamed(values: Mapping[str, Any], table: Mapping[str, str]) -> dict[str, Any]:
    """Return values with old keys replaced by new ones."""
    return {table.get(key, key): value for key, value in values.items()}
