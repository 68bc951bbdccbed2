"""Captures without a click: what `s2a dataset` makes of each, as a result file and a table.

    s2a dataset scans='captures/*' out=rooms episodes=1
    python experiments/real_captures.py rooms/pool.json [more/pool.json] --out FILE

Indices hold no geometry: counts, seconds and reasons alone are taken. A capture is virtual where its name begins so. Without
an index, as where the captures are absent, nothing is written. The table is printed from FILE if no index is given.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

OPENED = 0.5
"""Fraction of the planner's episodes from which on a part counts as opened."""
HEADER = (
    "capture",
    "parts that move",
    "with a base and a plan",
    "certified",
    "opened",
    "grasped",
    "import [s]",
    "minutes",
)


def row_of(verdict: Mapping[str, Any]) -> dict[str, Any]:
    """Return the counts, seconds and reasons of a room of an index."""
    parts = [part for part in verdict["verdicts"].values() if "success" in part]
    seconds = verdict["seconds"]
    return {
        "capture": verdict["name"],
        "virtual": verdict["name"].startswith("virtual"),
        "failed": verdict["failed"].replace(f"{verdict['source']}: ", ""),
        "parts": len(verdict["parts"]) + len(verdict["left_out"]),
        "planned": len(verdict["parts"]),
        "certified": sum(bool(part.get("certified")) for part in verdict["verdicts"].values()),
        "opened": sum(part["success"] >= OPENED for part in parts),
        "grasped": sum(part["grasp_success"] >= OPENED for part in parts),
        "seconds": seconds,
        "minutes": round(sum(seconds.values()) / 60, 1),
        "left_out": list(verdict["left_out"].values()),
    }


def line_of(row: Mapping[str, Any]) -> str:
    """Return a room as a row of a table in Markdown."""
    counts = [row[key] for key in ("parts", "planned", "certified", "opened", "grasped")]
    cells = ["fails"] + [""] * 4 if row["failed"] else counts
    taken = row["seconds"].get("import")
    return f"| {' | '.join(map(str, [row['capture'], *cells, '' if taken is None else taken, row['minutes']]))} |"


def main() -> None:
    """Collect the indices, write the result, and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("indices", nargs="*", type=Path, help="pool.json of s2a dataset")
    parser.add_argument("--out", type=Path, default=Path(__file__).with_name("results") / "real_captures.json")
    given = parser.parse_args()
    indices = [json.loads(path.read_text()) for path in given.indices if path.is_file()]
    if given.indices and not indices:
        raise SystemExit("skipped: none of these indices exists; run s2a dataset where the captures are")
    if indices:
        about = {key: indices[0][key] for key in ("commit", "versions", "device")} | {
            "cores": os.cpu_count(),
            "seed": 0,
        }
        rows = [row_of(verdict) for index in indices for verdict in index["verdicts"]]
        text = json.dumps({**about, "rows": rows}, indent=1) + "\n"
        for path in given.indices:
            text = text.replace(str(path.parent), "rooms")
        given.out.write_text(text)
    rows = json.loads(given.out.read_text())["rows"]
    print(f"| {' | '.join(HEADER)} |\n|{'---|' * len(HEADER)}")
    print("\n".join(line_of(row) for row in rows))


if __name__ == "__main__":
    main()
