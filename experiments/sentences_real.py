"""Do sentences mean the right skills in captures of real rooms? The rules' plans beside what a person takes the words to mean.

    python experiments/sentences_real.py ROOMS [--rooms scene0000_00 ...] [--name rules] [--execute 4] [--out FOLDER]

ROOMS holds NAME.usd or NAME/room.usd (`s2a prepare`) and NAME/descriptive.usda (`s2a export`) for each room of
sentences_real.yaml. With `--execute` so many at a time of the right plans are executed by `s2a do`; else nothing is asked about
reach. Prints a line a sentence and writes sentences_real_NAME.json.
"""

from __future__ import annotations

import argparse
import json
import re
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from insertion_study import RESULTS
from skill_rooms import message, s2a

from s2a.core import config
from s2a.core.provenance import provenance
from s2a.language.ask import Request
from s2a.language.commands.do import Config
from s2a.language.do.episode import tasks_of
from s2a.language.do.facts import Facts, gather
from s2a.language.do.rules import rules
from s2a.scene.usd import descriptive, sim_stage

SENTENCES = Path(__file__).parent / "sentences_real.yaml"
MARGIN = 0.06  # [m] Around a front's box: two drawings of one front differ by so much


def main() -> None:
    """Plan every sentence and write what came of it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("captures", type=Path)
    parser.add_argument("--rooms", nargs="*")
    parser.add_argument("--name", default="rules")
    parser.add_argument("--execute", type=int, default=0, metavar="JOBS")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()
    sentences, rows = yaml.safe_load(SENTENCES.read_text()), []
    for name in args.rooms or sentences:
        stage = _stage(args.captures, name)
        settings = config.load(
            Config, config.compose("do", [f"stage={stage}", "sentence=x", "out=unused", "llm=rules"])
        )
        described = descriptive.read(args.captures / name / "descriptive.usda")
        facts, skills = gather(sim_stage.read(stage), described, {}, settings.robot.name), tasks_of(settings.skills)
        for entry in sentences[name]:
            entry = _with_ids(entry, facts)
            question = {"sentence": entry["sentence"], "things": facts, "skills": skills}
            plan = json.loads(rules(Request("skills", "", (("user", ""),), None, question)).text)
            done = [
                [i for i in (one["skill"], one["object"], one["part"], one["support"]) if i] for one in plan["skills"]
            ]
            right = done == entry["do"] if "do" in entry else plan["refusal"] in entry["refuse"]
            rows.append(
                {
                    "room": name,
                    **entry,
                    "plan": done,
                    "refusal": plan["refusal"],
                    "reason": plan["reason"],
                    "right": right,
                }
            )
            print(
                name,
                "ok " if right else "BAD",
                entry["sentence"],
                done,
                plan["refusal"],
                plan["reason"][:90],
                flush=True,
            )
    counts = {"sentences": len(rows), "right": sum(row["right"] for row in rows)}
    counts |= {"wrong skills": sum(bool(row["plan"]) and not row["right"] for row in rows)}
    if args.execute:
        right = [row for row in rows if row["plan"] and row["right"]]
        with ThreadPoolExecutor(args.execute) as pool:
            list(pool.map(lambda row: _execute(row, args), right))
        counts |= {"executed": len(right), "succeeded": sum(row["problem"] == "" for row in right)}
    (args.out / f"sentences_real_{args.name}.json").write_text(
        json.dumps({**provenance(args.device), **counts, "rows": rows}, indent=1) + "\n"
    )
    print(counts)


def _with_ids(entry: dict[str, Any], facts: Facts) -> dict[str, Any]:
    """Return a sentence with the id of the front at each point; a front that the room has not is named by its point."""
    points = [(skill, at) for skill, *rest in entry.get("do", ()) for at in rest if isinstance(at, list)]
    if not points:
        return entry
    ids = [_front(at, facts) for _, at in points]
    return {
        "sentence": entry["sentence"].format(*ids),
        "do": [[skill, i] for (skill, _), i in zip(points, ids, strict=True)],
    }


def _front(at: list[float], facts: Facts) -> str:
    """Return the id of what moves on a joint and whose middle is nearest to a point that its box holds, but for MARGIN."""
    off = {i: np.abs(np.subtract(at, thing.center)) for i, thing in facts.items() if thing.moves and thing.center}
    here = [i for i in off if (off[i] <= np.array(facts[i].size) / 2 + MARGIN).all()]
    return min(here, key=lambda i: float(np.linalg.norm(off[i])), default=str(at))


def _stage(captures: Path, name: str) -> Path:
    """Return the simulation-ready file of a room."""
    stage = captures / f"{name}.usd"
    return stage if stage.exists() else captures / name / "room.usd"


def _execute(row: dict[str, Any], args: argparse.Namespace) -> None:
    """Do a sentence, and note how long it took and why it failed."""
    name = f"{row['room']}_{re.sub(r'[^a-z0-9]+', '_', row['sentence'].lower())}.json"
    begun, out = time.perf_counter(), args.out / "done" / name
    out.unlink(missing_ok=True)  # a refusal leaves an earlier record as it was
    stage, scene = _stage(args.captures, row["room"]), args.captures / row["room"] / "descriptive.usda"
    keys = [f"stage={stage}", f"scene={scene}", "llm=rules", f"device={args.device}", f"out={out}"]
    done = s2a("do", row["sentence"], *keys, check=False)
    row["seconds"] = round(time.perf_counter() - begun, 1)
    row["problem"] = json.loads(out.read_text())["problem"] if out.exists() else message(done)
    print(row["room"], row["sentence"], row["seconds"], row["problem"] or "done", flush=True)


if __name__ == "__main__":
    main()
