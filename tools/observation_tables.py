"""Write the tables of observations and actions in docs/own_network.md from the tasks: `python tools/observation_tables.py`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from s2a import robot, tasks
from s2a.core import config
from s2a.sim.simulation import SimConfig
from s2a.tasks import interface
from s2a.tasks.base import Task

ROOT = Path(__file__).parents[1]
BEGIN, END = "<!-- observations: begin -->\n", "<!-- observations: end -->\n"


def main() -> None:
    """Replace the text between the marks."""
    page = ROOT / "docs" / "own_network.md"
    before, _, rest = page.read_text().partition(BEGIN)
    page.write_text(before + BEGIN + tables() + END + rest.partition(END)[2])


def kinds() -> dict[str, tuple[type[Task], Any]]:
    """Return the tasks with their settings, all of their observations turned on, by name."""
    every = {}
    for name in ("open_part", *(each for each in tasks.names() if each != "open_part")):
        kind = tasks.task(name)
        values = config.compose("train", [f"task={name}", "stage=-", "out=-"])["task"]
        values |= {group: True for group in {**kind.OBSERVATIONS, **kind.CRITIC} if group}
        every[name] = kind, config.load(kind.Config, values)
    return every


def tables() -> str:
    """Return the tables in Markdown, for the Panda as `s2a train` moves it."""
    sim = config.load(SimConfig, config.compose("train", ["stage=-", "out=-"])["sim"])
    return "\n".join(interface.markdown(kinds(), robot.load("panda"), sim)).rstrip() + "\n"


if __name__ == "__main__":
    main()
