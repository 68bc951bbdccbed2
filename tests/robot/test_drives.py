"""The robot's drives as sim=real has them: rotors are heavy, and what pushes a finger moves both, slowly."""

from __future__ import annotations

from dataclasses import replace

import newton
import numpy as np
import pytest
import warp as wp
from settings import load

from s2a import robot
from s2a.robot.model import add_robot
from s2a.sim.solver import SimConfig, make_solver
from s2a.sim.world import empty_world

PANDA = robot.load("panda")
DT = 1 / 240


def joint_motion(force: dict[int, float], steps: int, realistic: bool = True, uncontrolled: bool = False) -> np.ndarray:
    """Return coordinates and velocities [step 2 dof] of a Panda at rest whose joints are pushed; `uncontrolled`: no gains."""
    gains = replace(PANDA.gains, arm_stiffness=0.0, arm_damping=0.0) if uncontrolled else None
    builder = empty_world()
    add_robot(builder, PANDA, wp.transform(), gains=gains, realistic=realistic)
    fingers = slice(len(PANDA.arm_joints), len(PANDA.joints))
    builder.joint_q[fingers] = builder.joint_target_q[fingers] = [0.01, 0.01]
    with wp.ScopedDevice("cpu"):
        model = builder.finalize()
        solver, state, after, control = (
            make_solver(model, load(SimConfig, "sim/real")),
            model.state(),
            model.state(),
            model.control(),
        )
        newton.eval_fk(model, model.joint_q, model.joint_qd, state)
        push = np.zeros(model.joint_dof_count)
        push[list(force)] = list(force.values())
        control.joint_f.assign(push)
        motion = []
        for _ in range(steps):
            solver.step(state, after, control, None, DT)
            state, after = after, state
            motion.append((state.joint_q.numpy().copy(), state.joint_qd.numpy().copy()))
    return np.array(motion)


@pytest.mark.parametrize(
    ("force", "fastest"),
    # The drive damps each finger by its force over its speed: 70 N / 0.05 m/s = 1400 N s/m.
    [({7: 70.0, 8: 70.0}, 0.05), ({7: 56.0}, 0.02), ({8: 56.0}, 0.02)],
)
def test_pushed_as_hard_as_it_drives_a_finger_is_no_faster_than_it_drives(
    force: dict[int, float], fastest: float
) -> None:
    q, qd = np.moveaxis(joint_motion(force, 24), 1, 0)
    speed = np.abs(qd[:, 7:9].mean(axis=1))  # the coupling gives a little, by less than a millimetre
    assert 0.8 * fastest < speed.max() <= fastest
    assert np.abs(q[:, 7] - q[:, 8]).max() < 1e-3, "one motor drives both"
    q, qd = np.moveaxis(joint_motion(force, 24, realistic=False), 1, 0)
    assert np.abs(qd[:, 7:9]).max() > 10 * fastest


@pytest.mark.parametrize("joint", range(7))
def test_no_torque_accelerates_a_joint_more_than_its_rotor_allows(joint: int) -> None:
    # Whatever the links' inertia, what a joint's own torque accelerates is at least its rotor: an inertia matrix is positive.
    torque, rotor = 1.0, (0.606, 0.606, 0.462, 0.462, 0.206, 0.206, 0.206)[joint]
    _, qd = joint_motion({joint: torque}, 1, uncontrolled=True)[0]
    assert 0.0 < qd[joint] / DT < torque / rotor
    if joint == 6:  # of the gripper about its own axis there is little
        assert qd[joint] / DT > 0.8 * torque / rotor
