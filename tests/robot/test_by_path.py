"""A robot by path: docs/examples' YAML files, and a small MJCF and URDF with fingers on hinges."""

from __future__ import annotations

import math
import os
from pathlib import Path

import newton
import numpy as np
import pytest
import warp as wp
from omegaconf import OmegaConf

from s2a import robot
from s2a.commands.evaluate import Config
from s2a.core import config
from s2a.core.errors import InputError
from s2a.robot import urdf
from s2a.robot.collision import hulls, robot_shape
from s2a.robot.kinematics import kinematics
from s2a.robot.model import add_robot
from s2a.robot.spec import RobotSpec
from s2a.sim.world import empty_world

EXAMPLES = Path(__file__).parents[2] / "docs/examples"
CLOSED = math.asin(0.6)
"""The bars, 50 mm long and 40 mm off the middle, carry pads whose inner faces are 10 mm nearer: 0.03 = 0.05 sin q."""

FINGER = """
<body name="{side}_bar" pos="0 {y} 0.1"{turn}>
  <joint name="{side}_bar" axis="1 0 0" range="0 0.7"/>
  <geom type="capsule" size="0.004" fromto="0 0 0 0 0 0.05" mass="0.02"/>
  <body name="{side}_pad" pos="0 0 0.05">
    <joint name="{side}_pad" axis="1 0 0" range="-1 1"/>
    <geom type="box" size="0.01 0.005 0.02" pos="0 -0.005 0.02" mass="0.02"/>
  </body>
</body>
<body name="{side}_outer" pos="0 {outer} 0.1"{turn}>
  <joint name="{side}_outer" axis="1 0 0" range="-1 1"/>
  <geom type="capsule" size="0.004" fromto="0 0 0 0 0 0.05" mass="0.02"/>
</body>"""
MJCF = f"""
<mujoco>
  <compiler angle="radian" autolimits="true"/>
  <default><geom friction="0.5"/></default>
  <worldbody>
    <body name="foot">
      <geom type="cylinder" size="0.05 0.05"/>
      <body name="upper" pos="0 0 0.1">
        <joint name="turn" axis="0 0 1" range="-3 3"/>
        <geom type="sphere" size="0.05"/>
        <body name="palm" pos="0.2 0 0.1">
          <joint name="lift" axis="0 1 0" pos="-0.2 0 0" range="-2 2"/>
          <geom type="box" size="0.03 0.05 0.03"/>
          {FINGER.format(side="left", y=0.04, outer=0.06, turn="")}
          {FINGER.format(side="right", y=-0.04, outer=-0.06, turn=' quat="0 0 0 1"')}
        </body>
      </body>
    </body>
  </worldbody>
  <equality>
    <connect body1="left_outer" body2="left_pad" anchor="0 0 0.05"/>
    <connect body1="right_outer" body2="right_pad" anchor="0 0 0.05"/>
  </equality>
  <actuator><position joint="left_bar" kp="1"/><position joint="right_bar" kp="1"/></actuator>
</mujoco>"""


def written(folder: Path, name: str, **changes: object) -> Path:
    """Write the small robot's YAML, its values the Panda's where they do not matter."""
    values = config.read(Path(robot.__file__).parent / "panda" / robot.FILE)
    values |= {"model": "arm.xml", "root_link": "foot", "arm_joints": ["turn", "lift"], "home": [0.0, 0.5]}
    values["gripper"] |= {
        "joints": ["left_bar", "right_bar"],
        "links": ["left_pad", "right_pad"],
        "body": "palm",
        "closed": [CLOSED, CLOSED],
        "finger_joint_open": CLOSED,
        "finger_joint_home": 0.5,
        "max_opening": 0.06,
        "finger_speed": 1.0,
    }
    values["tool_offset"] = [0.0, 0.0, 0.16]
    values["drives"] = {"rotor_inertia": [0.1, 0.1], "finger_mass": 0.01}
    values["limits"] = {key: [10.0, 10.0] for key in ("velocity", "acceleration", "torque")}
    values["gains"] |= {"finger_stiffness": 20.0, "finger_damping": 1.0, "finger_effort": 4.0}
    path = folder / f"{name}.yaml"
    OmegaConf.save(values | changes, path)
    (folder / "arm.xml").write_text(MJCF)
    return path


