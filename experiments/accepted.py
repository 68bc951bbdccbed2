"""Does the planner open parts that were proposed and accepted? A scripted annotator goes through the proposals of phones' scans.

    python experiments/accepted.py runs/homes/*_phone --work runs/accepted --out experiments/results/accepted.json

Each folder holds a scan of s2a sample detail=phone; its GLB is imported, and proposals are made. The annotator
accepts those that match a part (intersection over union of 0.5, kind and direction right) and rejects the others; where one has
no handle, or one without sides to press on, or whose middle is more than OFF beside that of the true one, it clicks on that: what
stands out there becomes the handle, or a bar that is added. Then come s2a export, prepare and the planner, EPISODES for each
part, long enough for its plan. A part without a handle in the truth stays as proposed. A part is opened where every episode
succeeds; one that export or prepare lost counts as not opened.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import numpy as np
import proposals
from proposals import TEXEL

from s2a import scan
from s2a.annotate import files, handle
from s2a.annotate.annotation import Draft
from s2a.annotate.propose.fronts import cut, propose
from s2a.annotate.propose.layers import ProposeConfig
from s2a.annotate.region import GrowConfig
from s2a.commands import cli
from s2a.core import config
from s2a.core.provenance import provenance
from s2a.scan import folder
from s2a.scan.formats import articulate3d
from s2a.scan.labels import parents

EPISODES, STEPS = 2, 1500
"""For each part, and control steps of each: with the task's 500 the plans around furniture were cut off."""
HANDLES = ("handle", "knob", "lever")
OFF = 0.02
"""[m] Along the front, from which a person sees that what is marked as handle is not it: a quarter of what the gripper opens."""


def main() -> None:
    """Go through all folders, print and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scans", nargs="+", type=Path)
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    rows: list[dict] = []
    for path in arguments.scans:
        rows += opened(path, arguments.work / path.name)
        print(path.name, summary(rows), flush=True)
        if arguments.out:
            content = {"provenance": provenance("cpu"), "episodes": EPISODES, "summary": summary(rows), "rows": rows}
            arguments.out.write_text(json.dumps(content, indent=1) + "\n")


def opened(path: Path, work: Path) -> list[dict]:
    """Return a row for each part that was accepted of a scan."""
    work.mkdir(parents=True, exist_ok=True)
    keys = [f"mesh={path / 'scan.glb'}", f"out={work / 'scan'}", f"texel={TEXEL}", "floor=false"]
    _call("import", *keys)
    draft, rows = accepted(path, files.read(work / "scan"))
    if not rows:
        return rows
    files.write(draft, files.read(work / "scan"), work / "annotated")
    _call("export", f"scan={work / 'annotated'}", f"out={work}")
    movable = scan.read(work / "annotated").movable
    _call("prepare", f"stage={work / 'geometric.usd'}", "targets=all", f"out={work / 'room.usd'}")
    for row, part in zip(rows, movable, strict=True):
        row |= {"written_as": part} | _evaluated(work, part)
        print(" ", row, flush=True)
    return rows


def accepted(path: Path, bare: files.BareScan) -> tuple[Draft, list[dict]]:
    """Return the annotation of the accepted proposals of an imported scan, and a row for each."""
    values = config.file("annotate")
    grow = GrowConfig()
    sample = files.read(path)
    _, source = proposals.as_used(path, sample)
    truth = json.loads((path / "truth" / "truth.json").read_text())
    real = proposals.true_parts(path, sample, truth, bare.surface, source)
    found = propose(bare.surface, config.load(ProposeConfig, values["propose"]), grow)
    scores = np.array([[proposals.overlap(bare.surface, i.region.faces, f) for _, f, _ in real] for i in found])
    pairs = proposals.matched(scores.reshape(len(found), len(real)))
    rows = [(i, proposals.row(truth, found, real, scores, i, j)) for i, j in pairs]
    rows = [(i, row) for i, row in rows if row.get("same_direction")]
    draft = cut(bare.surface, tuple(found[i] for i, _ in rows), grow)
    places = handle_places(path, sample, truth)
    for index, (_, row) in enumerate(rows):
        place, faces = places.get(row["part"]), draft.items[index].handle
        off = _off(draft, index, place) if place is not None and len(faces) else None
        row |= {"seed": truth["seed"], "handle_off_m": None if off is None else round(off, 3)}
        right = (
            off is not None and bool(off <= OFF) and handle.has_sides(draft.surface, draft.items[index].region, faces)
        )
        row["clicked"] = place is not None and not right
        if row["clicked"]:
            draft = draft.with_handle(index, place, None)
    return draft, [row for _, row in rows]


def _off(draft: Draft, index: int, place: np.ndarray) -> float:
    """Return how far along its front the middle of a part's handle is from a place [m]."""
    corners = draft.surface.vertices[draft.surface.faces[draft.items[index].handle]].reshape(-1, 3)
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
    first, second = draft.items[index].region.local(np.stack([middle, place]))[:, :2]
    return float(np.linalg.norm(first - second))


def handle_places(path: Path, sample: files.BareScan, truth: dict) -> dict[str, np.ndarray]:
    """Return the middle of the handle of each part that has one [m]."""
    annotated = articulate3d.read_parts(folder.find(path).parts, sample.mesh)
    parent = parents({number: part.label for number, part in annotated.items()})
    ids = {int(name.rpartition("_")[2]): name for name in truth["parts"]}
    return {
        ids[parent[number]]: np.array(truth["parts"][ids[number]]["pose"])[:3, 3]
        for number, part in annotated.items()
        if part.label.split(".")[0].split()[0] in HANDLES and parent[number] in ids
    }


def summary(rows: list[dict]) -> dict:
    """Return how many parts were accepted and opened."""
    clicked = [row for row in rows if row["clicked"]]
    return {
        "parts": len(rows),
        "opened": sum(row["opened"] for row in rows),
        "fraction": round(sum(row["opened"] for row in rows) / max(len(rows), 1), 4),
        "handle_clicked": len(clicked),
        "opened_of_those": sum(row["opened"] for row in clicked),
    }


def _evaluated(work: Path, part: str) -> dict:
    """Return whether the planner opens a part in all episodes, or why it was not tried."""
    report = work / f"{part}.json"
    keys = [f"stage={work / 'room.usd'}", f"part={part}", f"num_envs={EPISODES}", f"task.episode_steps={STEPS}"]
    code = cli.main(["evaluate", *keys, f"out={report}"])
    if code:
        return {"opened": False, "tried": False}
    figures = json.loads(report.read_text())
    rates = {
        name: figures[name]["rate"] if isinstance(figures[name], dict) else figures[name]
        for name in ("success", "grasp_success")
    }
    return {
        "opened": rates["success"] == 1.0,
        "tried": True,
        **rates,
        "opening_m": round(figures["opening"]["mean"], 3),
    }


def _call(*arguments: str) -> None:
    if code := cli.main(list(arguments)):
        sys.exit(code)


if __name__ == "__main__":
    main()
