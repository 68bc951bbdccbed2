"""Processor time and peak memory of the stages of a scan: import, proposals, check, export, prepare.

    python tools/bench_stages.py MESH --up z [--split 1] [--stages import annotate] [--out figures.json]

MESH is a scan's mesh in metres. With --split each of its faces becomes 4, 16, ... of the same surface. Each stage is a
command in a process of its own, imports and worker processes included, and works on what the one before it wrote. Caches
start empty.
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
from typing import Any

import trimesh
from rich.console import Console
from rich.table import Table

from s2a.core.provenance import provenance

Row = dict[str, Any]


def commands(mesh: Path, up: str, out: Path) -> dict[str, list[str]]:
    """Return the arguments of `s2a` by stage."""
    scan, proposed, usd = out / "scan", out / "proposed", out / "usd"
    return {
        "import": ["import", f"mesh={mesh}", f"out={scan}", f"up={up}", "unit=m"],
        "annotate": ["annotate", f"scan={scan}", f"out={proposed}", "auto=true", "page=false"],
        "check": ["check", f"scan={proposed}", f"out={out / 'check.json'}"],
        "export": ["export", f"scan={proposed}", f"out={usd}"],
        "export unchecked": ["export", f"scan={proposed}", f"out={out / 'unchecked'}", "check=false"],
        "prepare": ["prepare", f"stage={usd / 'geometric.usd'}", f"out={out / 'room.usd'}", "targets=all"],
    }


def measured(arguments: list[str], cache: Path) -> Row:
    """Run a command; return its processor time and wall time [s], its peak resident memory [MiB] and its exit code."""
    start = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-m", "s2a", *arguments],
        env={**os.environ, "S2A_CACHE": str(cache)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return {
        "cpu_s": round(usage.ru_utime + usage.ru_stime, 1),
        "wall_s": round(time.perf_counter() - start, 1),
        "peak_mib": round(usage.ru_maxrss / 1024),
        "exit": process.returncode,
    }


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", type=Path)
    parser.add_argument("--up", default="z")
    parser.add_argument("--split", type=int, default=0)
    parser.add_argument("--stages", nargs="+", help="those before them are run, too; all if not given")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        place = Path(temporary)
        mesh = trimesh.load(options.mesh, process=False)
        faces = len(mesh.faces) * 4**options.split
        for _ in range(options.split):
            mesh = mesh.subdivide()
        source = options.mesh
        if options.split:
            source = place / "split.ply"
            mesh.export(source)
        todo = commands(source, options.up, place)
        last = max(list(todo).index(name) for name in options.stages) if options.stages else len(todo) - 1
        rows: dict[str, Row] = {}
        for name in list(todo)[: last + 1]:
            rows[name] = measured(todo[name], place / "cache")
            if options.out:
                options.out.write_text(json.dumps({"faces": faces, "stages": rows, **provenance("cpu")}, indent=1))
    table = Table("stage", "processor time [s]", "wall [s]", "peak [MiB]", "exit", title=f"{faces:,} faces")
    for name, row in rows.items():
        table.add_row(name, *(f"{row[key]:,}" for key in ("cpu_s", "wall_s", "peak_mib", "exit")))
    Console().print(table)


if __name__ == "__main__":
    main()
