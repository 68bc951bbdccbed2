"""The mean of trained policies' weights, as a run folder: `python tools/average_policies.py OUT runs/a/model_9.pt ...`.

Policies that went on from the same checkpoint (`init=`) lie near enough to each other for it ("model soups", Wortsman
et al. 2022, arXiv 2203.05482). They keep its normaliser; others are refused, as their networks see different numbers.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

import torch

from s2a.errors import InputError
from s2a.rl import run_world

ACTOR = "actor_state_dict"


def average(files: Sequence[Path], weights: Sequence[float]) -> dict[str, torch.Tensor]:
    """Return the weighted mean of the actors' states; InputError where they have not the same network and normaliser."""
    if len(weights) != len(files) or sum(weights) <= 0:
        raise InputError(
            f"{len(files)} checkpoints and weights {list(weights)}: give a weight to each, their sum positive"
        )
    states = [torch.load(file, map_location="cpu", weights_only=True)[ACTOR] for file in files]
    for file, state in zip(files, states, strict=True):
        if {k: v.shape for k, v in state.items()} != {k: v.shape for k, v in states[0].items()}:
            raise InputError(f"{file}: another network than {files[0]}'s; give policies with the same ppo.hidden_dims")
        normaliser = [k for k in state if k.startswith("obs_normalizer")]
        if not all(torch.equal(state[k], states[0][k]) for k in normaliser):
            raise InputError(f"{file}: another normaliser than {files[0]}'s; give policies trained with the same init=")
    total = sum(weights)
    same = {k: v for k, v in states[0].items() if k.startswith("obs_normalizer")}
    return {k: sum(w / total * s[k] for w, s in zip(weights, states, strict=True)) for k in states[0]} | same


def main() -> int:
    """Write the folder; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="folder that is written")
    parser.add_argument("checkpoint", type=Path, nargs="+", help="model_N.pt in folders that s2a train wrote")
    parser.add_argument("--weights", type=float, nargs="+", help="of each; equal without")
    args = parser.parse_args()
    try:
        worlds = {(file.parent / run_world.FILE).read_text() for file in args.checkpoint}
        if len(worlds) > 1:
            raise InputError(
                "the policies were trained in different worlds (world.json); give those of one arm and task"
            )
        mean = average(args.checkpoint, args.weights or [1.0] * len(args.checkpoint))
    except (InputError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    args.out.mkdir(parents=True, exist_ok=True)
    first = args.checkpoint[0]
    for name in ("policy.json", run_world.FILE):
        shutil.copyfile(first.parent / name, args.out / name)
    torch.save(torch.load(first, map_location="cpu", weights_only=True) | {ACTOR: mean}, args.out / "model_0.pt")
    print(args.out / "model_0.pt")
    return 0


if __name__ == "__main__":
    sys.exit(main())
