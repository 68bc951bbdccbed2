"""Names that have changed: of configuration keys, so that an old command line says what to write instead; in old result files."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

RENAMED = {
    "picture": "image",
    "look": "camera",
    "see_through": "backface_culling",
    "confinement": "sandbox",
    "mechanisms": "layers",
    "needs": "required_guarantees",
    "pieces": "hulls",
    "full": "min_fill_fraction",
    "vertices": "max_vertices",
    "settle": "drop_test",
    "longest": "max_tokens",
    "bytes": "max_response_bytes",
    "plane.lean": "max_tilt",
    "plane.rounds": "smoothing_rounds",
    "plane.slope": "max_slope",
    "plane.bin": "bin_height",
    "plane.smallest": "min_area",
    "plane.count": "max_planes",
    "regions.cells": "max_cells",
    "regions.smallest": "min_area",
    "regions.upright": "min_vertical_area",
    "regions.free": "min_clearance",
    "regions.reach": "search_height",
    "regions.lift": "noise_height",
    "regions.cover": "cover_fraction",
    "regions.wall": "rim_distance",
    "ransac.tries": "iterations",
    "ransac.lean": "max_tilt",
    "search.touch": "contact_height",
    "search.supported": "min_supported_fraction",
    "search.enough": "max_useful_clearance",
    "search.places": "max_placements",
    "search.room": "clearance_weight",
    "search.front": "facing_weight",
    "search.near": "neighbour_weight",
    "search.back": "backing_weight",
    "search.nearness": "neighbour_distance",
    "paper.tries": "attempts",
    "pose.apart": "min_spacing",
    "pose.back": "back_gap",
    "pose.gap": "contact_gap",
    "pose.lift": "lowering_height",
    "pose.slack": "swept_volume_tolerance",
    "allow.length": "max_length",
    "allow.text": "max_text",
    "allow.number": "max_number",
    "allow.items": "max_items",
    "allow.repeats": "max_repeats",
    "worlds": "num_envs",
    "pictures": "images",
    "starts_ahead": "demo_reset_fraction",
    "plan": "planner",
    "policy": "ppo",
    "policy.steps": "num_steps_per_env",
    "policy.epochs": "num_learning_epochs",
    "policy.mini_batches": "num_mini_batches",
    "policy.clip": "clip_param",
    "policy.clip_value": "use_clipped_value_loss",
    "policy.value_loss": "value_loss_coef",
    "policy.entropy": "entropy_coef",
    "policy.hidden": "hidden_dims",
    "policy.graph": "cuda_graph",
    "policy.compile": "torch_compile_mode",
    "task.end_opening": "termination_opening",
    "task.touch_distance": "contact_distance",
    "task.touch_force": "contact_force",
    "reward.led_opening": "grasped_opening",
    "sim.room": "load_static_colliders",
    "gripper.palm_box": "body_box",
    "gripper.palm_behind": "body_behind",
    "decimate.shell": "structure",
    "shell_labels": "structure_labels",
    "handle_pieces": "handle_hulls",
    "front_pieces": "front_panel_hulls",
    "room.small": "min_decomposed_size",
    "mass.lowest": "min_estimate",
    "mass.highest": "max_estimate",
    "gap.free": "min_free_fraction",
    "gap.filled": "max_fill_ratio",
    "motion.settle": "rest_displacement",
    "settle_time": "rest_time",
    "grip.touch": "max_penetration",
    "drop_test.reach": "search_radius",
    "drop_test.touch": "contact_distance",
    "regions.level": "plane",
    "snap": "project_to_scan",
    "blind": "tripod_blind_cone",
    "grazing": "grazing_cutoff",
    "thin.bump": "max_thickness",
    "thin.smallest": "min_faces",
}
"""Old name of a segment of a dotted key, or of a segment with its parent -> its present name."""


def current(key: str, known: Collection[str]) -> str | None:
    """Return the present name of a renamed dotted key, if it is among the known keys or their groups; else None."""
    new, old = _renamed_once(key), key
    while new != old:  # a segment may have been renamed after its parent
        new, old = _renamed_once(new), new
    exists = any(name == new or name.startswith(f"{new}.") for name in known)
    return new if new != key and exists else None


def _renamed_once(key: str) -> str:
    old = key.split(".")
    new = [
        RENAMED.get(f"{above}.{name}", RENAMED.get(name, name)) for above, name in zip(["", *old], old, strict=False)
    ]
    return ".".join(new)


def settings(values: Mapping[str, Any], group: str) -> dict[str, Any]:
    """Return a group's settings, as an old run's folder has them, by their present keys.

    Args:
        values: without nested ones that have been renamed.
        group: name of their group at that time, such as "policy".
    """
    now = RENAMED.get(group, group)
    own = {key.rpartition(".")[2]: value for key, value in ADDED.items() if key.rpartition(".")[0] == now}
    return own | {RENAMED.get(f"{group}.{key}", key): value for key, value in values.items()}


ADDED = {
    "sim.joint.spring": "joint",
    "sim.limits.drives": False,
    "sim.vary": None,
    "task.describe_part": False,
    "task.fine_grasp": False,
    "task.grasp_error": (0.0, 0.0),
    "task.grasp_turn": (0.0, 0.0),
    "task.action_delay": (0, 0),
    "ppo.imitation_iterations": 0,
    "ppo.critic_iterations": 0,
    "ppo.critic_learning_rate": None,
    "ppo.tf32": False,
}
"""Dotted key that older runs did not have -> the value by which they ran."""


def complete(values: dict[str, Any]) -> None:
    """Give the nested settings of an old run what has been added to their groups since."""
    for key, value in ADDED.items():
        *groups, name = key.split(".")
        group: Any = values
        for each in groups:
            group = group.get(each) if isinstance(group, dict) else None
        if isinstance(group, dict):
            group.setdefault(name, value)


OPTIONS = {("reward", "led"): "grasped"}
"""Group and old name of an option, conf/<group>/<name>.yaml -> its present name."""
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


def curve(columns: Mapping[str, Sequence[float | None]]) -> dict[str, Sequence[float | None]]:
    """Return a training's curve by its present columns; those of version 1 logged the handle's use as a part of the successes."""
    found = dict(columns)
    if used := found.pop("handle_use_of_successes", None):
        pairs = zip(columns["success"], used, strict=False)
        found["handle_success"] = [None if rate is None else rate * (part or 0.0) for rate, part in pairs]
    return found


def renamed(values: Mapping[str, Any], table: Mapping[str, str]) -> dict[str, Any]:
    """Return values with old keys replaced by new ones."""
    return {table.get(key, key): value for key, value in values.items()}
