"""The World struct of bound worlds, from their stages and a task's settings."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from s2a.scene.articulation import opening_sign
from s2a.sim.contacts import ContactSensor
from s2a.sim.simulation import Simulation
from s2a.sim.world import SimStage
from s2a.tasks.state import CARRIED, GRASPED, OPENED, Numbers, TaskTarget, World


def bind(sim: Simulation, sensor: ContactSensor, config: Any, metrics: Any, own: int) -> World:
    """Return the struct of worlds with their robot, target and settings; a place is the task's to set.

    `config`: the task's settings; those that are called as fields of Numbers are in `World.number`.
    """
    w, n, layout = World(), sim.num_envs, sim.layout
    w.tool_link, (w.left, w.right), w.body = layout.tool_body, layout.finger_bodies, layout.part_body
    shift = getattr(config, "tcp_offset", (0.0, 0.0, 0.0))
    w.tool = wp.transform(wp.vec3(*np.add(sim.robot.tool_offset, shift)), wp.quat_identity())
    wide = sim.robot.gripper.max_opening
    targets = [
        _target(sim.stages[i], wide, *at) for i, *at in zip(sim.stage_of_env, sim.part_coord, sim.part_dof, strict=True)
    ]
    w.target, w.contacts = wp.array(targets, dtype=TaskTarget), sensor.found
    w.number = _numbers(sim, config, metrics)
    free = any(each.free for each in targets)
    _bind_part(w, sim, 0 if free else n)
    _bind_object(w, n if free else 0)
    w.own = wp.zeros((n if own else 0, own), dtype=float)
    return w


def _bind_part(w: World, sim: Simulation, rows: int) -> None:
    """Set what belongs to parts on joints, of so many worlds."""
    w.region_force = wp.zeros((rows, 2), dtype=float)
    w.opened = wp.zeros((rows, len(OPENED)), dtype=float)
    w.grasped = wp.zeros((rows, len(GRASPED)), dtype=float)
    w.seen = wp.array([wp.transform_identity()] * rows, dtype=wp.transform)
    w.resistance = wp.array(_resistance(sim) if rows else np.zeros((0, 3)), dtype=wp.vec3)


def _bind_object(w: World, rows: int) -> None:
    """Set what belongs to free objects, of so many worlds."""
    w.carried = wp.zeros((rows, len(CARRIED)), dtype=float)
    w.last, w.released = wp.zeros((rows, 2), dtype=wp.vec3), wp.zeros((rows, 2), dtype=wp.vec3)
    w.rested = wp.zeros(rows, dtype=wp.transform)


def _numbers(sim: Simulation, config: Any, metrics: Any) -> Numbers:
    """Return the settings that have a field of their name, and those that are computed from them."""
    number = Numbers()
    number.control_step, number.close_distance = sim.config.control_dt, -1.0
    for name in Numbers.vars:  # type: ignore[attr-defined]
        for settings in (config, metrics):
            if isinstance(value := getattr(settings, name, None), (int, float)) and not (
                settings is metrics and hasattr(config, name)
            ):
                setattr(number, name, value)
    number.counted_force = getattr(metrics, "contact_force", number.contact_force)
    number.firm = float(np.cos(np.deg2rad(getattr(config, "firm_angle", 120.0))))
    number.bonus = wp.vec3(*getattr(config, "bonus_openings", (0.0, 0.0, 0.0)))
    return number


def travel_scale(sim: Simulation, full_travel: float) -> np.ndarray:
    """Return the factor of all openings, below 1 where a part travels less than `full_travel` [m], shape [world]."""
    return np.minimum(1.0, np.array([sim.stages[i].travel for i in sim.stage_of_env]) / full_travel)


def watch_others(w: World, sim: Simulation, moves: Sequence[int]) -> None:
    """Set the bodies that must not move: all but the robot's, the target and `moves`."""
    mine = {*sim.layout.robot_bodies, w.body, *moves}
    others = [i for i in range(sim.model.body_count // sim.num_envs) if i not in mine]
    w.others = wp.array(others, dtype=int)
    w.origin = wp.zeros((sim.num_envs, max(1, len(others))), dtype=wp.vec3)


def _target(stage: SimStage, max_opening: float, coord: int, dof: int) -> TaskTarget:
    t, joint = TaskTarget(), stage.joint
    t.free = int(stage.target in stage.room.free)
    t.coord, t.dof = coord, dof
    t.base = wp.quat(*stage.base[3:])
    t.size = wp.vec3(*stage.grasp_size)
    if t.free:
        t.grasp, t.lever_arm, t.pinchable = wp.transform_identity(), 1.0, 1
        return t
    t.grasp = wp.transform(*stage.grasp[:3], *stage.grasp[3:])
    t.lever_arm, t.travel = opening_sign(joint) * stage.lever_arm, stage.travel
    t.axis, t.origin, t.slides = wp.vec3(*joint.axis), wp.vec3(*joint.origin), int(joint.kind == "prismatic")
    t.pinchable = int(stage.internal or stage.grasp_size[1] < max_opening)
    return t


def _resistance(sim: Simulation) -> np.ndarray:
    """Return dry friction and damping of each world's part, and the logarithm of its mass, shape [world 3]."""
    model, worlds = sim.model, np.arange(sim.num_envs)
    of_dof = [each.numpy().reshape(sim.num_envs, -1) for each in (model.joint_friction, model.joint_target_kd)]
    mass = model.body_mass.numpy().reshape(sim.num_envs, -1)[:, sim.layout.part_body]
    return np.stack([*(each[worlds, sim.part_dof] for each in of_dof), np.log(mass)], axis=1)
