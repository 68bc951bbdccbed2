"""The paper's table of reward weights: does PPO open a scanned drawer, and does it use the handle?

    python experiments/reward_ablation.py STAGES --runs FOLDER [--scan demo/scan --target drawer_15]
        [--second SCAN --others drawer_22 door_24] [--seeds 3] [--side-by-side 2] [--minutes 9]

STAGES is a folder with twin.usd, one_hull.usd, handle.usd, coacd.usd and moved.usd; where one is missing it is prepared from
--scan, a folder that `s2a sample` wrote (a virtual scan, whose CAD twin lies in truth/); likewise drawer.usd and door.usd, on
which our recipe is tried without change, from --second, by default `s2a sample room=bedroom`. Every row is a Hydra multirun
of `s2a train` over its seeds, each policy is measured by `s2a evaluate` in 1024 episodes. Writes
experiments/results/reward_ablation.json, its table (reward_ablation.md), docs/ablation.png (the paper's rows) and docs/best.png
(ours). With --minutes it stops in time: a run that was cut goes into the table as far as it came, and the same command later
goes on.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from curves import plot
from multirun import Row, options, sweep
from outcome import HOLDS, percent, trained, write
from scipy.spatial.transform import Rotation

from s2a.core.outputs import atomic_write
from s2a.scene.usd import sim_stage

HERE = Path(__file__).parent
RESULTS = HERE / "results/reward_ablation.json"
IMAGES = HERE.parent / "docs"

PAPER, BEST = "+experiment=paper", "+experiment=best"
SHIFT = (0.0, 0.0, 0.01)
"""How the grasp point is moved "by hand" [m], along the grasp frame's axes: deeper behind the handle, whose mean lies in it."""
WEIGHTS = {
    "paper": ("(1.5, 1.5, 10, 2)", "87 to 88 %, handle not used"),
    "handle": ("(50.5, 50.5, 10, 50)", "74 %, handle used"),
}
"""Name in conf/reward -> weights of distance, rotation, opening and finger, and what the paper reports on its scan."""
COLLIDERS = {"one_hull": "one hull", "handle": "finger gap kept free"}
OURS = (
    ("twin", "twin", "CAD twin"),
    ("scan", "handle", "scan, finger gap kept free"),
    ("drawer", "drawer", "another scan's drawer"),
    ("door", "door", "another scan's hinged door"),
)
"""Row, stage and description of what our recipe is tried on, without change."""
COLUMNS = {"success": "opened by 0.20 m", "final_success": "open at the end", **HOLDS}


def table_rows(seeds: int, best_steps: float | None = None) -> list[Row]:
    """Return the rows of the table; the two side questions are asked with one seed; `best_steps` are those of our recipe."""
    first, paper = WEIGHTS["paper"]
    return [
        Row("twin_paper", "twin.usd", (PAPER,), seeds, f"CAD twin, {first}", "98 %, handle used"),
        *(
            Row(f"{c}_{r}", f"{c}.usd", (PAPER, f"reward={r}"), seeds, f"scan, {colliders}, {weights}", reported)
            for c, colliders in COLLIDERS.items()
            for r, (weights, reported) in WEIGHTS.items()
        ),
        Row("coacd_paper", "coacd.usd", (PAPER,), 1, f"scan, coacd's default, {first}", paper),
        Row("moved_paper", "moved.usd", (PAPER,), 1, f"scan, grasp point moved by hand, {first}", "tried"),
        *(
            Row(f"{name}_best", f"{stage}.usd", (BEST,), seeds, f"{about}, our recipe", env_steps=best_steps)
            for name, stage, about in OURS
        ),
    ]


