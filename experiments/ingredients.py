"""What is each ingredient of `conf/experiment/best.yaml` worth? The best recipe, and the best recipe minus one.

    python experiments/ingredients.py STAGE --runs FOLDER [--seeds 3] [--minutes M] [--side-by-side 1]

STAGE is the sim.usd of one part. Writes experiments/results/ingredients.json, its table (ingredients.md) and
docs/ingredients.png. A run that was cut goes into the table as far as it came; the same command later goes on.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from curves import plot
from multirun import Row, options, sweep
from outcome import HOLDS, half_after, percent, trained, write

HERE = Path(__file__).parent
RESULTS = HERE / "results/ingredients.json"
IMAGE = HERE.parent / "docs/ingredients.png"
BEST = "+experiment=best"
REFERENCE_TOOL = "task.tcp_offset=[-0.0282842712,0.0282842712,-0.045]"
"""Of the reference task, as in conf/task/open_part.yaml."""

CHANGES = {
    "best": ("as it is", ()),
    "no_starts": ("no episode starts on a demonstration", ("demo_reset_fraction=0",)),
    "no_closing": ("no reward for closing around the handle", ("reward.closing=0",)),
    "neither": ("neither of these two", ("demo_reset_fraction=0", "reward.closing=0")),
    "plain_opening": ("an opening counts however it came about", ("reward.grasped_opening=0", "reward.opening=22")),
    "led_alone": ("no reward for an opening that was not grasped", ("reward.opening=0",)),
    "soft_arm": ("the paper's arm: stiffness 80, its weight not held", ("sim=paper",)),
    "reference_tool": ("the reference's tool frame", (REFERENCE_TOOL,)),
    "ends_at_success": ("an episode ends at 0.39 m", ("task.termination_opening=0.39",)),
    "full_reward": ("rewards not scaled down", ("ppo.reward_scale=1",)),
    "free_value": ("the value's change is not clipped", ("ppo.use_clipped_value_loss=false",)),
}
"""Name -> what it is, and the overrides."""
COLUMNS = {
    "success": "opened by 0.20 m",
    "final_success": "open by 0.20 m at the end",
    **HOLDS,
}


def main() -> None:
    """Train and evaluate every change, then write results, table and image."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stage", type=Path)
    options(parser)
    args = parser.parse_args()
    rows = [Row(n, args.stage.name, (BEST, *o), args.seeds, about) for n, (about, o) in CHANGES.items()]
    runs = sweep(rows, args.stage.parent, args)
    write({"scan": "virtual", "runs": runs}, RESULTS, table(rows, runs))
    plot(runs, IMAGE)


def table(rows: list[Row], runs: list[dict]) -> list[str]:
    """Return the lines of a Markdown table: the rates of every change, seed by seed."""
    half = "half of the training episodes with both fingers on the handle after, millions"
    columns = ["best, but", *COLUMNS.values(), half, "steps, millions"]
    lines = [f"| {' | '.join(columns)} |", "|" + "---|" * len(columns)]
    for row in rows:
        mine = [run for run in runs if run["row"] == row.name]
        rates = [percent([run["evaluation"][name]["rate"] for run in mine]) for name in COLUMNS]
        after = " / ".join(half_after(run["curve"]) for run in mine)
        lines.append(f"| {row.about} | {' | '.join(rates)} | {after} | {trained(mine)} |")
    return lines


if __name__ == "__main__":
    main()
