"""Does a sentence become the right skills? Fifty sentences over five rooms, by rules and from a model's recorded answers.

    python experiments/sentences.py [--llm rules | chat | replay] [--recordings FILE] [--name NAME] [--runs runs/sentences]
        [--rooms office kitchen ...] [--execute all | ROOM:N ...] [llm.model=...]

Makes the rooms below RUNS, unless they are there (a scan, its export, two objects inserted by rules, the room prepared with all
its parts): some two minutes each. Then plans every sentence of sentences.yaml and compares the plan with what is right, which was
written by hand from the rooms' contents. Nothing moves. Writes experiments/results/sentences_NAME.json.

With `--llm chat` a model is asked (OPENAI_API_KEY, OPENAI_BASE_URL, llm.model=...), and its answers are kept in FILE; what is
there already is not asked again. `--llm replay` needs no more than that.

`--execute office:1 living_room:4` executes these sentences (counted from 1 in their room; all: those to be done) with `s2a do`,
in simulation, and writes experiments/results/sentences_executed_NAME.json.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import yaml
from scipy.stats import binomtest

from s2a import tasks
from s2a.core import config
from s2a.core.errors import InputError
from s2a.core.progress import track
from s2a.core.provenance import provenance
from s2a.language.do.plan import SkillPlan, check_sentence
from s2a.language.do.rules import rules
from s2a.language.do.run import RoomContext, make_plan
from s2a.language.llm.ask import Model, UsageLog
from s2a.language.llm.client import LlmConfig, choose
from s2a.scene.usd import descriptive, sim_stage

FOLDER = Path(__file__).parent
RESULTS, SENTENCES = FOLDER / "results", FOLDER / "sentences.yaml"
OPENING = 0.3
"""[m] As conf/task/put_in.yaml."""


def main() -> None:
    """Plan every sentence and write how many plans are right."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--llm", default="rules", choices=["rules", "chat", "replay"])
    parser.add_argument("--recordings", type=Path, help="a model's answers")
    parser.add_argument("--name", help="of the results; default: rules, or that of the recordings")
    parser.add_argument("--runs", type=Path, default=Path("runs/sentences"))
    rooms = yaml.safe_load(SENTENCES.read_text())
    parser.add_argument("--rooms", nargs="*", default=list(rooms), choices=list(rooms))
    parser.add_argument("--execute", nargs="*", default=[], metavar="ROOM:N")
    parser.add_argument("settings", nargs="*", help="of the model, such as llm.model=gpt-4o-mini")
    args = parser.parse_intermixed_args()
    if (args.llm != "rules") != bool(args.recordings):
        parser.error("--llm chat and --llm replay need --recordings FILE, and --llm rules has none")
    name = args.name or (args.recordings.stem if args.recordings else args.llm)
    llm = [f"llm={args.llm}", *args.settings]
    if args.recordings:
        llm.append(f"record={args.recordings}" if args.llm == "chat" else f"llm.answers={args.recordings}")
    if args.execute:
        rows = []
        numbered = ((room, *each) for room, about in rooms.items() for each in enumerate(about["sentences"], 1))
        every = [f"{room}:{n}" for room, n, entry in numbered if "do" in entry]
        for each in every if args.execute == ["all"] else args.execute:
            rows.append(_execute(rooms, each, llm, args.runs))
            _write(RESULTS / f"sentences_executed_{name}.json", {"llm": name, **provenance("cpu"), "rows": rows})
        return
    values = config.compose("do", llm)
    model = choose(config.load(LlmConfig, values["llm"]), Path(values["record"]) if values["record"] else None, rules)
    rows = []
    for room in args.rooms:
        rows += _room(room, rooms[room], model, values, args.runs)
    print(table(rows))
    _write(RESULTS / f"sentences_{name}.json", {"llm": name, **provenance("cpu"), "table": summary(rows), "rows": rows})


def _room(room: str, about: dict, model: Model, values: dict, runs: Path) -> list[dict]:
    """Plan the sentences of a room; return a line a sentence."""
    folder = _prepared(room, about, runs)
    stage = sim_stage.read(folder / "room.usd", visuals=False)
    skills = {name: tasks.of(each) for name, each in values["skills"].items()}
    context = RoomContext(stage, descriptive.read(folder / "descriptive.usda"), "panda", OPENING, skills)
    rows = []
    for entry in track(about["sentences"], room):
        usage, start = UsageLog(tuple(values["llm"]["prices"])), time.perf_counter()
        try:
            found, _, _ = make_plan(context, check_sentence(entry["say"]), model, values["retries"], usage)
            planned = _planned(found)
        except InputError as error:
            planned = {"error": str(error)}
        total = usage.total()
        told = {"calls": total["calls"], "tokens": total["prompt_tokens"] + total["completion_tokens"]}
        seconds = round(time.perf_counter() - start, 2)
        rows.append(
            {"room": room, **entry, "planned": planned, "right": right(entry, planned), **told, "seconds": seconds}
        )
    return rows


