"""The rows of a table as Hydra multiruns of `s2a train`, and every policy measured by `s2a evaluate`.

A row is one multirun over its seeds. Hydra's own launchers place no jobs on GPUs and do not stop at a wall-clock limit, so
the multiruns are handed out job by job. Job `RUNS/<row>-<seed>/` holds `run/` (what `s2a train` writes), `evaluation.json`
and `log.txt`. What is finished is kept; what was cut, or is now wanted longer, goes on from its last checkpoint.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from outcome import curve
from side_by_side import gpu_slots, run

from s2a import tasks
from s2a.core import config
from s2a.core.provenance import starts
from s2a.learn.rl import run_folder

S2A = (sys.executable, "-m", "s2a")
TASK = tasks.task("open_part")
EVALUATION_SEED = 100
"""Plus the training's seed: the start noise of evaluation, which no training has met."""
SAVE_INTERVAL = 10
"""Iterations between checkpoints: what a cut can cost."""
NOT_SETTINGS = ("stage", "out", "resume", "export", "device", "planner")
"""Keys of `s2a train` that say nothing of the experiment."""


@dataclass(frozen=True)
class Row:
    """A row of a table.

    Attributes:
        name: of the row, and of its runs' folders.
        stage: file in the folder of stages.
        overrides: of `s2a train`, except stage, seed, number of environments and length.
        seeds: how many are trained, from 0.
        about: what the row is, for the table.
        paper: what the paper reports for it.
        env_steps: of a run; None: what the command says.
    """

    name: str
    stage: str
    overrides: tuple[str, ...]
    seeds: int
    about: str
    paper: str = ""
    env_steps: float | None = None


@dataclass(frozen=True)
class Job:
    """One run of a row, and where its files lie."""

    row: Row
    seed: int
    folder: Path

    def finished(self, iterations: int) -> bool:
        """The training reached this many iterations."""
        return self.checkpoint is not None and run_folder.iteration(self.checkpoint) + 1 >= iterations

    @property
    def checkpoint(self) -> Path | None:
        """The last checkpoint, or None before the first."""
        return run_folder.latest(self.folder / "run")

    @property
    def measured(self) -> Path:
        """The file that says what an evaluation found."""
        return self.folder / "evaluation.json"

    @property
    def evaluated(self) -> bool:
        """No checkpoint remains to be evaluated, and every evaluation has the present columns."""
        checkpoint = self.checkpoint
        if checkpoint is None or not self.measured.is_file():
            return checkpoint is None
        # Times alone do not tell: in a folder that was copied from another machine all files may be of one second.
        found = json.loads(self.measured.read_text())
        whole = Path(found["policy"]).name == checkpoint.name and found.get("metrics_version") == TASK.RESULTS.version
        return whole and self.measured.stat().st_mtime >= checkpoint.stat().st_mtime


def options(parser: argparse.ArgumentParser) -> None:
    """Add the options of all tables."""
    parser.add_argument("--runs", type=Path, required=True, help="folder of the runs")
    parser.add_argument("--only", nargs="+", metavar="ROW", help="train these rows alone")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--num-envs", type=int, default=4096)
    parser.add_argument("--env-steps", type=float, default=98.304e6, help="of a run: 1024 worlds x 40 steps x 2400")
    parser.add_argument("--episodes", type=int, default=1024, help="of an evaluation")
    parser.add_argument("--set", nargs="+", default=[], metavar="KEY=VALUE", help="further overrides of every training")
    parser.add_argument("--side-by-side", type=int, default=1, help="runs that share a GPU")
    parser.add_argument("--minutes", type=float, default=1e6, help="when to stop, evaluation included")
    parser.add_argument("--evaluation-minutes", type=float, default=1.5, help="of them, kept for evaluation")


