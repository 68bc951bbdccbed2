"""How well a policy does on unseen furniture against the number of parts that it was trained on -> a row a training.

    python experiments/number_of_parts.py pools/train/pool.json pools/test/fourth.json --parts 1 4 16 64 256 --seeds 0 1 2 \
        [--iterations 500] [--episodes 8] [--runs runs/number_of_parts] [--device cuda:0] [--out FILE] \
        [--image FILE] [KEY=VALUE ...]

Every training begins from nothing, with `+experiment=many` and the same number of environment steps. The parts of a seed are
the first ones of one random order, so that those of a smaller number are among those of a larger one. A row that is there is not
run again, and a training that was cut goes on from its last checkpoint. KEY=VALUE are keys of `s2a train`. --image FILE draws the
rows that are there.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path

import numpy as np

from s2a.core.outputs import atomic_write
from s2a.learn.rl import run_folder

RATES = ("success", "final_success", "grasp_success")


def main() -> None:
    """Train and measure what is missing, and write the rows after each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("train", type=Path, help="index of the parts to draw from")
    parser.add_argument("test", type=Path, help="index of the unseen parts")
    parser.add_argument("--parts", type=int, nargs="+", default=[1, 4, 16, 64, 256])
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--iterations", type=int, default=500)
    parser.add_argument("--episodes", type=int, default=8, help="of each unseen part")
    parser.add_argument("--runs", type=Path, default=Path("runs/number_of_parts"))
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--out", type=Path, default=Path("experiments/results/number_of_parts.json"))
    parser.add_argument("--image", type=Path, help="to draw, instead of training")
    parser.add_argument("keys", nargs="*")
    args = parser.parse_intermixed_args()
    if args.image:
        _draw(json.loads(args.out.read_text())["rows"], args.image)
        return
    for seed in args.seeds:
        for count in args.parts:
            rows = json.loads(args.out.read_text())["rows"] if args.out.is_file() else []
            if any((row["parts"], row["seed"]) == (count, seed) for row in rows):
                continue
            rows.append(_row(args, count, seed))
            print(rows[-1], flush=True)
            with atomic_write(args.out) as file:
                file.write_text(json.dumps({"rows": rows}, indent=1) + "\n")


def drawn(index: Path, count: int, seed: int) -> Path:
    """Write an index of the first `count` parts of a seed's random order beside that of all, and return it."""
    content = json.loads(index.read_text())
    if count > len(content["parts"]):
        sys.exit(f"{index} has {len(content['parts'])} parts, not {count}")
    order = np.random.default_rng(seed).permutation(len(content["parts"]))
    chosen = [content["parts"][i] for i in sorted(order[:count])]
    place = index.with_name(f"{index.stem}_{count}_{seed}.json")
    with atomic_write(place) as file:
        file.write_text(json.dumps({**content, "parts": chosen}))
    return place


def _row(args: argparse.Namespace, count: int, seed: int) -> dict[str, object]:
    run = args.runs / f"{count}_{seed}"
    index = drawn(args.train, count, seed)
    common = [f"stage={index}", f"device={args.device}", f"seed={seed}", f"ppo.iterations={args.iterations}"]
    if not (run / "metrics.json").is_file():
        _s2a("train", *common, "+experiment=many", f"out={run}", "resume=true", "export=true", *args.keys)
    measured = {}
    for name, parts in (("test", args.test), ("train", index)):
        found = run / f"{name}.json"
        policy = run_folder.latest(run)
        _s2a(
            "bench",
            f"stage={parts}",
            f"policy={policy}",
            f"episodes={args.episodes}",
            "seed=7",
            f"out={found}",
            f"device={args.device}",
        )
        measured[name] = {rate: json.loads(found.read_text())["over_parts"]["all"][rate] for rate in RATES}
    about = json.loads((run / "metrics.json").read_text())
    kept = {key: about[key] for key in ("env_steps", "seconds", "commit", "device") if key in about}
    return {"parts": count, "seed": seed, "iterations": args.iterations, **measured, **kept}


def _draw(rows: list[dict], image: Path) -> None:
    """Draw unseen parts and those trained on beside each other: every training, and the mean over seeds."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(8.0, 3.0), sharey=True, layout="constrained")
    for axis, name, title in zip(axes, ("test", "train"), ("41 unseen parts", "the parts trained on"), strict=True):
        for rate, label, color in (("success", "opened", "#57606a"), ("grasp_success", "grasped", "#2a8a3c")):
            counts = sorted({row["parts"] for row in rows})
            found = [[100 * row[name][rate]["rate"] for row in rows if row["parts"] == count] for count in counts]
            axis.plot(counts, [np.mean(each) for each in found], color=color, label=f"{label}, mean over seeds")
            for count, each in zip(counts, found, strict=True):
                axis.plot([count] * len(each), each, "o", color=color, markersize=4, alpha=0.6)
        axis.set(xscale="log", xticks=counts, xlabel="parts in training", title=title, ylim=(-3, 103))
        axis.set_xticks(counts, [str(count) for count in counts])
        axis.minorticks_off()
    axes[0].set_ylabel("episodes [%]")
    axes[1].legend(frameon=False)
    figure.savefig(image, dpi=110)


def _s2a(*arguments: str) -> None:
    subprocess.run([sys.executable, "-m", "s2a", *arguments], check=True)


if __name__ == "__main__":
    main()
