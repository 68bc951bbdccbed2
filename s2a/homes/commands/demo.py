"""Command `s2a demo`: run every step from a virtual office to a robot that opens one of its drawers."""

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

from s2a.core.errors import InputError

PART = "part=drawer_15"
WIDTH = 120  # [character] Of a line that goes to a file or a pipe
TICK = 0.5  # [s] Between two looks at the clock


@dataclass(frozen=True)
class Config:
    """Keys of `s2a demo`.

    Attributes:
        folder: folder of the outputs; a second run replaces them.
        robot: name of the robot; the pretrained policy is a Panda's.
    """

    folder: Path
    robot: str


@dataclass(frozen=True)
class DemoStep:
    """One command of the demo."""

    title: str  # what it does, in words
    seconds: float  # it takes on two idle cores; a slower machine stretches all alike
    command: str  # as it is typed


def steps(demo: str, robot: str) -> list[DemoStep]:
    """Return the steps; the pretrained policy is one of a Panda."""
    demo = shlex.quote(demo)
    room, arm = f"stage={demo}/room.usd {PART}", f" robot={robot}" * (robot != "panda")
    stapler = f"object={demo}/zoo/objects/stapler.usda label=stapler"
    hint = 'prompt="put it next to the keyboard" llm=rules'
    plan = [
        DemoStep("furnish an office and scan it", 20, f"s2a sample room=office seed=101 detail=demo out={demo}/scan"),
        DemoStep("write two flavours of USD", 5, f"s2a export scan={demo}/scan out={demo}"),
        DemoStep("write a hundred objects", 4, f"s2a zoo out={demo}/zoo"),
        DemoStep(
            "insert a stapler",
            15,
            f"s2a insert stage={demo}/geometric.usd {stapler} {hint} out={demo}/insert image={demo}/insert.png",
        ),
        DemoStep(
            "prepare the room for simulation",
            25,
            f"s2a prepare stage={demo}/geometric.usd targets=all{arm} out={demo}/room.usd",
        ),
        DemoStep("the planner opens a drawer", 30, f"s2a evaluate {room}{arm} out={demo}/planner.json images={demo}"),
        DemoStep(
            "so does a policy that was not trained on it",
            45,
            f"s2a evaluate {room} policy=pretrained out={demo}/pretrained.json",
        ),
        DemoStep("begin a training", 25, f"s2a train {room}{arm} num_envs=16 ppo.iterations=3 out={demo}/ppo"),
        DemoStep("write the room as a page", 6, f"s2a view path={demo}/room.usd html={demo}/room.html"),
        DemoStep("write the result as a page", 2, f"s2a report path={demo}/planner.json out={demo}/planner.html"),
    ]
    return [step for step in plan if robot == "panda" or "pretrained" not in step.command]


def left(todo: list[DemoStep], done: list[DemoStep], elapsed: float, running: float) -> float:
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


def run(config: Config) -> str:
    """Run all steps, each as the command that is printed; return where to look.

    Raises:
        InputError: a step failed; what it said is printed. Or the folder holds other files than an earlier demo's.
    """
    earlier = config.folder / "zoo" / "truth.json", config.folder / "scan" / "truth"
    if config.folder.is_dir() and any(config.folder.iterdir()) and not all(path.exists() for path in earlier):
        raise InputError(f"folder {str(config.folder)!r} holds other files than those of a demo; choose another")
    # Steps and what they print go to the terminal as they come; stdout of a command holds its summary alone.
    console = Console(stderr=True, width=None if sys.stderr.isatty() else WIDTH)
    shutil.rmtree(config.folder / "ppo", ignore_errors=True)  # a training is never overwritten
    plan, begun = steps(str(config.folder), config.robot), time.monotonic()
    for i, step in enumerate(plan):
        perform(step, plan[i:], plan[:i], time.monotonic() - begun, console)
    minutes, seconds = divmod(round(time.monotonic() - begun), 60)
    return f"""\
Done in {minutes} min {seconds} s. Open in a browser: {config.folder}/room.html, in which every joint opens once,
and {config.folder}/planner.html, how often the planner opened the drawer. A slider for every joint:
s2a view path={config.folder}/room.usd page=true"""


def perform(step: DemoStep, todo: list[DemoStep], done: list[DemoStep], elapsed: float, console: Console) -> None:
    """Run one step; print its command, the time that is left (see `left`), and then its output.

    Raises:
        InputError: it failed.
    """
    number = f"[{len(done) + 1}/{len(done) + len(todo)}]"
    console.print(
        f"\n{number} {step.title}: {_remaining(left(todo, done, elapsed, 0.0))}", markup=False, highlight=False
    )
    console.print(f"$ {step.command}", style="dim", markup=False, highlight=False, soft_wrap=True)
    command = [sys.executable, "-m", *shlex.split(step.command)]
    columns = TextColumn("{task.description}", markup=False), BarColumn()
    begun = time.monotonic()
    show = Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
    with tempfile.TemporaryFile("w+") as output, show as bar:
        task = bar.add_task("", total=sum(each.seconds for each in (*done, *todo)))
        process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)
        while process.poll() is None:
            running = time.monotonic() - begun
            finished = sum(each.seconds for each in done) + min(running, step.seconds)
            bar.update(task, description=_remaining(left(todo, done, elapsed, running)), completed=finished)
            time.sleep(TICK)
        output.seek(0)
        text = output.read()
    console.print(text.rstrip(), markup=False, highlight=False, soft_wrap=True)
    if process.returncode:
        raise InputError(
            f"step {number}, {shlex.join(command[2:])}, ended with exit code {process.returncode}; see above"
        )


def _remaining(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"about {minutes} min {rest} s left" if minutes else f"about {rest} s left"
