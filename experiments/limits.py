"""How much of the Panda's limits the planner's trajectories use, commanded and measured, by experiment: a table.

    python experiments/limits.py

Reads `peaks` and the rows of pick_place.json, put_in.json and open_close.json in experiments/results, and writes limits.md there.
1.00 is the limit. The last column counts the rows (an object or part each) that keep every commanded limit, and every limit.
"""

from __future__ import annotations

import json
from pathlib import Path

RESULTS = Path(__file__).parent / "results"
FILES = ("pick_place", "put_in", "open_close")


def main() -> None:
    """Write the table."""
    found = {name: json.loads(path.read_text()) for name in FILES if (path := RESULTS / f"{name}.json").exists()}
    found = {name: result for name, result in found.items() if result.get("peaks")}
    names = list(next(iter(found.values()))["peaks"])
    lines = [
        "| largest fraction of a limit | " + " | ".join(n.replace("_", " ") for n in names) + " | commanded, all kept |"
    ]
    lines.append("|---" * (len(names) + 2) + "|")
    for name, result in found.items():
        rows = [row["limit_use"] for row in result["rows"] if "limit_use" in row]
        kept = [all(v <= 1.0 for k, v in row.items() if k.startswith("commanded")) for row in rows]
        whole = [all(v <= 1.0 for v in row.values()) for row in rows]
        cells = [f"{result['peaks'][n]:.2f}" for n in names]
        lines.append(
            f"| {name}, {result['device']} | " + " | ".join(cells) + f" | {sum(kept)}, {sum(whole)} of {len(rows)} |"
        )
    (RESULTS / "limits.md").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
