"""Pulls of a joint in plain MuJoCo, whose dry friction is a constraint: recordings whose truth is known."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from s2a.joints.pull import Noise, Pull
from s2a.joints.pulled import Moving

STEP = 1.0 / 2000.0
"""[s] Of MuJoCo."""
RATE = 60.0
"""[Hz] Of the recording."""
HAND = (400.0, 40.0)
"""[N/m], [N s/m]"""
STRIBECK, EDGE = 0.05, 0.25
"""[m/s], [1] Of the law that s2a.sim.solver has too."""


@dataclass(frozen=True)
class Truth:
    """How a joint resists at its grasp point: `s2a.joints.dynamics.PARAMETERS`, in their order."""

    mass: float
    damping: float
    friction: float
    breakaway: float = 0.0
    spring: float = 0.0
    pull_in: float = 0.0
    closing: float = 0.0


def record(
    body: Moving, truth: Truth, noise: Noise, seed: int, seconds: float = 2.5, shut: float | None = None
) -> Pull:
    """Record a hand, a spring of 400 N/m, that follows a random smooth path between closed and nearly open.

    Args:
        body: what is pulled.
        truth: how it resists.
        noise: of the samples.
        seed: of path and noise.
        seconds: how long.
        shut: opening at which it begins and to which the hand comes back every other time [m]; None: it begins closed.
    """
    rng = np.random.default_rng(seed)
    model = mujoco.MjModel.from_xml_string(_xml(body, truth))
    data = mujoco.MjData(model)
    lever, reach = body.lever, 0.9 * abs(body.lever) * max(map(abs, body.joint.limits))
    path = hand_path(rng, seconds, min(reach, 0.4), shut)
    data.qpos[0] = (shut or 0.0) / lever
    opening, force = [], []
    every = round(1.0 / RATE / STEP)
    for i, goal in enumerate(path):
        s, v = data.qpos[0] * lever, data.qvel[0] * lever
        pulled = HAND[0] * (goal - s) - HAND[1] * v
        if i % every == 0:
            opening.append(s)
            force.append(pulled)
        acts = float(np.clip((body.reach - s) / (EDGE * body.reach), 0.0, 1.0))
        model.dof_frictionloss[0] = abs(lever) * (truth.friction + truth.breakaway * np.exp(-((v / STRIBECK) ** 2)))
        model.dof_damping[0] = lever**2 * (truth.damping + (truth.closing * acts if v < 0.0 else 0.0))
        data.qfrc_applied[0] = (pulled - truth.pull_in * acts) * lever
        mujoco.mj_step(model, data)
    count = len(opening)
    return Pull(
        np.array(opening) + rng.normal(0.0, noise.opening, count),
        np.array(force) + rng.normal(0.0, noise.force, count),
        every * STEP,
    )


def hand_path(rng: np.random.Generator, seconds: float, reach: float, shut: float | None) -> np.ndarray:
    """Return goals of the hand [m] at every step: smooth between a few random openings, at rest at first; see `record`."""
    count = round(seconds / STEP)
    knots = np.concatenate([[0.0, 0.0], rng.uniform(0.1, 1.0, 4) * reach])
    if shut is not None:
        knots[[0, 1, 3, 5]] = shut
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
