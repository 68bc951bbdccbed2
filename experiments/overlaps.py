"""How deep do colliders of a room overlap where nothing filters them?

    python experiments/overlaps.py GEOMETRIC_USD ... [--simcheck COMMAND] [--jobs 1] [--out FILE]

Prepares every room, and measures before and after `s2a.prepare.neighbours.trim_apart` each articulated part against all other
bodies and the static room: MuJoCo's depth of convex hulls along the whole path, and Newton's contacts at 33 coordinates of each
joint, no pair left out. A room's row says, before and after: the largest overlap at rest and anywhere in a range [mm], pairs
above 1 mm at rest or 2 mm in the range, hulls of all bodies; the processor time of the trim; how many hulls of grasp regions it
changed, of how many; and the largest fraction of its hulls' volume that a part, and furniture, lost.

--simcheck names the program of that name (PyPI): the room is then converted to MJCF without its excludes and to URDF without
its SRDF, and what it finds after the trim is counted by check. Renews the rows of these rooms in the result file.
"""

from __future__ import annotations

import argparse
import json
import logging
import shlex
import subprocess
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import warp as wp

from s2a.certify.convert import ConvertSettings, convert
from s2a.core import config
from s2a.core.provenance import provenance
from s2a.prepare.neighbours import trim_apart
from s2a.prepare.part import ALL
from s2a.prepare.room import PrepareConfig, prepare
from s2a.scene.geometry.convex import volume
from s2a.scene.usd import geometric, sim_stage
from s2a.scene.usd.sim_scene import SimBody, SimRoom
from s2a.sim.contacts import RestingRoom, newton_depths
from s2a.sim.solver import SimConfig

RESULTS = Path(__file__).parent / "results/overlaps.json"
REST, RANGE = 1e-3, 2e-3
"""Overlap that counts, at rest and in the range [m]."""


def main() -> None:
    """Measure the rooms, write the file and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stages", nargs="+", type=Path)
    parser.add_argument("--simcheck")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()
    rows = {row["room"]: row for row in (json.loads(args.out.read_text())["rows"] if args.out.exists() else [])}
    with ProcessPoolExecutor(args.jobs) as pool:
        for row in pool.map(partial(measure, simcheck=args.simcheck), args.stages):
            rows[row["room"]] = row
            content = {**provenance("cpu"), "summary": summary(list(rows.values())), "rows": list(rows.values())}
            args.out.write_text(json.dumps(content, indent=1) + "\n")
            print(json.dumps(row), flush=True)
    print(json.dumps(summary(list(rows.values())), indent=1))


def measure(stage: Path, simcheck: str | None) -> dict:
    """Return the row of one room."""
    logging.disable(logging.WARNING)
    wp.config.quiet = True
    before, after, seconds = prepared(stage)
    row = compared(before, after) | {"room": stage.parent.name, **seconds}
    return row | ({"simcheck": findings(after, simcheck)} if simcheck else {})


def prepared(stage: Path) -> tuple[SimRoom, SimRoom, dict[str, float]]:
    """Return a room before and after the trim, and the processor time of all of the preparation and of the trim [s]."""
    scene, settings = geometric.read(stage), config.load(PrepareConfig, config.compose("prepare/handle", [])["prepare"])
    untrimmed: dict[str, SimBody] = {}
    seconds = {}

    def trimmed(bodies: Mapping[str, SimBody], *arguments: Any) -> dict[str, SimBody]:
        untrimmed.update(bodies)
        start = time.process_time()
        apart = trim_apart(bodies, *arguments)
        seconds["trim_s"] = round(time.process_time() - start, 1)
        return apart

    start = time.process_time()
    with mock.patch("s2a.prepare.room.trim_apart", trimmed):
        after = prepare(scene, ALL, settings)
    return replace(after, bodies=untrimmed), after, {"prepare_s": round(time.process_time() - start, 1), **seconds}


def compared(before: SimRoom, after: SimRoom) -> dict:
    """Return what the trim changed of a room."""
    row: dict = {"parts": len(after.articulations), "before": overlaps(before), "after": overlaps(after)}
    handles = {i: {c.part for c in after.bodies[i].colliders} - {i} for i in after.articulations}
    was, now = (grasp_hulls(room.bodies, handles) for room in (before, after))
    row |= {"handle_hulls": sum(was.values()), "handle_hulls_changed": (was - now).total()}
    full = {i: body for i, body in before.bodies.items() if body.colliders}
    lost = {i: 1.0 - volume_of(after.bodies[i]) / volume_of(body) for i, body in full.items()}
    for name, ids in (("part_lost", after.articulations), ("furniture_lost", after.fixed)):
        row[name] = round(max([lost[i] for i in ids if i in lost], default=0.0), 3)
    return row


def overlaps(room: SimRoom) -> dict:
    """Return the largest overlaps of a room and the pairs above the bounds."""
    joints = {i: each.joint for i, each in room.articulations.items()}
    parents = {i: each.parent for i, each in room.articulations.items()}
    around = RestingRoom(room.bodies, joints, parents, room.static_colliders)
    result: dict = {"hulls": sum(len(body.colliders) for body in room.bodies.values())}
    for name, engine in (("mujoco", None), ("newton", newton_depths)):
        depths = {(part, i): each for part in joints for i, each in around.overlaps(part, engine).items()}
        result |= {
            f"{name}_rest_mm": round(1000 * max([each.rest for each in depths.values()], default=0.0), 2),
            f"{name}_range_mm": round(1000 * max([each.travel for each in depths.values()], default=0.0), 2),
        }
        above = {pair: each for pair, each in depths.items() if each.rest > REST or each.travel > RANGE}
        if name == "mujoco":
            result["pairs"] = len(above)
            result["deepest"] = [
                [*pair, *np.round([1000 * each.rest, 1000 * each.travel, each.q], 2).tolist()]
                for pair, each in sorted(above.items(), key=lambda item: -item[1].travel)[:5]
            ]
    return result


def volume_of(body: SimBody) -> float:
    """Return the volume of a body's hulls [m^3]."""
    return sum(volume(collider.mesh) for collider in body.colliders)