def main() -> None:
    """Stages, runs, evaluations, table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stages", type=Path)
    parser.add_argument("--scan", type=Path, default=Path("demo/scan"))
    parser.add_argument("--target", default="drawer_15")
    parser.add_argument("--second", type=Path, help="another scan")
    parser.add_argument(
        "--others", nargs=2, default=["drawer_22", "door_24"], metavar=("DRAWER", "DOOR"), help="parts of it"
    )
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--images", type=Path, default=IMAGES, help="folder of ablation.png and best.png")
    parser.add_argument("--best-steps", type=float, default=57.344e6, help="environment steps of a run of our recipe")
    options(parser)
    args = parser.parse_args()
    make_stages(args.scan, args.target, args.stages)
    make_others(args.second, args.others, args.stages)
    rows = table_rows(args.seeds, args.best_steps)
    runs = sweep(rows, args.stages, args)
    write({"scan": "virtual", "target": args.target, "others": args.others, "runs": runs}, args.out, table(rows, runs))
    for name, ours in (("ablation", False), ("best", True)):
        if shown := [run for run in runs if run["row"].endswith("_best") == ours]:
            plot(shown, args.images / f"{name}.png")


def make_stages(scan: Path, target: str, stages: Path) -> None:
    """Prepare the stages that are not there yet: the scan with three kinds of colliders, the twin, the moved grasp point."""
    scanned, twin = stages / "geometric.usd", scan / "truth/truth.usda"
    missing = [name for name in ("one_hull", "handle", "coacd") if not (stages / f"{name}.usd").is_file()]
    if missing and not scanned.is_file():
        _s2a("export", f"scan={scan}", f"out={stages}")
    for name in missing:
        _s2a("prepare", f"stage={scanned}", f"targets={target}", f"prepare={name}", f"out={stages}/{name}.usd")
    if not (stages / "twin.usd").is_file():
        _s2a("prepare", f"stage={twin}", f"targets={target}", f"out={stages}/twin.usd")
    if not (stages / "moved.usd").is_file():
        move_grasp(stages / "handle.usd", target, SHIFT, stages / "moved.usd")


def make_others(scan: Path | None, targets: list[str], stages: Path) -> None:
    """Prepare another scan's drawer and door where they are not there yet; without a scan, a bedroom is sampled."""
    for name, target in zip(("drawer", "door"), targets, strict=True):
        if (stages / f"{name}.usd").is_file():
            continue
        second = stages / "second"
        if not (second / "geometric.usd").is_file():
            if scan is None:
                scan = stages / "second/scan"
                _s2a("sample", "room=bedroom", f"out={scan}")
            _s2a("export", f"scan={scan}", f"out={second}")
        _s2a("prepare", f"stage={second}/geometric.usd", f"targets={target}", f"out={stages}/{name}.usd")


def move_grasp(stage: Path, target: str, shift: tuple[float, float, float], out: Path) -> None:
    """Copy a sim.usd with its grasp point moved along the axes of its grasp frame [m]; the grasp region stays."""
    room = sim_stage.read(stage)
    part = room.articulations[target]
    turn = Rotation.from_quat(part.grasp.orientation)
    point = tuple(map(float, np.array(part.grasp.point) + turn.apply(shift)))
    moved = replace(part, grasp=replace(part.grasp, point=point))
    with atomic_write(sim_stage.visuals_file(out)) as visuals, atomic_write(out) as copy:
        sim_stage.write(replace(room, articulations={**room.articulations, target: moved}), copy, visuals)


def table(rows: list[Row], runs: list[dict]) -> list[str]:
    """Return the lines of a Markdown table: what the paper reports and what came out, seed by seed."""
    weights = "virtual scan, weights (distance, rotation, opening, finger)"
    titles = [weights, "paper, real scan", *COLUMNS.values(), "steps, millions"]
    lines = [f"| {' | '.join(titles)} |", "|" + "---|" * len(titles)]
    for row in rows:
        mine = [run for run in runs if run["row"] == row.name]
        rates = [percent(run["evaluation"][name]["rate"] for run in mine) for name in COLUMNS]
        lines.append(f"| {row.about} | {row.paper} | {' | '.join(rates)} | {trained(mine)} |")
    return lines


def _s2a(*arguments: str) -> None:
    """Run a command of s2a; what it says goes to the terminal, and its failure ends the experiment."""
    if subprocess.run([sys.executable, "-m", "s2a", *arguments]).returncode:
        sys.exit(f"s2a {' '.join(arguments)}: failed")


if __name__ == "__main__":
    main()
