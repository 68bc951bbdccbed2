"""One part of a room, pulled by a force at its handle: in Newton and in MuJoCo."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from s2a.sim.simulation import Simulation
from s2a.sim.solver import SimConfig
from s2a.sim.world import SimStage, joint_index

SECONDS, RISE = 3.0, 0.5
"""[s] Length of a run, and until the force is full."""


@dataclass(frozen=True)
class Pull:
    """A part and how it is pulled.

    Attributes:
        stage: the part.
        config: how physics is stepped.
        force: full force [N], shape [3].
    """

    stage: SimStage
    config: SimConfig
    force: np.ndarray

    @property
    def steps(self) -> int:
        """Number of physics steps."""
        return round(SECONDS / self.config.dt)

    def at(self, step: int) -> np.ndarray:
        """Return the force in a physics step [N], shape [3]."""
        return min(1.0, step * self.config.dt / RISE) * self.force


def in_newton(pull: Pull) -> np.ndarray:
    """Return the joint's coordinate after every physics step [m or rad], shape [step]."""
    sim = Simulation(pull.stage, pull.config, 1, "cpu", with_robot=False)
    body = sim.body(pull.stage.target)
    center, handle = sim.model.body_com.numpy()[body], pull.stage.grasp[:3]
    found: list[float] = []

    def push() -> None:
        *position, x, y, z, w = sim.state.body_q.numpy()[body].astype(float)
        turn = Rotation.from_quat((x, y, z, w))
        force = pull.at(len(found))
        wrench = np.zeros((sim.model.body_count, 6), np.float32)
        wrench[body] = [*force, *np.cross(turn.apply(handle - center), force)]
        sim.state.body_f.assign(wrench)

    coordinate = sim.world.joint_q_start[joint_index(sim.world, pull.stage.target)]
    sim.before_substep.append(push)
    sim.after_substep.append(lambda: found.append(float(sim.state.joint_q.numpy()[coordinate])))
    while len(found) < pull.steps:
        sim.step()
    return np.array(found)


def in_mujoco(model: mujoco.MjModel, pull: Pull) -> tuple[np.ndarray, np.ndarray]:
    """Return the coordinate, and the handle's place [m], after every physics step, shape [step] and [step 3]."""
    part, data = pull.stage.target, mujoco.MjData(model)
    site, body = model.site(f"{part}_grasp").id, model.body(part).id
    address = model.jnt_qposadr[model.joint(part).id]
    found, handle = [], []
    for step in range(pull.steps):
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        data.qfrc_applied[:] = 0.0
        mujoco.mj_applyFT(model, data, pull.at(step), np.zeros(3), data.site_xpos[site], body, data.qfrc_applied)
        mujoco.mj_step(model, data)
        found.append(data.qpos[address])
        mujoco.mj_kinematics(model, data)
        handle.append(data.site_xpos[site].copy())
    return np.array(found), np.array(handle)
