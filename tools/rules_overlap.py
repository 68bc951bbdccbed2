"""How many of the zoo's labels does the table of rules know? It was written before they were seen; this says by what luck.

    python tools/rules_overlap.py runs/insertion/zoo/list.yaml

A label is known by name (it is in the table), by a part of it or a brand, or not at all.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import yaml

from s2a.language.insert.rules import known, table


def main(listed: Path) -> None:
    """Print each label with what the table takes it for, and the counts."""
    names = {name for entry in table() for name in entry.names}
    counts = {"by name": 0, "by a part or a brand": 0, "not": 0}
    for entry in yaml.safe_load(listed.read_text()):
        found = known(entry["label"])
        how = "by name" if entry["label"].lower() in names else "by a part or a brand" if found else "not"
        counts[how] += 1
        print(f"{entry['label']:32} {how:22} {found.noun if found else ''}")
    print(", ".join(f"{how}: {count}" for how, count in counts.items()))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("listed", type=Path, metavar="LIST_YAML")
    main(parser.parse_args().listed)
