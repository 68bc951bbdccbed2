"""Does a converted room open in other simulators as it does here? Every part, pulled by the same force at its handle.

    pip install pybullet==3.2.7
    python experiments/other_simulators.py ROOM.usd ... [--parts door_2 ...] [--out FILE]

Three simulators, none with a robot: this project's (mujoco-warp by Newton, on the CPU, from the stage itself), plain MuJoCo from
`s2a convert to=mjcf`, and PyBullet from `s2a convert to=urdf`. The converted rooms have all their parts movable. The force keeps
its direction, that in which the handle moves first: it grows for half a second and then stays for two and a half, at what opens
the part by 0.7 of its range in plain MuJoCo at most, so that none meets its limit.

Differences are relative to the reference's farthest opening: of the joint's coordinate, and of the handle's place relative to the
farthest displacement of the handle, which an axis that points elsewhere changes too. `wrong` are rooms that were damaged on
purpose: what a faulty conversion would cost.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import mujoco
import numpy as np
from pulled_parts import SECONDS, Pull, in_mujoco, in_newton
from scipy.spatial.transform import Rotation

import s2a
from s2a.core import config
from s2a.core.provenance import provenance
from s2a.scene.articulation import displace, open_limit, opening_direction
from s2a.scene.usd import sim_stage
from s2a.sim.solver import SimConfig
from s2a.sim.world import SimStage, read_stage

RESULTS = Path(__file__).parent / "results/other_simulators.json"
FRACTION = 0.7
"""Of a part's range that it opens at most."""
TIMES = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
"""[s] At which openings are listed."""
GOALS = {"mujoco": 0.01, "pybullet": 0.03}
WRONG: dict[str, Callable[[mujoco.MjModel, int], None]] = {
    "mass +10 %": lambda model, joint: _scale(model.body_mass, model.body_inertia, model.jnt_bodyid[joint]),
    "no damping": lambda model, joint: model.dof_damping.__setitem__(model.jnt_dofadr[joint], 0.0),
    "no dry friction": lambda model, joint: model.dof_frictionloss.__setitem__(model.jnt_dofadr[joint], 0.0),
    "no spring": lambda model, joint: model.jnt_stiffness.__setitem__(joint, 0.0),
    "axis 3 degrees off": lambda model, joint: _tilt(model.jnt_axis[joint]),
}


def pulled(model: mujoco.MjModel, stage: SimStage, settings: SimConfig) -> Pull:
    """Return the pull that opens a part by FRACTION of its range at most, in plain MuJoCo."""
    direction, target = opening_direction(stage.joint, stage.grasp[:3]), FRACTION * abs(open_limit(stage.joint))
    low, high = 0.0, 1.0
    while np.abs(in_mujoco(model, Pull(stage, settings, high * direction))[0]).max() < target:
        low, high = high, 2.0 * high
    for _ in range(12):
        middle = (low + high) / 2
        opened = np.abs(in_mujoco(model, Pull(stage, settings, middle * direction))[0]).max()
        low, high = (middle, high) if opened < target else (low, middle)
    return Pull(stage, settings, low * direction)


def row(stage: Path, part: str, folder: Path, settings: SimConfig) -> dict:
    """Return how a part opens in all simulators."""
    from pulled_in_pybullet import in_pybullet  # which only this experiment needs installed

    model = mujoco.MjModel.from_xml_path(str(folder / "mjcf/room.xml"))
    found = read_stage(stage, part)
    pull = pulled(model, found, settings)
    reference = in_newton(pull)
    samples = [round(time / settings.dt) - 1 for time in TIMES]
    result = {
        "scan": found.room.name,
        "part": part,
        "kind": found.joint.kind,
        "force": round(float(np.linalg.norm(pull.force)), 3),
        "range": round(abs(open_limit(found.joint)), 4),
        "newton": _listed(reference, samples),
    }
    runs = {"mujoco": in_mujoco(model, pull), "pybullet": in_pybullet(folder / "urdf", pull)}
    for name, run in runs.items():
        result[name] = {"openings": _listed(run[0], samples), **differences(run, reference, found)}
    wrong = {
        name: differences(in_mujoco(damaged(folder / "mjcf", part, name), pull), reference, found) for name in WRONG
    }
    return result | {"wrong": {name: _worst(found) for name, found in wrong.items()}}


