"""What raters made of the images of insertions: the fraction that they accept by category and method, and how they agree.

    python experiments/ratings.py FOLDER [--out experiments/results/insertion_ratings.md]

FOLDER has a CSV file a rater, lines of category,image,yes or no,reason, and key.json: the method behind every image, which
the raters did not see (experiments/insertion_study.py --images writes it, a file a category).
"""

from __future__ import annotations

import argparse
import csv
import json
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

RESULTS = Path(__file__).parent / "results/insertion_ratings.md"


def main() -> None:
    """Read the ratings, print the table and write it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()
    lines = table(json.loads((args.folder / "key.json").read_text()), verdicts(sorted(args.folder.glob("*.csv"))))
    args.out.write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


def verdicts(files: Sequence[Path]) -> dict[tuple[str, str], list[bool]]:
    """Return what the raters said of every image: (category, image) -> whether each accepts it."""
    found = defaultdict(list)
    for file in files:
        with file.open(newline="") as lines:
            for category, image, verdict, *_ in csv.reader(lines):
                found[category, image].append(verdict.strip() == "yes")
    return dict(found)


def table(key: dict[str, dict[str, str]], said: dict[tuple[str, str], list[bool]]) -> list[str]:
    """Return the lines of a Markdown table; Cohen's kappa is over all images that two rated."""
    groups: dict[tuple[str, str], list[list[bool]]] = defaultdict(list)
    for (category, image), verdict in said.items():
        for name in (category, "all"):
            groups[name, key[category][image]].append(verdict)
    lines = ["| category | method | images | accepted by both raters | by one or both |", "|---|---|---|---|---|"]
    for (category, method), found in sorted(groups.items(), key=lambda group: (group[0][0] == "all", group[0])):
        both, any_of = (sum(map(accept, found)) for accept in (all, any))
        lines.append(f"| {category} | {method} | {len(found)} | {both} | {any_of} |")
    pairs = [(a, b) for a, b in (v for v in said.values() if len(v) == 2)]
    agreed = sum(a == b for a, b in pairs) / len(pairs)
    first, second = (sum(pair[i] for pair in pairs) / len(pairs) for i in (0, 1))
    chance = first * second + (1 - first) * (1 - second)
    kappa = (agreed - chance) / (1 - chance)
    return [*lines, "", f"The two agree on {100 * agreed:.0f} % of {len(pairs)} images, Cohen's kappa {kappa:.2f}."]


if __name__ == "__main__":
    main()