@pytest.fixture
def linkage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> RobotSpec:
    monkeypatch.setenv(robot.FILES, "")
    return robot.load(str(written(tmp_path, "linkage")))


def test_a_command_takes_a_robot_by_its_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(robot.FILES, "")
    path = written(tmp_path, "mine")
    values = config.compose("evaluate", [f"robot={path}", "stage=x", "out=y"])
    spec = config.load(Config, values).robot
    assert spec.name == "mine" and Path(spec.model) == tmp_path / "arm.xml"
    assert robot.load("mine") == spec and "mine" in robot.names()


def test_the_joints_of_a_parallelogram_follow_its_bars(linkage: RobotSpec) -> None:
    tree = urdf.arm(linkage)
    followers = {
        joint.get("name"): joint.find("mimic") for joint in tree.findall("joint") if joint.find("mimic") is not None
    }
    assert set(followers) == {"left_pad", "left_outer", "right_pad", "right_outer"}
    for name, mimic in followers.items():
        side, part = name.split("_")
        assert mimic.get("joint") == f"{side}_bar"
        # A pad turns back by as much as its bar turns, the outer bar along with it; opening is the file's negative sense.
        assert float(mimic.get("multiplier")) == pytest.approx(1.0 if part == "pad" else -1.0, abs=0.01)


def test_the_open_pads_are_as_far_apart_as_by_hand(linkage: RobotSpec) -> None:
    kin = kinematics(linkage)
    q = np.zeros((1, 2))
    poses, tool = kin.frames(q)[0], kin.tool(q)[0]
    (left,), (right,) = (hulls(linkage)[link] for link in linkage.gripper.links)
    inner = []
    for link, hull in zip(linkage.gripper.links, (left, right), strict=True):
        pose = np.linalg.inv(tool) @ poses[kin.links.index(link)]
        points = hull.vertices @ pose[:3, :3].T + pose[:3, 3]
        inner.append(np.abs(points[:, 1]).min())
        assert points[:, 2].max() == pytest.approx(0.1 + 0.05 + 0.04 - 0.16, abs=5e-4)
    assert sum(inner) == pytest.approx(0.06, abs=5e-4)
    assert linkage.gripper.coordinate(0.06) == pytest.approx(CLOSED) and linkage.gripper.coordinate(-1.0) == 0.0


def test_the_pads_stay_parallel_while_they_close(linkage: RobotSpec) -> None:
    builder = empty_world()
    add_robot(builder, linkage, wp.transform(), realistic=True)
    assert [label.split("/")[-1] for label in builder.joint_label if "bar" in label] == ["left_bar", "right_bar"]
    with wp.ScopedDevice("cpu"):
        model = builder.finalize()
        solver = newton.solvers.SolverMuJoCo(model, use_mujoco_cpu=True)
        now, then, control = model.state(), model.state(), model.control()
        newton.eval_fk(model, model.joint_q, model.joint_qd, now)
        targets = control.joint_target_q.numpy()
        targets[2:4] = 0.1
        control.joint_target_q.assign(targets)
        for _ in range(1000):
            now.clear_forces()
            solver.step(now, then, control, None, 0.002)
            now, then = then, now
        q = now.joint_q.numpy()
    assert q[2:4] == pytest.approx(0.1, abs=0.01)
    assert np.abs(q[4:]) == pytest.approx(0.1, abs=0.015)
    names = [label.split("/")[-1] for label in model.body_label]
    palm, *pads = (now.body_q.numpy()[names.index(link)] for link in ("palm", "left_pad", "right_pad"))
    for pad in pads:
        turned = wp.quat_inverse(wp.quat(*palm[3:])) * wp.quat(*pad[3:])
        tilt = 2.0 * math.asin(min(1.0, math.hypot(turned[0], turned[1])))
        assert tilt < 0.02


