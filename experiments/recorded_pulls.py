"""Pulls of a joint in plain MuJoCo, whose dry friction is a constraint: recordings whose truth is known."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from s2a.diff.moving_body import Moving
from s2a.diff.pull import Noise, Pull

STEP = 1.0 / 2000.0
"""[s] Of MuJoCo."""
RATE = 60.0
"""[Hz] Of the recording."""


@dataclass(frozen=True)
class Truth:
    """How a joint resists at its grasp point: factor of the stage's mass, [N s/m], [N], [N/m]."""

    mass: float
    damping: float
    friction: float
    spring: float


def record(body: Moving, truth: Truth, noise: Noise, seed: int, seconds: float = 2.5) -> Pull:
    """Record a hand, a spring of 400 N/m, that follows a random smooth path between closed and nearly open."""
    rng = np.random.default_rng(seed)
    model = mujoco.MjModel.from_xml_string(_xml(body, truth))
    data = mujoco.MjData(model)
    lever, reach = body.lever, 0.9 * abs(body.lever) * max(map(abs, body.joint.limits))
    path = _path(rng, seconds, min(reach, 0.4))
    opening, force = [], []
    every = round(1.0 / RATE / STEP)
    for i, goal in enumerate(path):
        s, v = data.qpos[0] * lever, data.qvel[0] * lever
        pulled = 400.0 * (goal - s) - 40.0 * v
        if i % every == 0:
            opening.append(s)
            force.append(pulled)
        data.qfrc_applied[0] = pulled * lever
        mujoco.mj_step(model, data)
    count = len(opening)
    return Pull(
        np.array(opening) + rng.normal(0.0, noise.opening, count),
        np.array(force) + rng.normal(0.0, noise.force, count),
        every * STEP,
    )


def _path(rng: np.random.Generator, seconds: float, reach: float) -> np.ndarray:
    """Return goals of the hand [m] at every step: smooth between a few random openings, at rest at first."""
    count = round(seconds / STEP)
    knots = np.concatenate([[0.0, 0.0], rng.uniform(0.1, 1.0, 4) * reach])
    times = np.concatenate([[0.0, 0.2], 0.2 + np.cumsum(rng.uniform(0.5, 1.5, 4))])
    times[2:] *= seconds / times[-1]
    at = np.arange(count) * STEP
    index = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(knots) - 2)
    part = np.clip((at - times[index]) / (times[index + 1] - times[index]), 0.0, 1.0)
    eased = 3 * part**2 - 2 * part**3
    return knots[index] + eased * (knots[index + 1] - knots[index])


def _xml(body: Moving, truth: Truth) -> str:
    """Return MJCF of one body on its joint, without limits."""
    joint, mass, lever = body.joint, body.mass, body.lever
    kind = "slide" if joint.kind == "prismatic" else "hinge"
    numbers = {
        "pos": np.array(joint.origin),
        "axis": np.array(joint.axis),
        "center": np.array(mass.center),
        "axes": np.array([mass.axes[3], *mass.axes[:3]]),
        "inertia": truth.mass * np.array(mass.inertia),
    }
    text = {name: " ".join(f"{x:.9g}" for x in value) for name, value in numbers.items()}
    return f"""<mujoco><option timestep="{STEP}" integrator="implicitfast"/><compiler angle="radian"/><worldbody><body>
      <inertial mass="{truth.mass * mass.mass:.9g}" pos="{text["center"]}" quat="{text["axes"]}" diaginertia="{text["inertia"]}"/>
      <joint type="{kind}" axis="{text["axis"]}" pos="{text["pos"]}" damping="{truth.damping * lever**2:.9g}"
        frictionloss="{truth.friction * abs(lever):.9g}" stiffness="{truth.spring * lever**2:.9g}"
        solreffriction="0.002 1" solimpfriction="0.99 0.999 0.0001 0.5 2"/>
    </body></worldbody></mujoco>"""
