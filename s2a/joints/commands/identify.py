"""Command `s2a identify`: find mass, friction, damping and spring of a joint from recorded pulls."""

import json
import os
from dataclasses import dataclass
from pathlib import Path

from s2a.core.bounds import Positive
from s2a.core.errors import InputError
from s2a.core.outputs import Output, atomic_write
from s2a.core.provenance import provenance
from s2a.joints import dynamics, pull
from s2a.joints.dynamics import PARAMETERS, Dynamics
from s2a.joints.identify import fit, identify
from s2a.joints.pull import Noise, header, read
from s2a.joints.pulled import Moving, moving
from s2a.robot import Robot
from s2a.scene.usd import sim_stage
from s2a.scene.usd.joints import Resistance, SoftClose
from s2a.scene.usd.sim_read import refuse_unphysical
from s2a.sim.simulation import device_of
from s2a.sim.world import read_stage

UNITS = {"mass": "of the stage's mass", "damping": "N s/m", "friction": "N", "breakaway": "N more", "spring": "N/m"}
UNITS |= {"pull_in": "N, of a soft close", "closing": "N s/m, of a soft close"}


@dataclass(frozen=True)
class Config:
    """Keys of `s2a identify`.

    Attributes:
        stage: the sim.usd.
        part: id of the articulated part; null: the only one of the stage.
        pulls: CSV files: of a force gauge with the columns time [s], opening [m] (path of the grasp point) and force [N]
            (along it); or of the robot, with its joints and their torques, as `s2a evaluate recordings=...` writes them. Or
            folders of LeRobot datasets, whose features have these names; an episode is a recording.
        episodes: numbers of each dataset's episodes; none: all.
        robot: the robot of the recordings, such as panda or baxter; its base is where the stage has it.
        torques_carry_weight: Take the recorded torques as carrying the robot's own weight too.
        soft_close_reach: path of the grasp point from the closed pose over which a soft close acts, if the part has one and the
            stage does not state it [m].
        out: the layer to write over the stage, *.usda, which every command takes in its place.
        record: a JSON file for the numbers too, or null.
        noise: standard deviations of the recorded samples.
        device: cpu, cuda:0, or auto: a GPU where there is one.
    """

    stage: Path
    part: str | None
    pulls: tuple[Path, ...]
    episodes: tuple[int, ...]
    robot: Robot
    torques_carry_weight: bool
    soft_close_reach: Positive
    out: Output
    record: Output | None
    noise: Noise
    device: str


def run(config: Config) -> str:
    """Identify a joint, write it as a layer over its stage, and return it in words."""
    if not config.pulls:
        raise InputError("key 'pulls' is empty; give one recording or more: pulls=[a.csv,b.csv]")
    refuse_unphysical(config.stage)
    room = sim_stage.read(config.stage, visuals=False)
    part = room.part(config.part)
    body = moving(room, part, config.soft_close_reach)
    result = _identified(config, body, part)
    with atomic_write(config.out) as out:
        write_layer(config.stage, config.out, out, part, result, body)
    if config.record:
        with atomic_write(config.record) as out:
            out.write_text(json.dumps(_record(config, part, result), indent=1))
    lines = [
        f"  {name:10}{value:9.3g} +- {dev:.2g} {UNITS[name]}"
        if determined
        else f"  {name:10}    undetermined by these pulls"
        for name, value, dev, determined in _rows(result)
    ]
    lines.append(f"  misfit {result.misfit:.2f}; 1 where the recordings are as noisy as given, and explained")
    return "\n".join([f"{config.out}: joint of {part}, at its grasp point", *lines])


def _identified(config: Config, body: Moving, part: str) -> Dynamics:
    """Return the dynamics that recordings of a hand tell, or of the robot: those with a column of one of its joints."""
    spec = config.robot
    by_robot = [bool({*spec.joints} & {*header(path)}) for path in config.pulls]
    if not any(by_robot):
        pulls = [each for path in config.pulls for each in read(path, config.episodes)]
        (fitted,) = identify([body], [pulls], config.noise, device_of(config.device))
        return fitted
    if not all(by_robot):
        raise InputError(
            f"{config.pulls[by_robot.index(False)]} is no recording of {spec.name}'s joints, others are; give those of one kind"
        )
    base = read_stage(config.stage, part, robot=spec.name).base
    recordings = [each for path in config.pulls for each in pull.read_recordings(path, spec, config.episodes)]
    pulls = [pull.recorded_pull(each, spec, base, body, config.torques_carry_weight) for each in recordings]
    return fit(body, pulls, config.noise.force)


def write_layer(stage: Path, out: Path, file: Path, part: str, result: Dynamics, body: Moving) -> None:
    """Write what was found as a layer over a stage: to `file`, which will stand at `out`. What is undetermined stays."""
    value, lever = {name: x for name, x, _, determined in _rows(result) if determined}, abs(body.lever)
    below = os.path.relpath(stage.absolute(), out.absolute().parent)

    def at_joint(name: str, power: int) -> float | None:
        return value[name] * lever**power if name in value else None

    pull_in, closing = at_joint("pull_in", 1) or 0.0, at_joint("closing", 2) or 0.0
    resistance = Resistance(
        damping=at_joint("damping", 2),
        stiffness=at_joint("spring", 2),
        breakaway=at_joint("breakaway", 1) or 0.0,
        soft_close=SoftClose(pull_in, closing, body.reach / lever) if pull_in or closing else None,
    )
    mass = dynamics.scaled(body.mass, value["mass"]) if "mass" in value else None
    dynamics.write(below, part, mass, at_joint("friction", 1), resistance, file)


def _rows(result: Dynamics) -> list[tuple[str, float, float, bool]]:
    columns = (result.values.tolist(), result.deviations.tolist(), result.determined.tolist())
    return list(zip(PARAMETERS, *columns, strict=True))


def _record(config: Config, part: str, result: Dynamics) -> dict[str, object]:
    rows = {
        name: {"value": value, "deviation": dev, "unit": UNITS[name]}
        if determined
        else {"value": None, "unit": UNITS[name]}
        for name, value, dev, determined in _rows(result)
    }
    about = {"stage": config.stage.name, "part": part, "pulls": [path.name for path in config.pulls]}
    return {**about, "dynamics": rows, "misfit": result.misfit, **provenance(device_of(config.device))}
