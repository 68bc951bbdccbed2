"""Does the planner put inserted objects where the insertion put them? Four objects in each of five rooms.

    python experiments/skill_rooms.py     # once, on any machine
    python experiments/pick_place.py [--num-envs 8] [--device cpu] [--jobs 1] [--rooms office_0 ...] [--seeds 0]

Each object is picked from a free spot near its place (task.start=nearby) and placed as its insertion record says, by
`s2a evaluate task=pick_place`. Objects that have a row are not done again. Writes experiments/results/pick_place.json after each:
a row an object and seed, all episodes together with their Wilson 95 % interval, and the largest use of the robot's limits. An
object that cannot be inserted, freed or planned for counts as so many failures, by its cause.
"""

from __future__ import annotations

import argparse
import json
import re
import time
from pathlib import Path

import numpy as np
import trimesh
from skill_jobs import Row, arguments, evaluated, one, results, run, summarized
from skill_rooms import NAMES, ROOMS

from s2a import robot as robots
from s2a.robot.tool_path import matrix
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import DEFAULT_ROBOT

RESULTS = Path(__file__).parent / "results/pick_place.json"
COLUMNS = ("grasped", "carried", "released_at_rest", "placed", "undisturbed")
"""In the order in which an episode fails."""
HIGHER = 0.01
"""[m] Above an object's lowest point, from where its width counts: lower down fingers meet the support."""
VALUES = ("position_error", "angle_error", "drift")


def main() -> None:
    """Do what has no row, and write the results."""
    parser = arguments(__doc__, RESULTS)
    every = [label for labels in ROOMS.values() for label in labels]
    parser.add_argument("--objects", nargs="*", default=every, choices=every, metavar="LABEL")
    args = parser.parse_args()
    if args.one:
        room, label, seed = args.one
        one(_path(args, room, label, seed), lambda: _row(args, room, label, seed))
        return
    jobs = {
        _path(args, room, label, str(seed)): (room, label, str(seed))
        for seed in args.seeds
        for k in range(max(map(len, ROOMS.values())))
        for room in args.rooms
        for label in ROOMS[NAMES[room]][k : k + 1]
        if label in args.objects
    }
    run(jobs, args, lambda: results(list(jobs), len(jobs), args))


def _path(args: argparse.Namespace, room: str, label: str, seed: str) -> Path:
    name = re.sub(r"\W+", "_", label)
    return args.rows / f"{room}_{name}_{seed}.json"


def _row(args: argparse.Namespace, room: str, label: str, seed: str) -> Row:
    """Plan for an object and execute it; return how it went."""
    folder = args.inputs / room
    found = json.loads((folder / "objects.json").read_text())[label]
    row = {"room": room, "object": label, "seed": int(seed)}
    if not found["free"]:
        return row | {"cause": "prepare" if found["id"] else "insert", "why": found["why"]}
    row["width"] = width(folder / "room.usd", found["id"])
    begun = time.perf_counter()
    metrics = evaluated(
        [f"stage={folder}/room.usd", f"part={found['id']}", "task=pick_place", "sim=pick_place", "task.start=nearby",
         f"task.place={folder}/insert.json", f"num_envs={args.num_envs}", f"device={args.device}", f"seed={seed}", *args.set],
        args.rows / "metrics" / _path(args, room, label, seed).name,
    )  # fmt: skip
    row["seconds"] = round(time.perf_counter() - begun, 1)
    return row | (summarized(metrics, COLUMNS, VALUES) if "success" in metrics else metrics)


def width(room: Path, name: str) -> float | None:
    """Return the least level width [m] of an object over the pads' height around its middle; None: it is flatter than HIGHER.

    Fingers open 0.08 m.
    """
    body = sim_stage.read(room, visuals=False).free[name]
    turn = matrix(np.array([*body.position, *body.orientation]))[:3, :3]
    hulls = [trimesh.Trimesh(each.mesh.vertices @ turn.T, each.mesh.faces) for each in body.colliders]
    low, high = (f(f(each.vertices[:, 2]) for each in hulls) for f in (min, max))
    middle, half = (low + high) / 2, robots.load(DEFAULT_ROBOT).gripper.finger_box[2] / 2
    heights = np.arange(max(middle - half, low + HIGHER), min(middle + half, high), 0.0025)
    cuts = [trimesh.intersections.mesh_plane(each, [0, 0, 1], [0, 0, z]) for each in hulls for z in heights]
    points = np.concatenate([np.zeros((0, 2)), *(cut.reshape(-1, 3)[:, :2] for cut in cuts)])
    angles = np.linspace(0.0, np.pi, 36, endpoint=False)
    across = np.stack([np.cos(angles), np.sin(angles)])
    return round(float(np.ptp(points @ across, axis=0).min()), 3) if len(points) else None


if __name__ == "__main__":
    main()
