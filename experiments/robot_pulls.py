"""Pulls of a part by the simulated robot, told by its joints and their torques alone: recordings whose truth is known."""

from __future__ import annotations

import sys
import tempfile
from dataclasses import astuple
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
from recorded_pulls import Truth

from s2a import robot
from s2a.commands import cli
from s2a.core.errors import InputError
from s2a.joints import pull
from s2a.joints.commands.identify import write_layer
from s2a.joints.dynamics import PARAMETERS, Dynamics
from s2a.joints.pull import Pull
from s2a.joints.pulled import Moving
from s2a.sim.world import read_stage

POSITION_NOISE, TORQUE_NOISE = 1e-4, 0.1
"""[rad], [N m] Of every sample, beyond what sensors of a torque-controlled arm have."""
PULL_TIMES = (1.2, 1.8, 2.4, 3.0)
"""[s] Of the planner; a limit of the robot may extend them."""


def record(stage: Path, part: str, body: Moving, truth: Truth, seed: int) -> list[Pull]:
    """Let the planner open a part of these dynamics at different speeds; none where it cannot."""
    spec, rng = robot.load("panda"), np.random.default_rng(seed)
    base = read_stage(stage, part).base
    with tempfile.TemporaryDirectory() as folder:
        layer = Path(folder) / "true.usda"
        known = Dynamics(np.array(astuple(truth)), np.zeros(len(PARAMETERS)), 1.0)
        write_layer(stage, layer, layer, part, known, body)
        pulls = []
        for seconds in PULL_TIMES:
            keys = [f"stage={layer}", f"part={part}", "num_envs=1", "device=cpu", f"planner.pull_time={seconds}"]
            if cli.main(["evaluate", *keys, f"recordings={folder}", f"out={folder}/metrics.json"]):
                return []
            found = pull.read_recordings(Path(folder) / "pull_0.csv", spec)
            noisy = pull.Recording(
                found.q + rng.normal(0.0, POSITION_NOISE, found.q.shape),
                found.torque + rng.normal(0.0, TORQUE_NOISE, found.torque.shape),
                found.step,
            )
            try:
                pulls.append(pull.recorded_pull(noisy, spec, base, body, gravity=False))
            except InputError:  # the grip slipped off
                return []
    return pulls