def grasp_hulls(bodies: Mapping[str, SimBody], handles: Mapping[str, set[str]]) -> Counter:
    """Return the hulls of grasp regions, as bytes of their vertices."""
    return Counter(
        c.mesh.vertices.tobytes() for i, own in handles.items() for c in bodies[i].colliders if c.part in own
    )


def findings(room: SimRoom, simcheck: str) -> dict[str, dict[str, int]]:
    """Return the findings of simcheck by format and check, errors and warnings."""
    sim, counts = config.load(SimConfig, config.compose("sim/planner", [])["sim"]), {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        sim_stage.write(room, folder / "room.usd")
        for kind, file in (("mjcf", "room.xml"), ("urdf", "room.urdf")):
            convert(ConvertSettings(folder / "room.usd", folder / kind, kind, ALL, sim))
            for srdf in (folder / kind).glob("*.srdf"):
                srdf.unlink()
            if kind == "mjcf":
                tree = ElementTree.parse(folder / kind / file)
                for contact in tree.getroot().findall("contact"):
                    tree.getroot().remove(contact)
                tree.write(folder / kind / file)
            command = [
                *shlex.split(simcheck),
                "check",
                str(folder / kind / file),
                "--no-config",
                "--fixed-base",
                "--json",
                "-",
                "-q",
            ]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            report = json.loads(done.stdout[done.stdout.index("{") :])
            listed = [each for each in report["findings"] if each["severity"] in ("error", "warning")]
            counts[kind] = dict(Counter(f"{each['check']} ({each['severity']})" for each in listed))
    return counts


def summary(rows: list[dict]) -> dict:
    """Return the largest numbers over all rooms."""
    keys = ("mujoco_rest_mm", "mujoco_range_mm", "newton_rest_mm", "newton_range_mm")
    result: dict = {"rooms": len(rows), "parts": sum(row["parts"] for row in rows)}
    for when in ("before", "after"):
        result[when] = {key: max(row[when][key] for row in rows) for key in keys}
        result[when] |= {key: sum(row[when][key] for row in rows) for key in ("pairs", "hulls")}
        result[when]["rooms_with_pairs"] = sum(row[when]["pairs"] > 0 for row in rows)
    changed = {key: sum(row[key] for row in rows) for key in ("handle_hulls", "handle_hulls_changed")}
    largest = {key: max(row[key] for row in rows) for key in ("trim_s", "part_lost", "furniture_lost")}
    return result | changed | largest


if __name__ == "__main__":
    main()