def sweep(rows: Sequence[Row], stages: Path, args: argparse.Namespace) -> list[dict[str, Any]]:
    """Train what is not finished, evaluate what is not evaluated, and return what all runs came to.

    Args:
        rows: of the table.
        stages: folder of the rows' stages.
        args: with the `options`.
    """
    end = time.monotonic() + 60.0 * args.minutes
    names = [row.name for row in rows]
    if unknown := set(args.only or ()).difference(names):
        sys.exit(f"row {min(unknown)!r} is unknown; rows: {', '.join(names)}")
    slots, table = gpu_slots(args.side_by_side), jobs(rows, args.runs)
    wanted = [job for job in table if job.row.name in (args.only or names)]
    left = [job for job in wanted if not job.finished(iterations(job, args))]
    trainings = [(training(job, stages, args), job.folder / "log.txt") for job in left]
    failed = run(trainings, slots, end - 60.0 * args.evaluation_minutes)
    evaluations = [
        (evaluation(job, stages, args.episodes), job.folder / "log.txt") for job in table if not job.evaluated
    ]
    for log in failed + run(evaluations, slots, end):
        print(f"{log}: failed: {log.read_text().strip().splitlines()[-1]}", file=sys.stderr)
    return [collected for job in table if (collected := collect(job, iterations(job, args)))]


def jobs(rows: Sequence[Row], runs: Path) -> list[Job]:
    """Return the runs of a table, seed by seed: where time ends, every row has its first."""
    every = [Job(row, seed, runs.resolve() / f"{row.name}-{seed}") for row in rows for seed in range(row.seeds)]
    return sorted(every, key=lambda job: job.seed)


def train_overrides(job: Job, args: argparse.Namespace) -> list[str]:
    """Return the training's overrides, except stage, folder and length."""
    return [*job.row.overrides, f"seed={job.seed}", f"num_envs={args.num_envs}", *args.set]


def iterations(job: Job, args: argparse.Namespace) -> int:
    """Return how many iterations the training is to have."""
    env_steps = job.row.env_steps or args.env_steps
    return round(
        env_steps / (args.num_envs * config.compose("train", train_overrides(job, args))["ppo"]["num_steps_per_env"])
    )


def training(job: Job, stages: Path, args: argparse.Namespace) -> list[str]:
    """Return the command that trains: the row's multirun with one of its seeds."""
    return [
        *(
            *S2A,
            "train",
            "-m",
            *train_overrides(job, args),
            f"stage={stages / job.row.stage}",
            "out=run",
            "resume=true",
        ),
        *(f"ppo.iterations={iterations(job, args)}", f"ppo.save_interval={SAVE_INTERVAL}"),
        *(f"hydra.sweep.dir={job.folder.parent}", f"hydra.sweep.subdir={job.folder.name}"),
    ]


def evaluation(job: Job, stages: Path, episodes: int) -> list[str]:
    """Return the command that evaluates the last checkpoint, one episode a world."""
    return [
        *(*S2A, "evaluate", f"stage={stages / job.row.stage}", f"num_envs={episodes}"),
        *(f"checkpoint={job.checkpoint}", f"seed={EVALUATION_SEED + job.seed}", f"out={job.measured}"),
    ]


def collect(job: Job, iterations: int) -> dict[str, Any] | None:
    """Return what a run that is to have so many iterations came to; None before it was evaluated.

    env_steps is what the evaluated checkpoint was trained for.
    """
    if not job.measured.is_file():
        return None
    found = json.loads(job.measured.read_text())
    trained = run_folder.iteration(Path(found["policy"])) + 1
    settings = json.loads((job.folder / "run" / run_folder.SETTINGS).read_text())
    steps = settings["num_envs"] * settings["ppo"]["num_steps_per_env"]
    return {
        "row": job.row.name,
        "about": job.row.about,
        "seed": job.seed,
        "finished": trained >= iterations,
        "env_steps": trained * steps,
        "stage": job.row.stage,
        "settings": {key: value for key, value in settings.items() if key not in NOT_SETTINGS},
        "starts": starts(job.folder / "run"),
        "evaluation": found,
        "curve": curve(job.folder / "run", steps),
    }
