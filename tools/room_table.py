"""Time, memory and size of the virtual scan of every room, and of the words that describe it.

    python tools/room_table.py [--rooms office kitchen] [--seeds 0 1 2] [--detail demo] \
        [--keep FOLDER] [--out experiments/results/rooms.json]

Runs `s2a sample` and `s2a export` as a user would, each in a process of its own, one after the other. Seconds are wall clock and
hold the start of Python. Rooms that --out already has at this detail and seed are measured again; all others stay in it.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from rich.progress import track

from s2a.core.provenance import provenance
from s2a.homes.furnishing import HOMES
from s2a.scene.usd import geometric

COUNTS = ("objects", "parts", "movable")
PIECES = re.compile(
    r"[^\r\nA-Za-z0-9]?(?:[A-Z]*[a-z]+|[A-Z]+)|[0-9]{1,3}| ?[^\sA-Za-z0-9]+[\r\n/]*|\s*[\r\n]+|\s+(?!\S)|\s+"
)
"""How o200k_base splits ASCII before it merges bytes (tiktoken, openai_public.py): a token never spans two pieces, and most
words are one, so their number is a lower bound and, for text like this, close."""


@dataclass(frozen=True)
class Row:
    """What is measured of one room.

    Attributes:
        room: its kind.
        seed: what furnished it.
        detail: of the scanner.
        sample_seconds: wall time of `s2a sample` [s].
        sample_cpu: its processor time [s], which says more where other programs run beside it.
        sample_gigabytes: its peak resident memory [GB].
        export_seconds: wall time of `s2a export` [s].
        export_cpu: its processor time [s].
        export_gigabytes: its peak resident memory [GB].
        vertices: of the scan.
        density: vertices per square metre.
        objects: parts without a parent.
        parts: all parts.
        movable: parts with a joint.
        characters: of descriptive.usda, all of it, per part.
        jointed: mean characters of the prims of jointed parts, without their children's prims.
        tokens: of descriptive.usda.
        tokenizer: what counted them.
        commit: of the code.
    """

    room: str
    seed: int
    detail: str
    sample_seconds: float
    sample_cpu: float
    sample_gigabytes: float
    export_seconds: float
    export_cpu: float
    export_gigabytes: float
    vertices: int
    density: float
    objects: int
    parts: int
    movable: int
    characters: float
    jointed: float
    tokens: int
    tokenizer: str
    commit: str | None


def measure(room: str, seed: int, detail: str, folder: Path, commit: str | None) -> Row:
    """Sample and export a room below a folder, and return its figures."""
    keys = [f"room={room}", f"seed={seed}", f"detail={detail}", f"out={folder / 'scan'}"]
    sampled = _run("sample", *keys)
    exported = _run("export", f"scan={folder / 'scan'}", f"out={folder / 'out'}")
    scene = geometric.read(folder / "out" / "geometric.usd")
    text = (folder / "out" / "descriptive.usda").read_text()
    own = prim_texts(text)
    stats = json.loads(next((folder / "scan").glob("*_parts.json")).read_text())["data"]["stats"]
    tokens, tokenizer = count_tokens(text)
    return Row(
        *(room, seed, detail, *sampled, *exported),
        vertices=stats["totalVertices"],
        density=stats["totalVertices"] / stats["totalFaceArea"],
        objects=sum(part.parent is None for part in scene.parts.values()),
        parts=len(scene.parts),
        movable=len(scene.movable),
        characters=len(text) / len(scene.parts),
        jointed=float(np.mean([len(own[i]) for i in scene.movable])),
        tokens=tokens,
        tokenizer=tokenizer,
        commit=commit,
    )


def _run(*arguments: str) -> tuple[float, float, float]:
    """Run `s2a` and return its wall time [s], processor time [s] and peak memory [GB]."""
    start = time.perf_counter()
    process = subprocess.Popen([sys.executable, "-m", "s2a", *arguments], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"s2a {' '.join(arguments)} failed")
    return time.perf_counter() - start, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1e6


def prim_texts(text: str) -> dict[str, str]:
    """Return the text of each prim of a USDA file without its children's, by the prim's name."""
    found: dict[str, str] = {}
    path: list[str] = []
    named = ""
    for line in text.splitlines(keepends=True):
        if defined := re.match(r'\s*def(?: \w+)? "(\w+)"', line):
            named = defined[1]
            found[named] = ""
        if line.strip() == "{":
            path.append(named)
        holder = named if defined or not path else path[-1]
        if holder in found:
            found[holder] += line
        if line.strip() == "}":
            path.pop()
            named = path[-1] if path else ""
    return found


def count_tokens(text: str) -> tuple[int, str]:
    """Return the number of tokens of a text and what counted them: tiktoken's o200k_base, or its splitting rule alone."""
    try:
        import tiktoken  # not a dependency: it needs its vocabulary from the network

        return len(tiktoken.get_encoding("o200k_base").encode(text)), "o200k_base"
    except Exception:  # noqa: BLE001 - whatever keeps it from its vocabulary
        return len(PIECES.findall(text)), "pieces of o200k_base's splitting rule"


def markdown(rows: list[dict]) -> str:
    """Return the rows as a table in Markdown."""
    lines = [
        "| room | seed | detail | sample s | CPU s | GB | export s | CPU s | GB | vertices | per m² | objects | parts "
        "| movable | characters a part | jointed | tokens |",
        "|---" * 17 + "|",
    ]
    for r in rows:
        times = (
            f"{r[f'{command}_{k}']:.1f}" for command in ("sample", "export") for k in ("seconds", "cpu", "gigabytes")
        )
        counts = (f"{r['vertices'] / 1e3:.0f} k", f"{r['density'] / 1e3:.1f} k", *(str(r[k]) for k in COUNTS))
        sizes = (f"{r['characters']:.0f}", f"{r['jointed']:.0f}", str(r["tokens"]))
        lines.append("| " + " | ".join((r["room"], str(r["seed"]), r["detail"], *times, *counts, *sizes)) + " |")
    return "\n".join([*lines, "", f"Tokens counted by: {', '.join(sorted({r['tokenizer'] for r in rows}))}."])


def merged(path: Path, rows: list[Row]) -> list[dict]:
    """Return the rows of a file with new ones in place of those of the same room, seed and detail."""
    earlier = json.loads(path.read_text()) if path.is_file() else []
    by_key = {(r["detail"], r["room"], r["seed"]): r for r in [*earlier, *map(asdict, rows)]}
    return [by_key[key] for key in sorted(by_key)]


def main() -> None:
    """Measure, write and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rooms", nargs="+", default=list(HOMES), choices=list(HOMES))
    parser.add_argument("--seeds", nargs="+", type=int, default=[0, 1, 2])
    parser.add_argument("--detail", default="demo", choices=["demo", "full", "rgbd", "phone"])
    parser.add_argument("--keep", type=Path, help="folder in which scans and stages stay, as ROOM_SEED_DETAIL")
    parser.add_argument("--out", type=Path, default=Path("experiments/results/rooms.json"))
    args = parser.parse_args()
    rows, commit = [], provenance("cpu")["commit"]
    for room, seed in track([(room, seed) for room in args.rooms for seed in args.seeds], "rooms"):
        with tempfile.TemporaryDirectory() as folder:
            kept = args.keep and args.keep / f"{room}_{seed}_{args.detail}"
            rows.append(measure(room, seed, args.detail, kept or Path(folder), commit))
        # Written after each room: a long measurement that is cut short keeps what it has.
        args.out.write_text(json.dumps(merged(args.out, rows), indent=1) + "\n")
    print(markdown(merged(args.out, [])))


if __name__ == "__main__":
    main()
