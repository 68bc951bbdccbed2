"""A soft body and an arm in one world: units and mass; a gripper that holds a cube by friction alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from soft_cube import cube_asset

from s2a import robot
from s2a.core.errors import InputError
from s2a.robot.kinematics import kinematics
from s2a.sim.soft import RATE, SoftSimulation, _world
from s2a.sim.soft_body import SoftBody, SoftConfig, SoftShape, _box, soft_body

PANDA = robot.load("panda")
CONFIG = SoftConfig()
BASE = np.array([0, 0, 0, 0, 0, 0, 1.0])
FLOOR = _box(np.array([0.3, -0.2, -0.1]), np.array([0.7, 0.2, 0.0]))
SIDE, AT = 0.05, np.array([0.5, 0.0, 0.025 + CONFIG.particle_radius, 0, 0, 0, 1.0])


@pytest.fixture(scope="module")
def cube(tmp_path_factory: pytest.TempPathFactory) -> SoftBody:
    """Of 5 cm, three cells wide."""
    return soft_body(SoftShape(SIDE, 3, 0.5), cube_asset(tmp_path_factory.mktemp("cube")))


def test_the_model_has_the_body_s_mass_and_pose(cube: SoftBody) -> None:
    builder = _world(cube, AT, PANDA, BASE, np.array(PANDA.start), [FLOOR], CONFIG)
    masses, points = np.array(builder.particle_mass), np.array([list(p) for p in builder.particle_q])
    assert masses.sum() == pytest.approx(CONFIG.density * SIDE**3, rel=1e-4)
    np.testing.assert_allclose(masses @ points / masses.sum(), AT[:3], atol=1e-4)
    np.testing.assert_allclose(np.ptp(points, axis=0), SIDE, rtol=1e-5)


def test_nothing_fixes_the_body(cube: SoftBody) -> None:
    """Every vertex has a mass and may move, and no joint is there but the robot's."""
    builder = _world(cube, AT, PANDA, BASE, np.array(PANDA.start), [FLOOR], CONFIG)
    alone = _world(cube, AT, PANDA, BASE, np.array(PANDA.start), [], CONFIG)
    assert min(builder.particle_mass) > 0.0
    assert builder.joint_count == alone.joint_count
    assert all("panda" in label for label in builder.body_label)
    assert builder.spring_count == 0


def test_an_odd_number_of_substeps_is_an_error(cube: SoftBody) -> None:
    with pytest.raises(InputError, match="'soft.substeps' is 3; a captured step needs an even number"):
        SoftSimulation(cube, AT, PANDA, BASE, np.array(PANDA.start), [], replace(CONFIG, substeps=3))


@pytest.mark.slow
@pytest.mark.parametrize("friction", [1.0, 0.0])
def test_a_gripper_lifts_a_cube_by_friction_alone(cube: SoftBody, friction: float) -> None:
    down = _above(0.12)
    path = [_above(z, down) for z in np.linspace(0.12, 0.03, 10)]
    first = np.array([*down, 0.04, 0.04])
    sim = SoftSimulation(cube, AT, PANDA, BASE, first, [FLOOR], replace(CONFIG, friction=friction))
    before = sim.joints, sim.particles, sim.torques
    _go(sim, path, 0.04, 60)
    assert all((now != then).any() for now, then in zip((sim.joints, sim.particles, sim.torques), before, strict=True))
    _go(sim, path[-1:], 0.04, 40)
    _go(sim, path[-1:], 0.0, 60)
    left, right = sim.finger_forces
    if friction:  # without, a soft cube is squeezed out of the gripper already here
        assert np.linalg.norm(left) > 5.0
        assert left @ right < 0.0
    _go(sim, path[::-1], 0.0, 60)
    _go(sim, path[:1], 0.0, 120)
    raised = sim.center[2] - AT[2]
    if friction:
        assert raised == pytest.approx(0.09, abs=0.02)
    else:  # squeezed out, it slides off the slab
        assert raised < 0.02


def _above(z: float, near: np.ndarray | None = None) -> np.ndarray:
    """Return the arm's joints with the tool at a height, pointing down over the cube, its fingers to both sides."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = np.diag([1.0, -1.0, -1.0]), [0.5, 0.0, z]
    start = np.array([0, 0.2, 0, -2.2, 0, 2.4, 0.785]) if near is None else near
    q, left = kinematics(PANDA).solve(pose[None], start[None], 60, 1e-2)
    assert left[0] < 1e-3
    return q[0]


def _go(sim: SoftSimulation, path: list[np.ndarray], finger: float, steps: int) -> None:
    """Follow arm joints in a number of control steps (of 1/RATE s), the fingers' target being the same."""
    assert RATE == 60
    at = np.linspace(0, len(path) - 1, steps)
    arm = np.stack([np.interp(at, np.arange(len(path)), joint) for joint in np.array(path).T], axis=1)
    for each in arm:
        sim.step(np.array([*each, finger, finger]))
