"""Resistance of parts that MuJoCo's joints do not have: dry friction that is greatest at rest, and a soft close."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
from collections.abc import Callable, Sequence
from typing import Any

import newton
import numpy as np
import warp as wp

from s2a.scene.articulation import lever_arm, opening_sign
from s2a.scene.usd.joints import SoftClose
from s2a.sim.world import SimStage, axis_of

# [m/s] From rest, where it is greatest, dry friction falls to that in motion: exp(-(v / STRIBECK)^2),
# v at the grasp point
STRIBECK = wp.constant(0.05)
EDGE = wp.constant(0.25)  # Fraction of a soft close's reach over which its force and damping set in
INDICES = ("world", "coord", "dof", "solver_dof")  # Of Resisting, what are integers
NONE = SoftClose(0.0, 0.0, 1.0)


@wp.func
def held(speed: float):
    """Return the fraction of breakaway that holds at a speed [m/s] of the grasp point."""
    slow = speed / STRIBECK
    return wp.exp(-slow * slow)


@wp.func
def engaged(opening: float, reach: float):
    """Return the fraction of a soft close that acts at an opening: 1 near shut, 0 beyond its reach."""
    return wp.clamp((reach - opening) / (EDGE * reach), 0.0, 1.0)


@wp.struct
class Resisting:
    """Joints of all worlds, each of shape [joint]; forces, damping and reach per unit of the coordinate."""

    world: wp.array(dtype=int)  # index of its world
    coord: wp.array(dtype=int)  # of its coordinate among all worlds'
    dof: wp.array(dtype=int)  # of its velocity likewise
    solver_dof: wp.array(dtype=int)  # of its velocity within a world, as MuJoCo counts
    sign: wp.array(dtype=float)  # 1 where it opens upwards
    lever: wp.array(dtype=float)  # path of the grasp point by the coordinate
    friction: wp.array(dtype=float)  # in motion
    breakaway: wp.array(dtype=float)  # how much more at rest
    damping: wp.array(dtype=float)  # everywhere
    force: wp.array(dtype=float)  # of the soft close
    closing: wp.array(dtype=float)  # its damping
    reach: wp.array(dtype=float)  # of the soft close


@wp.kernel
def resist(
    r: Resisting,
    joint_q: wp.array(dtype=float),
    joint_qd: wp.array(dtype=float),
    dof_friction: wp.array2d(dtype=float),
    dof_damping: wp.array2d(dtype=float),
    joint_f: wp.array(dtype=float),
):
    """Give the joints of a physics step their dry friction and damping, which the solver takes implicitly, and their force."""
    i = wp.tid()
    world, dof, sign = r.world[i], r.solver_dof[i], r.sign[i]
    speed, acts = sign * joint_qd[r.dof[i]], engaged(sign * joint_q[r.coord[i]], r.reach[i])
    dof_friction[world, dof] = r.friction[i] + r.breakaway[i] * held(speed * r.lever[i])
    dof_damping[world, dof] = r.damping[i] + wp.where(speed < 0.0, acts * r.closing[i], 0.0)
    joint_f[r.dof[i]] = -sign * acts * r.force[i]


def hooks(simulation: Any, worlds: Sequence[newton.ModelBuilder]) -> list[Callable[[], None]]:
    """Return what a simulation calls before every physics step: nothing where none of its stages has breakaway or a soft close.

    What is called owns the joint forces of the joints concerned.
    """
    places = [_joints(stage, world) for stage, world in zip(simulation.stages, worlds, strict=True)]
    if not any(places):
        return []
    model = simulation.solver.mjw_model
    r = _resisting(places, worlds, simulation.stage_of_env, simulation.solver)

    def before_substep() -> None:
        state, force = simulation.state, simulation.control.joint_f
        inputs = [r, state.joint_q, state.joint_qd, model.dof_frictionloss, model.dof_damping, force]
        wp.launch(resist, dim=r.world.shape[0], inputs=inputs, device=r.world.device)

    return [before_substep]


def _resisting(
    places: Sequence[list[tuple[dict[str, float], int, int]]],
    worlds: Sequence[newton.ModelBuilder],
    stage_of_env: np.ndarray,
    solver: newton.solvers.SolverMuJoCo,
) -> Any:
    """Return the joints of all worlds as a Resisting; `places` are those of each stage."""
    rows: list[dict[str, float]] = []
    to_newton = solver.mjc_dof_to_newton_dof.numpy()
    friction, damping = (x.numpy() for x in (solver.mjw_model.dof_frictionloss, solver.mjw_model.dof_damping))
    for env, stage in enumerate(stage_of_env):
        world = worlds[stage]
        for row, coord, own in places[stage]:
            dof = env * world.joint_dof_count + own
            solver_dof = int(np.flatnonzero(to_newton[env] == dof)[0])
            now = {"friction": friction[env, solver_dof], "damping": damping[env, solver_dof]}
            where = {"coord": env * world.joint_coord_count + coord, "dof": dof, "solver_dof": solver_dof}
            rows.append({**row, **now, **where, "world": env})
    r = Resisting()
    for name in rows[0]:
        setattr(r, name, wp.array([row[name] for row in rows], dtype=int if name in INDICES else float))
    return r


def _joints(stage: SimStage, world: newton.ModelBuilder) -> list[tuple[dict[str, float], int, int]]:
    """Return what a stage's active joints have of this, and their coordinate and velocity within a world."""
    rows = []
    for part in stage.active:
        joint = stage.room.articulations.get(part)
        if joint is None or joint.resistance is None:
            continue
        own, soft = joint.resistance, joint.resistance.soft_close or NONE
        if own.breakaway or soft is not NONE:
            lever = lever_arm(joint.joint, np.array(joint.grasp.point))
            row = {"sign": opening_sign(joint.joint), "lever": lever, "breakaway": own.breakaway}
            row |= {"force": soft.force, "closing": soft.damping, "reach": soft.reach}
            rows.append((row, *axis_of(world, part, joint.joint.kind)))
    return rows
