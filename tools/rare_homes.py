"""Homes to train on whose design has most parts with given families of handles: `python tools/rare_homes.py recess cup`.

Only the rooms are drawn, not scanned: some 75 s for the seeds 0 to 59.
"""

from __future__ import annotations

import argparse
from collections import Counter

from s2a.core import config
from s2a.core.progress import track
from s2a.homes.commands.pool import Config, home_of, rooms_of
from s2a.homes.furnishing import furnish
from s2a.homes.room import catalog, handle_of, part_truth
from s2a.homes.sample import SampleConfig, streams


def handles(home: SampleConfig) -> Counter[str | None]:
    """Return how many parts of a home have each family or style of handle."""
    entries = catalog(furnish(home.room, streams(home)[0]).pieces)
    ids = {entry.number: entry.part_id for entry in entries}
    return Counter(handle_of(part_truth(entry, ids)) for entry in entries)


def main() -> None:
    """Print the homes, those with most first."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("family", nargs="+", help="recess, cup, ...")
    parser.add_argument("--seeds", type=int, default=60, help="seeds 0 to this, without it")
    parser.add_argument("--first", type=int, default=30, help="how many homes are printed of each family")
    args = parser.parse_args()
    pool = config.load(Config, config.compose("pool", ["+split=train", f"count={args.seeds}", "out=unused"]))
    homes = rooms_of(pool)
    counts = {
        f"{kind}_{seed}": handles(home_of(pool, kind, seed, pool.out))
        for kind, seed in track(homes, "homes", len(homes))
    }
    for family in args.family:
        most = sorted(counts, key=lambda home: -counts[home][family])[: args.first]
        print(family, " ".join(f"{home}:{counts[home][family]}" for home in most))


if __name__ == "__main__":
    main()
