"""Homes whose design has most parts with given families of handles: `python tools/rare_homes.py recess cup`.

Only the rooms are drawn, not scanned: some 75 s for the seeds 0 to 59 that may be trained on.
"""

from __future__ import annotations

import argparse
from collections import Counter
from typing import get_args

from s2a.progress import track
from s2a.synth import RoomKind
from s2a.synth.catalog import catalog
from s2a.synth.homes import furnish, stream
from s2a.synth.truth import part_truth


def families(kind: RoomKind, seed: int) -> Counter[str]:
    """Return how many parts of a home have each family or style of handle."""
    entries = catalog(furnish(kind, stream(kind, seed).spawn(1)[0]).pieces)
    ids = {entry.number: entry.part_id for entry in entries}
    truths = [part_truth(entry, ids) for entry in entries]
    return Counter(truth.get("facts", {}).get("family", truth["style"]) for truth in truths)


def main() -> None:
    """Print the homes, those with most first."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("family", nargs="+", help="recess, cup, ...")
    parser.add_argument("--seeds", type=int, default=60, help="seeds 0 to this, without it")
    parser.add_argument("--first", type=int, default=30, help="how many homes are printed of each family")
    args = parser.parse_args()
    homes = [(kind, seed) for kind in get_args(RoomKind) if kind != "living_room" for seed in range(args.seeds)]
    counts = {f"{kind}_{seed}": families(kind, seed) for kind, seed in track(homes, "homes", len(homes))}
    for family in args.family:
        most = sorted(counts, key=lambda home: -counts[home][family])[: args.first]
        print(family, " ".join(f"{home}:{counts[home][family]}" for home in most))


if __name__ == "__main__":
    main()