def _planned(found: SkillPlan) -> dict[str, Any]:
    """Return a plan as sentences.yaml writes it."""
    if found.refusal:
        return {"refuse": found.refusal, "reason": found.reason, "options": list(found.options)}
    each = [(skill.skill, skill.object, skill.part or skill.support) for skill in found.skills]
    return {"do": [" ".join(filter(None, words)) for words in each]}


def right(entry: dict, planned: dict) -> bool:
    """Return True for the very skills in their order, or a refusal that fits."""
    if "do" in entry:
        return planned.get("do") == entry["do"]
    return planned.get("refuse") in entry["refuse"]


def summary(rows: list[dict]) -> list[dict]:
    """Return how many plans are right, by room and in all, and how many are harmful: skills where a refusal is right."""
    found = []
    for room in [*dict.fromkeys(row["room"] for row in rows), "all"]:
        own = [row for row in rows if room in (row["room"], "all")]
        doable, others = ([row for row in own if ("do" in row) == kind] for kind in (True, False))
        hits = sum(row["right"] for row in own)
        low, high = binomtest(hits, len(own)).proportion_ci(0.95, method="wilson")
        found.append({
            "room": room, "n": len(own), "right": hits, "low": round(low, 3), "high": round(high, 3),
            "to_do": len(doable), "done_right": sum(row["right"] for row in doable),
            "to_refuse": len(others), "refused_right": sum(row["right"] for row in others),
            "wrong_skills": sum("do" in row["planned"] and not row["right"] for row in own),
        })  # fmt: skip
    return found


def table(rows: list[dict]) -> str:
    """Return the summary as text, and the plans that are not right."""
    lines = [f"{'room':14}{'right':>8}{'to do':>10}{'to refuse':>11}{'wrong skills':>14}"]
    for each in summary(rows):
        counts = f"{each['done_right']}/{each['to_do']}", f"{each['refused_right']}/{each['to_refuse']}"
        hits = f"{each['right']}/{each['n']}"
        lines.append(f"{each['room']:14}{hits:>8}{counts[0]:>10}{counts[1]:>11}{each['wrong_skills']:>14}")
    wrong = [f"  {row['room']}: {row['say']!r} -> {row['planned']}" for row in rows if not row["right"]]
    return "\n".join([*lines, *wrong])


def _execute(rooms: dict, which: str, llm: list[str], runs: Path) -> dict:
    """Execute a sentence with `s2a do`; return what came of it."""
    room, _, number = which.partition(":")
    folder, entry = _prepared(room, rooms[room], runs), rooms[room]["sentences"][int(number) - 1]
    out = runs / "executed" / f"{room}_{number}.json"
    out.unlink(missing_ok=True)
    scene, images = folder / "descriptive.usda", out.with_suffix("")
    subprocess.run(
        [sys.executable, "-m", "s2a", "do", entry["say"], f"stage={folder / 'room.usd'}", f"scene={scene}", f"out={out}",
         f"images={images}", *llm], check=False
    )  # fmt: skip
    record = json.loads(out.read_text()) if out.exists() else {"skills": [], "problem": "refused"}
    keys = ("skill", "object", "part", "support", "success", "reason", "seconds")
    skills = [{key: each[key] for key in keys} for each in record["skills"]]
    return {
        "room": room,
        "say": entry["say"],
        "done": record.get("done", False),
        "problem": record["problem"],
        "skills": skills,
    }


def _prepared(room: str, about: dict, runs: Path) -> Path:
    """Return the folder of a room; make what is missing there."""
    folder, zoo = runs / room, runs / "zoo"
    if (folder / "room.usd").exists():
        return folder
    if not zoo.exists():
        _s2a("zoo", f"out={zoo}")
    _s2a("sample", f"room={room}", "seed=0", "detail=demo", f"out={folder / 'scan'}")
    _s2a("export", f"scan={folder / 'scan'}", f"out={folder}")
    known = {Path(entry["object"]).stem: entry for entry in yaml.safe_load((zoo / "list.yaml").read_text())}
    chosen = [{"object": f"../zoo/{known[o]['object']}", "label": known[o]["label"]} for o in about["objects"]]
    (folder / "list.yaml").write_text(yaml.safe_dump(chosen))
    objects, placed = f"objects={folder / 'list.yaml'}", folder / "insert"
    _s2a(
        "insert", f"stage={folder / 'geometric.usd'}", objects, f"prompt={about['hint']}", f"out={placed}", "llm=rules"
    )
    ids = ",".join(entry["id"] for entry in json.loads((placed / "insert.json").read_text())["objects"])
    free, boxes = f"free=[{ids}]", "prepare.interior=true"
    _s2a("prepare", f"stage={placed / 'insert.usda'}", "targets=all", free, boxes, f"out={folder / 'room.usd'}")
    return folder


def _s2a(*arguments: str) -> None:
    subprocess.run([sys.executable, "-m", "s2a", *arguments], check=True)


def _write(path: Path, values: dict) -> None:
    RESULTS.mkdir(exist_ok=True)
    path.write_text(json.dumps(values, indent=1, ensure_ascii=False) + "\n")


if __name__ == "__main__":
    main()
