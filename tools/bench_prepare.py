"""Time and peak memory of `s2a prepare` of a stage: with an empty cache, again, and for another target.

    python tools/bench_prepare.py GEOMETRIC_USD TARGET OTHER_TARGET

Exits with 1 where the first takes more than 60 s or 6 GB, or the second more than 10 s.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from rich.console import Console
from rich.table import Table

COLD, WARM, GIGABYTES = 60.0, 10.0, 6.0
"""What a preparation may take on two cores [s], [s], [GB]."""


def measure(stage: Path, target: str, folder: Path) -> tuple[float, float]:
    """Return wall time [s] and peak resident memory [GB] of one command, start and imports included."""
    arguments = [sys.executable, "-m", "s2a", "prepare", f"stage={stage}", f"target={target}", f"out={folder}/sim.usd"]
    start = time.perf_counter()
    process = subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"failed: {' '.join(arguments)}")
    return time.perf_counter() - start, usage.ru_maxrss / 1e6


def main() -> None:
    """Measure, print the table, and judge."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stage", type=Path, help="a geometric.usd")
    parser.add_argument("target", help="a jointed part")
    parser.add_argument("other", help="another one")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        os.environ["S2A_CACHE"] = f"{temporary}/cache"
        runs = (("empty cache", given.target), ("again", given.target), ("another target", given.other))
        figures = {name: measure(given.stage, target, Path(temporary)) for name, target in runs}
    table = Table("run", "seconds", "peak GB", title=f"{given.stage}, {os.cpu_count()} cores")
    for name, (seconds, gigabytes) in figures.items():
        table.add_row(name, f"{seconds:.1f}", f"{gigabytes:.2f}")
    Console().print(table)
    limits = {"empty cache": COLD, "again": WARM}
    if any(figures[name][0] > limit or figures[name][1] > GIGABYTES for name, limit in limits.items()):
        sys.exit(1)


if __name__ == "__main__":
    main()
