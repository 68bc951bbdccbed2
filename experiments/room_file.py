"""One file for a whole room: how long it takes, how large it is, which of its parts the planner opens, what lies still.

    python experiments/room_file.py STAGE ... [--steps prepare free open] [--num-envs 16] [--seed 0] [--free 3] [--out FILE]

STAGE is a geometric.usd. `prepare` writes all parts of the room into one file, once with an empty cache and once with a full one.
`open` lets the planner open every part in that one file from noisy starts. `free` takes the first small objects that stand on
something out of the room, and watches them for two seconds in mujoco-warp and in MuJoCo C. Renews these rooms' rows of
experiments/results/room_file.json and keeps its others. Times are wall-clock seconds on all processors of the machine; `cpu` is
processor time of the main process and its children.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import newton
import numpy as np
import torch

from s2a.commands.evaluate import Config
from s2a.core import config
from s2a.core.errors import InputError
from s2a.core.provenance import provenance
from s2a.learn.evaluate import evaluate
from s2a.motion.policy import Planner
from s2a.prepare.free_objects import free_objects
from s2a.prepare.part import ALL
from s2a.prepare.room import PrepareConfig, prepare
from s2a.scene.articulation import lever_arm
from s2a.scene.scene import Scene
from s2a.scene.usd import geometric, sim_stage
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import SimStage, axis_of, read_stage
from s2a.tasks import make_env

RESULTS = Path(__file__).parent / "results/room_file.json"
STEPS = ("prepare", "free", "open")
SMALL = (0.08, 0.35)
"""[m] Diagonal of an object that counts as small, and that a gripper could hold."""
SECONDS = 2.0


def main() -> None:
    """Measure each room, and write after each figure."""
    args = _arguments()
    rooms: dict[str, dict[str, Any]] = json.loads(args.out.read_text())["rooms"] if args.out.exists() else {}
    for stage in args.stages:
        scene = geometric.read(stage)
        row = rooms.setdefault(scene.name, {"room": stage.parent.name})
        file = args.work / f"{scene.name}.usd"
        for key, value in _figures(scene, file, stage, args, row):
            row[key] = value
            args.out.parent.mkdir(exist_ok=True)
            args.out.write_text(json.dumps({"seed": args.seed, **provenance("cpu"), "rooms": rooms}, indent=1) + "\n")


def _figures(
    scene: Scene, file: Path, stage: Path, args: argparse.Namespace, row: dict[str, Any]
) -> Iterator[tuple[str, Any]]:
    """Yield the name and value of each figure of a room."""
    if "prepare" in args.steps:
        yield "prepare", _prepare(stage, file)
        print(scene.name, json.dumps(row["prepare"]), flush=True)
    if "free" in args.steps:
        yield "free", _free(scene, file.with_stem(f"{file.stem}_free"), args.free)
        print(scene.name, json.dumps(row["free"]), flush=True)
    if "open" in args.steps:
        opened = dict(row.get("open", {}))
        for part in args.parts or sim_stage.read(file, visuals=False).articulations:
            opened[part] = open_part(file, part, args.num_envs, args.seed)
            print(scene.name, part, json.dumps(opened[part]), flush=True)
            yield "open", opened


def _settings() -> PrepareConfig:
    values = config.compose("prepare")["prepare"]
    return config.load(PrepareConfig, values)


def _prepare(stage: Path, file: Path) -> dict[str, Any]:
    """Prepare all parts of a room twice, and return seconds and sizes."""
    file.parent.mkdir(parents=True, exist_ok=True)
    figures: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as cache:
        os.environ["S2A_CACHE"] = cache
        for name in ("cold", "warm"):
            start, used = time.perf_counter(), _processor_time()
            scene = geometric.read(stage)
            room = prepare(scene, ALL, _settings())
            sim_stage.write(room, file)
            figures[name] = {
                "seconds": round(time.perf_counter() - start, 1),
                "cpu": round(_processor_time() - used, 1),
            }
    begun = time.perf_counter()
    sim_stage.read(file, visuals=False)
    return {
        **figures,
        "faces": sum(len(part.mesh.faces) for part in scene.parts.values()),
        "parts": len(room.articulations),
        "left_out": [part for part in scene.movable if part not in room.articulations],
        "no_free_base": [part for part, a in room.articulations.items() if not all(b.free for b in a.bases.values())],
        "hulls": sum(len(body.colliders) for body in room.bodies.values()),
        "static_hulls": len(room.static_colliders),
        "bytes": file.stat().st_size,
        "visual_bytes": sim_stage.visuals_file(file).stat().st_size,
        "read_seconds": round(time.perf_counter() - begun, 3),
    }


def _processor_time() -> float:
    usages = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def open_part(
    file: Path, part: str, num_envs: int, seed: int, also: Sequence[str] = (), device: str = "cpu"
) -> dict[str, Any]:
    """Return what the planner reaches with one part of a room, and how far what else moves (`also`) is ever displaced."""
    settings = config.load(
        Config, config.compose("evaluate", [f"stage={file}", f"part={part}", "sim=planner", "out=-"])
    )
    try:
        sim = Simulation(read_stage(file, part, also=also), settings.sim, num_envs, device)
        env = make_env(sim, settings.task, settings.metrics, {}, seed)
        planner = Planner(env, settings.planner)
        if (
            planner.steps >= env.max_episode_length
        ):  # some paths come near a singularity, where the arm has to go slowly
            env = make_env(sim, replace(settings.task, episode_steps=planner.steps + 1), settings.metrics, {}, seed)
            planner = Planner(env, settings.planner)
        watch = Displaced(sim)
        found = evaluate(env, planner, watch)
    except InputError as error:
        return {"error": str(error).removeprefix(f"{file}: ")}
    names = ("success", "handle_success", "grasp_success")
    counts = {name: round(found[name]["rate"] * found["episodes"]) for name in names}
    opening = {name: round(found["opening"][name], 4) for name in ("mean", "min")}
    others = {"others_mm": round(1000.0 * max(watch.paths.values()), 3)} if watch.paths else {}
    return {"num_envs": num_envs, **counts, "opening": opening, "travel": round(sim.stage.travel, 3), **others}


class Displaced:
    """Largest displacement of each part and object but the target, in all worlds, since the first call.

    Attributes:
        paths: by id [m]; of a part that of its grasp point.
        turns: by id [degree]; 0 for a slide.
    """

    def __init__(self, sim: Simulation) -> None:
        """Watch the worlds of one stage."""
        self._sim, self._room, self._start = sim, sim.stage.room, None
        self.paths: dict[str, float] = dict.fromkeys(sim.stage.active[1:], 0.0)
        self.turns = dict(self.paths)

    def __call__(self) -> None:
        """Compare the worlds with how they were at the first call."""
        now = self._sim.joint_q.cpu(), self._sim.body_q.cpu()
        if self._start is None:
            self._start = now[0].clone(), now[1].clone()
        for i in self.paths:
            path, turn = self.moved(i, *now)
            self.paths[i], self.turns[i] = max(self.paths[i], path), max(self.turns[i], turn)

    def moved(self, i: str, q: torch.Tensor, poses: torch.Tensor) -> tuple[float, float]:
        """Return path [m] and turn [degree] from the start to coordinates [world coord] and poses [world body 7]; inf for NaN."""
        if i in self._room.free:
            a, b = (each[:, self._sim.body(i)] for each in (self._start[1], poses))
            turn = 2.0 * torch.rad2deg(torch.arccos((a[:, 3:] * b[:, 3:]).sum(dim=1).abs().clamp(max=1.0)))
            path = (a - b)[:, :3].norm(dim=1)
        else:
            part = self._room.articulations[i]
            at = axis_of(self._sim.world, i, part.joint.kind)[0]
            change = (q - self._start[0])[:, at].abs()
            path = change * lever_arm(part.joint, np.array(part.grasp.point))
            turn = torch.rad2deg(change) if part.joint.kind == "revolute" else torch.zeros_like(change)
        return float(path.nan_to_num(torch.inf).max()), float(turn.nan_to_num(torch.inf).max())


def _free(scene: Scene, file: Path, count: int) -> dict[str, Any]:
    """Take small objects out of a room and watch them; return how far each moves [m] in either simulator."""
    settings, names = _settings(), []
    for part in _small(scene):
        try:
            free_objects(scene, [*names, part], scene.movable, settings.free)
        except InputError:
            continue
        names.append(part)
        if len(names) == count:
            break
    room = prepare(scene, scene.movable[0], settings, names)
    sim_stage.write(room, file)
    stage = read_stage(file, also=names)
    moved = {"mujoco-warp": _rest(stage, cpu=False), "mujoco": _rest(stage, cpu=True)}
    hulls = {name: len(room.free[name].colliders) for name in names}
    return {name: {"hulls": hulls[name], **{k: round(v[name], 5) for k, v in moved.items()}} for name in names}


def _small(scene: Scene) -> list[str]:
    """Return small objects without joints, one of each label, the smallest first: their contacts are the hardest."""
    found: dict[str, str] = {}
    sizes = {}
    for part, value in scene.parts.items():
        whole = [part, *scene.descendants(part)]
        size = np.linalg.norm(np.ptp(value.mesh.bounds, axis=0)) if len(value.mesh.faces) else np.inf
        if value.parent is None and SMALL[0] < size < SMALL[1] and not set(whole) & set(scene.movable):
            found.setdefault(value.label, part)
            sizes[part] = size
    return sorted(found.values(), key=lambda part: sizes[part])


def _rest(stage: SimStage, *, cpu: bool) -> dict[str, float]:
    """Return how far free objects move within SECONDS without a robot [m]."""
    settings = config.load(SimConfig, config.compose("evaluate")["sim"])
    sim = Simulation(stage, settings, 1, with_robot=False)
    indices = {name: sim.body(name) for name in stage.also}
    start, steps = sim.body_q[0].clone(), round(SECONDS / settings.dt)
    state, other = sim.state, sim.before
    solver = newton.solvers.SolverMuJoCo(sim.model, use_mujoco_cpu=True) if cpu else sim.solver
    for _ in range(steps):
        solver.step(state, other, sim.control, None, settings.dt)
        state, other = other, state
    end = state.body_q.numpy().reshape(start.shape)
    return {name: float(np.linalg.norm(end[i, :3] - start[i, :3].numpy())) for name, i in indices.items()}


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stages", nargs="+", type=Path)
    parser.add_argument("--steps", nargs="+", default=STEPS, choices=STEPS)
    parser.add_argument("--parts", nargs="+", default=[], help="ids of the parts to open; else all of each room")
    parser.add_argument("--num-envs", type=int, default=16)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--free", type=int, default=3)
    parser.add_argument("--work", type=Path, default=Path("runs/rooms"))
    parser.add_argument("--out", type=Path, default=RESULTS)
    return parser.parse_args()


if __name__ == "__main__":
    main()
