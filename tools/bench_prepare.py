"""Time and peak memory of `s2a prepare` of all parts of a room: with an empty cache, and again.

    python tools/bench_prepare.py GEOMETRIC_USD [--targets all] [--out experiments/results/bench_prepare.json]

Exits with 1 where the first takes more than 60 s or 6 GB, or the second more than 15 s. The record also holds the processor
time and the load of the machine: wall times count where nothing else ran.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from rich.console import Console
from rich.table import Table

from s2a.core.provenance import provenance
from s2a.scene.usd import geometric

COLD, WARM, GIGABYTES = 60.0, 15.0, 6.0
"""What a preparation may take on two cores [s], [s], [GB]."""


def measure(stage: Path, targets: str, folder: Path) -> dict[str, float]:
    """Return wall and processor time [s], peak memory [GB] and the machine's load of one command, start and imports included."""
    arguments = [
        sys.executable,
        "-m",
        "s2a",
        "prepare",
        f"stage={stage}",
        f"targets={targets}",
        f"out={folder}/sim.usd",
    ]
    start = time.perf_counter()
    process = subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"failed: {' '.join(arguments)}")
    return {
        "wall_s": round(time.perf_counter() - start, 2),
        "cpu_s": round(usage.ru_utime + usage.ru_stime, 2),
        "peak_gb": round(usage.ru_maxrss / 1e6, 3),
        "load": round(os.getloadavg()[0], 1),
    }


def main() -> None:
    """Measure, print the table, and check_bound."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stage", type=Path, help="a geometric.usd")
    parser.add_argument("--targets", default="all", help="articulated parts, as s2a prepare takes them")
    parser.add_argument("--out", type=Path, help="a JSON file for the record")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        os.environ["S2A_CACHE"] = f"{temporary}/cache"
        figures = {name: measure(given.stage, given.targets, Path(temporary)) for name in ("empty cache", "again")}
    faces = {i: len(part.mesh.faces) for i, part in geometric.read(given.stage).parts.items()}
    title = f"{given.stage}, {sum(faces.values())} faces, {os.cpu_count()} cores"
    table = Table("run", "seconds", "of the processor", "peak GB", "load", title=title)
    for name, row in figures.items():
        table.add_row(name, *(f"{value:.1f}" for value in row.values()))
    if given.out:
        record = {"faces": sum(faces.values()), "cores": os.cpu_count(), "targets": given.targets}
        given.out.write_text(json.dumps(provenance("cpu") | record | figures, indent=1) + "\n")
    Console().print(table)
    limits = {"empty cache": COLD, "again": WARM}
    if any(figures[n]["wall_s"] > limit or figures[n]["peak_gb"] > GIGABYTES for n, limit in limits.items()):
        sys.exit(1)


if __name__ == "__main__":
    main()
