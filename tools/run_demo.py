"""The demo: every step from a virtual office to a robot that opens one of its drawers, with the time that is left.

    python tools/run_demo.py demo [--robot panda]

The first argument is the folder that is filled. Steps are the commands that are printed, and can be repeated alone.
"""

from __future__ import annotations

import argparse
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

PART = "part=drawer_15"
TICK = 0.5
"""[s] Between two looks at the clock."""


@dataclass(frozen=True)
class Step:
    """One command of the demo.

    Attributes:
        title: what it does, in words.
        seconds: it takes on two idle cores; a slower machine stretches all alike.
        command: as it is typed.
    """

    title: str
    seconds: float
    command: str


def steps(demo: str, robot: str) -> list[Step]:
    """Return the steps; the pretrained policy is one of a Panda."""
    room, arm = f"stage={demo}/room.usd {PART}", f" robot={robot}" * (robot != "panda")
    stapler = f"object={demo}/zoo/objects/stapler.usda label=stapler"
    hint = 'prompt="put it next to the keyboard" llm=rules'
    found = [
        Step("furnish an office and scan it", 20, f"s2a sample room=office seed=101 detail=demo out={demo}/scan"),
        Step("write two flavours of USD", 5, f"s2a export scan={demo}/scan out={demo}"),
        Step("write a hundred objects", 4, f"s2a zoo out={demo}/zoo"),
        Step(
            "insert a stapler",
            15,
            f"s2a insert stage={demo}/geometric.usd {stapler} {hint} out={demo}/insert image={demo}/insert.png",
        ),
        Step(
            "prepare the room for simulation",
            25,
            f"s2a prepare stage={demo}/geometric.usd targets=all{arm} out={demo}/room.usd",
        ),
        Step("the planner opens a drawer", 30, f"s2a evaluate {room}{arm} out={demo}/planner.json images={demo}"),
        Step(
            "so does a policy that never saw it",
            45,
            f"s2a evaluate {room} policy=pretrained out={demo}/pretrained.json",
        ),
        Step("begin a training", 25, f"s2a train {room}{arm} num_envs=16 ppo.iterations=3 out={demo}/ppo"),
        Step("compare joints", 8, f"python tools/joint_table.py {demo}/geometric.usd {demo}/scan/truth/truth.usda"),
        Step("write the room as a page", 6, f"s2a view path={demo}/room.usd html={demo}/room.html"),
        Step("write the result as a page", 2, f"s2a report path={demo}/planner.json out={demo}/planner.html"),
    ]
    return [step for step in found if robot == "panda" or "pretrained" not in step.command]


def left(todo: list[Step], done: list[Step], elapsed: float, running: float) -> float:
    """Return the estimated time that is left [s].

    Args:
        todo: the step that runs, and those after it.
        done: steps that have ended.
        elapsed: time that these took [s].
        running: time since the present one began [s].
    """
    expected = sum(step.seconds for step in done)
    pace = elapsed / expected if expected else 1.0
    rest = pace * sum(step.seconds for step in todo[1:])
    return rest + max(pace * todo[0].seconds - running, 0.0)


def main() -> None:
    """Run all steps; end with the first that fails."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("--robot", default="panda")
    args = parser.parse_args()
    shutil.rmtree(Path(args.folder) / "ppo", ignore_errors=True)  # a training is never overwritten
    plan, begun = steps(args.folder, args.robot), time.monotonic()
    for i, step in enumerate(plan):
        _run(step, plan[i:], plan[:i], time.monotonic() - begun)
    minutes, seconds = divmod(round(time.monotonic() - begun), 60)
    print(
        f"\nDone in {minutes} min {seconds} s. Open in a browser: {args.folder}/room.html, in which every joint opens once,"
    )
    print(f"and {args.folder}/planner.html, how often the planner opened the drawer. A slider for every joint:")
    print(f"s2a view path={args.folder}/room.usd page=true")


def _run(step: Step, todo: list[Step], done: list[Step], elapsed: float) -> None:
    """Run one step with the time that is left; print its command, and then its output."""
    console = Console()
    number = f"[{len(done) + 1}/{len(done) + len(todo)}]"
    console.print(f"\n{number} {step.title}: {_told(left(todo, done, elapsed, 0.0))}", markup=False, highlight=False)
    console.print(f"$ {step.command}", style="dim", markup=False, highlight=False, soft_wrap=True)
    program, *arguments = shlex.split(step.command)
    python = [sys.executable] if program == "python" else [sys.executable, "-m", program]
    columns = TextColumn("{task.description}", markup=False), BarColumn()
    begun = time.monotonic()
    show = Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
    with tempfile.TemporaryFile("w+") as output, show as bar:
        task = bar.add_task("", total=sum(each.seconds for each in (*done, *todo)))
        process = subprocess.Popen([*python, *arguments], stdout=output, stderr=subprocess.STDOUT)
        while process.poll() is None:
            running = time.monotonic() - begun
            finished = sum(each.seconds for each in done) + min(running, step.seconds)
            bar.update(task, description=_told(left(todo, done, elapsed, running)), completed=finished)
            time.sleep(TICK)
        output.seek(0)
        said = output.read()
    console.print(said.rstrip(), markup=False, highlight=False, soft_wrap=True)
    if process.returncode:
        sys.exit(f"step {number} ended with exit code {process.returncode}")


def _told(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"about {minutes} min {rest} s left" if minutes else f"about {rest} s left"


if __name__ == "__main__":
    os.environ.setdefault("COLUMNS", "120")
    main()