def differences(run: tuple[np.ndarray, np.ndarray], reference: np.ndarray, stage: SimStage) -> dict[str, float]:
    """Return how a run differs from the reference, as fractions of how far that came.

    Args:
        run: coordinate [m or rad] and place of the handle [m] after every step, shape [step] and [step 3].
        reference: coordinate after every step, shape [step]; the stage's joint says where the handle then is.
        stage: the part.
    """
    openings, points = run
    handle = stage.grasp[None, :3]
    places = np.concatenate([displace(handle, stage.joint, q) for q in reference])
    opened, moved = np.abs(reference).max(), np.linalg.norm(places - handle, axis=1).max()
    return {
        "opening_difference": float(np.abs(openings - reference).max() / opened),
        "end_difference": float(abs(openings[-1] - reference[-1]) / opened),
        "handle_difference": float(np.linalg.norm(points - places, axis=1).max() / moved),
    }


def damaged(folder: Path, part: str, damage: str) -> mujoco.MjModel:
    """Return the room in a folder with a part damaged by one of WRONG."""
    model = mujoco.MjModel.from_xml_path(str(folder / "room.xml"))
    WRONG[damage](model, model.joint(part).id)
    return model


def _worst(found: dict[str, float]) -> float:
    return max(found["opening_difference"], found["handle_difference"])


def _scale(mass: np.ndarray, inertia: np.ndarray, body: int) -> None:
    mass[body], inertia[body] = 1.1 * mass[body], 1.1 * inertia[body]


def _tilt(axis: np.ndarray) -> None:
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    axis[:] = Rotation.from_rotvec(np.radians(3.0) * across / np.linalg.norm(across)).apply(axis)


def _listed(openings: np.ndarray, samples: list[int]) -> list[float]:
    return [round(float(q), 5) for q in openings[samples]]


def _summary(rows: list[dict]) -> dict:
    """Return the largest differences, and in how many parts the goals are met."""
    found = {}
    for name, goal in GOALS.items():
        worst = [_worst(row[name]) for row in rows]
        met = sum(value <= goal for value in worst)
        found[name] = {"goal": goal, "met": met, "of": len(rows), "max": max(worst), "median": float(np.median(worst))}
    return found


def main() -> None:
    """Convert the rooms, open every part in every simulator, and write the result."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stages", nargs="+", type=Path)
    parser.add_argument("--parts", nargs="+")
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()
    settings = config.load(SimConfig, config.compose("convert")["sim"])
    origin = provenance("cpu")
    origin["versions"] |= {"mujoco": mujoco.__version__, "pybullet": version("pybullet")}
    rows = []
    for stage in args.stages:
        with tempfile.TemporaryDirectory() as folder:
            for to in ("mjcf", "urdf"):
                s2a.convert(stage, Path(folder) / to, to)
            for part in args.parts or sim_stage.read(stage, visuals=False).articulations:
                rows.append(row(stage, part, Path(folder), settings))
                print(_line(rows[-1]), flush=True)
    report = {"scans": "virtual", **origin, "seconds": SECONDS, "times": TIMES, **_summary(rows), "rows": rows}
    args.out.write_text(json.dumps(report, indent=1) + "\n")
    print(json.dumps(_summary(rows)))


def _line(row: dict) -> str:
    """Return a row of the table."""
    columns = [f"{100 * _worst(row[name]):7.3f} %" for name in GOALS]
    wrong = ", ".join(f"{name} {100 * value:.1f} %" for name, value in row["wrong"].items())
    return (
        f"{row['scan']} {row['part']:12} {row['force']:8.2f} N {row['newton'][-1]:7.4f} {' '.join(columns)}   {wrong}"
    )


if __name__ == "__main__":
    main()
