"""Whether `+experiment=part` learns any part: trainings of parts drawn from all rooms of a pool, sliding and turning ones.

    python experiments/any_part.py pools/any/pool.json --also bedroom_121.usd:drawer_42 --runs runs/any > commands.txt
    bash commands.txt
    python experiments/any_part.py pools/any/pool.json --also bedroom_121.usd:drawer_42 --runs runs/any --out FILE

The pool was s2a pool rooms=[] homes=[kitchen_120,bedroom_121,living_room_122,dining_room_123,office_124] out=pools/any.
"""

from __future__ import annotations

import argparse
import json
import random
from pathlib import Path

from s2a.core.outputs import atomic_write


def main() -> None:
    """Print the commands of the trainings, or collect what they came to."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pool", type=Path)
    parser.add_argument("--each", type=int, default=2, help="parts of each room that slide, and as many that turn")
    parser.add_argument("--also", nargs="*", default=[], help="further parts, ROOM.usd:PART")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--runs", type=Path, required=True)
    parser.add_argument("--out", type=Path)
    args = parser.parse_args()
    parts = drawn(json.loads(args.pool.read_text())["parts"], args.each, args.also, args.seed)
    folders = [args.runs / f"{Path(part['room']).stem}_{part['part']}" for part in parts]
    if not args.out:
        for part, folder in zip(parts, folders, strict=True):
            print(
                f"s2a train stage={args.pool.parent / part['room']} part={part['part']} +experiment=part out={folder}"
            )
        return
    rows = [row(part, folder) for part, folder in zip(parts, folders, strict=True)]
    reached = sum(each["measured"]["rate"] >= each["target"] for each in rows)
    with atomic_write(args.out) as out:
        out.write_text(
            json.dumps({"parts": len(rows), "reached": reached, "draw": args.seed, "rows": rows}, indent=1) + "\n"
        )
    print(f"{reached} of {len(rows)} parts reach the target")


def drawn(parts: list[dict], each: int, also: list[str], seed: int) -> list[dict]:
    """Return parts of every room, `each` that slide and `each` that turn where there are as many, and those of `also`."""
    source, chosen = random.Random(seed), []
    for room in dict.fromkeys(part["room"] for part in parts):
        for kind in ("prismatic", "revolute"):
            candidates = [part for part in parts if (part["room"], part["kind"]) == (room, kind)]
            chosen += source.sample(candidates, min(each, len(candidates)))
    return chosen + [part for part in parts if f"{part['room']}:{part['part']}" in also]


def row(part: dict, folder: Path) -> dict:
    """Return what the training of a part came to."""
    metrics, settings = (json.loads((folder / name).read_text()) for name in ("metrics.json", "settings.json"))
    return {
        **{name: part[name] for name in ("room", "part", "kind", "handle")},
        "target": settings["ppo"]["target"],
        **{name: metrics[name] for name in ("measured", "ended", "env_steps", "seconds", "seed", "commit", "device")},
    }


if __name__ == "__main__":
    main()