@pytest.mark.slow
def test_its_spheres_cover_its_links(linkage: RobotSpec) -> None:
    shape = robot_shape(linkage)
    assert set(shape.fingers.nonzero()[0]) < set(shape.held.nonzero()[0])
    for link, solids in hulls(linkage).items():
        pose = shape.kin.frames(np.zeros((1, 2)))[0, shape.kin.links.index(link)]
        centers = shape.centers(np.zeros((1, 2)))[0]
        for solid in solids:
            points = solid.sample(500, seed=1) @ pose[:3, :3].T + pose[:3, 3]
            away = np.linalg.norm(points[:, None] - centers, axis=2) - shape.radii
            assert (away.min(axis=1) < 1e-3).mean() > 0.95


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"model": "gone.xml"}, "gone.xml: no such file"),
        ({"arm_joints": ["turn", "raise"]}, "has no joint raise"),
        ({"root_link": "base"}, "has no link base"),
        ({"fixed_joints": [["torso", 0.1]]}, "has no joint torso"),
    ],
)
def test_a_wrong_robot_is_one_line(
    changes: dict[str, object], problem: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(robot.FILES, "")
    spec = robot.load(str(written(tmp_path, "wrong", **changes)))
    with pytest.raises(InputError, match=problem) as error:
        urdf.arm(spec)
    assert "\n" not in str(error.value)


def test_missing_fingers_meshes_and_files_are_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(robot.FILES, "")
    with pytest.raises(InputError, match=r"none.yaml: no such file; robot= takes"):
        robot.load(str(tmp_path / "none.yaml"))
    path = written(tmp_path, "fingerless")
    values = OmegaConf.load(path)
    values.gripper.links = ["left_pad", "thumb"]
    OmegaConf.save(values, path)
    with pytest.raises(InputError, match="has no link thumb"):
        urdf.arm(robot.load(str(path)))
    (tmp_path / "bare.urdf").write_text(
        '<robot name="r"><link name="foot"><collision><geometry><mesh filename="package://r/foot.stl"/></geometry></collision>'
        "</link></robot>"
    )
    with pytest.raises(InputError, match=r"collision mesh package://r/foot.stl: no such file"):
        urdf.arm(robot.load(str(written(tmp_path, "bare", model="bare.urdf"))))
    (tmp_path / "panda.yaml").write_text("model: arm.xml")
    with pytest.raises(InputError, match="there is a robot 'panda' already"):
        robot.load(str(tmp_path / "panda.yaml"))


@pytest.mark.parametrize(("name", "variable"), [("ur5e_2f85", "MENAGERIE"), ("fetch", "FETCH_ROS")])
def test_the_kinematics_of_the_examples_are_those_of_the_simulated_robot(
    name: str, variable: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the robots' own files are: they are not part of this package."""
    if not os.environ.get(variable):
        pytest.skip(f"{variable} names no folder")
    monkeypatch.setenv(robot.FILES, "")
    spec = robot.load(str(EXAMPLES / f"{name}.yaml"))
    kin, builder = kinematics(spec), newton.ModelBuilder()
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    add_robot(builder, spec, wp.transform())
    model = builder.finalize(device="cpu")
    names = [label.split("/")[-1] for label in model.body_label]
    rows, state, q = [names.index(link) for link in kin.links], model.state(), model.joint_q.numpy()
    opened, home = spec.gripper.finger_joint_open, spec.gripper.finger_joint_home
    q[len(spec.arm_joints) :] *= opened / home
    newton.eval_fk(model, wp.array(q, dtype=float), model.joint_qd, state)
    poses = kin.frames(np.array([spec.home]))[0]
    assert poses[:, :3, 3] == pytest.approx(state.body_q.numpy()[rows, :3], abs=1e-5)
