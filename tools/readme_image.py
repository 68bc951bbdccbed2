"""Compose docs/office.png: the scanned room from above, and the robot with the drawer it has opened.

    python tools/readme_image.py demo docs/office.png

The first argument is the folder that `make demo` fills; it is read for `scan` and `room.usd`.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import newton
import numpy as np
import warp as wp
from room_images import above, folder_and_image
from scipy.spatial.transform import Rotation

from s2a import robot
from s2a.commands.evaluate import Config
from s2a.core import config
from s2a.learn.evaluate import evaluate
from s2a.motion.policy import Planner
from s2a.robot.model import add_robot
from s2a.robot.spec import RobotSpec
from s2a.scan.visuals import visible
from s2a.scene.geometry.camera import OrbitCamera, framing_pose, render, write_png
from s2a.scene.geometry.mesh_ops import painted
from s2a.scene.scene import Mesh
from s2a.sim.simulation import Simulation, device_of
from s2a.sim.world import SimStage, read_stage
from s2a.tasks import make_env

SIZE = {"width": 576, "height": 432, "samples": 3}
ROOM = {**SIZE, "elevation": 0.8, "margin": 1.02}
ROBOT = {**SIZE, "azimuth": 0.95, "elevation": 0.5, "margin": 1.12}
GAP = 16
"""White between the two [pixel]."""
PAINT = 0.85
"""Of the links' colours, which are white as paper, so that their shading shows."""


def main(demo: Path, out: Path) -> None:
    """Render both halves side by side."""
    settings = config.load(
        Config, config.compose("evaluate", [f"stage={demo / 'room.usd'}", "part=drawer_7", "out=-", "num_envs=1"])
    )
    camera = config.load(OrbitCamera, config.compose("view")["camera"])
    halves = [above(visible(demo / "scan"), replace(camera, **ROOM)), _robot(settings, replace(camera, **ROBOT))]
    white = np.full((SIZE["height"], GAP, 3), 255, dtype=np.uint8)
    out.parent.mkdir(parents=True, exist_ok=True)
    write_png(np.concatenate([halves[0], white, halves[1]], axis=1), out)
    print(f"{out}: {out.stat().st_size / 1000:.0f} kB")


def _robot(settings: Config, camera: OrbitCamera) -> np.ndarray:
    """Render the planner's robot where the part stands open widest."""
    poses, stage = _widest(settings)
    surfaces = dict(visible(settings.stage).surfaces)
    room = surfaces.pop("static")
    posed = [_moved(mesh, poses[name]) for name, mesh in surfaces.items()]
    posed += [_moved(mesh, poses[name]) for name, mesh in _links(robot.load(stage.robot))]
    points = np.concatenate([mesh.vertices for mesh in posed])
    out_of_furniture = -Rotation.from_quat(stage.grasp[3:]).as_matrix()[:, 2]
    return render([room, *posed], framing_pose(points, out_of_furniture, camera), camera)


def _widest(settings: Config) -> tuple[dict[str, np.ndarray], SimStage]:
    """Let the planner open the part; return the pose [7] of every body by name at the widest opening."""
    stage = read_stage(settings.stage, settings.part, robot=settings.robot.name)
    sim = Simulation(stage, settings.sim, settings.num_envs, device_of(settings.device))
    env = make_env(sim, settings.task, settings.metrics, {}, settings.seed)
    seen = [(-1.0, sim.body_q[0])]

    def watch() -> None:
        opening = abs(float(sim.joint_q[0, sim.layout.part_coord]))
        if opening > seen[0][0]:
            seen[0] = opening, sim.body_q[0].clone()

    evaluate(env, Planner(env, settings.planner), watch)
    names = [label.split("/")[-1] for label in sim.world.body_label]
    return dict(zip(names, seen[0][1].cpu().numpy(), strict=True)), sim.stage


def _links(spec: RobotSpec) -> list[tuple[str, Mesh]]:
    """Return the visible surfaces of the robot's links with the names of their bodies, in the bodies' frames."""
    builder = newton.ModelBuilder()
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    add_robot(builder, spec, wp.transform(), visuals=True)
    found = []
    for i in range(builder.shape_count):
        shape, collides = builder.shape_source[i], builder.shape_flags[i] & newton.ShapeFlags.COLLIDE_SHAPES
        if builder.shape_type[i] == newton.GeoType.MESH and not collides:
            mesh = Mesh(
                np.array(shape.vertices) * np.array(builder.shape_scale[i]), np.array(shape.indices).reshape(-1, 3)
            )
            color = tuple(int(255 * PAINT * c) for c in builder.shape_color[i])
            name = builder.body_label[builder.shape_body[i]].split("/")[-1]
            found.append((name, painted(_moved(mesh, np.array(builder.shape_transform[i])), color)))
    return found


def _moved(mesh: Mesh, pose: np.ndarray) -> Mesh:
    """Return a mesh moved by a pose [7]."""
    return Mesh(Rotation.from_quat(pose[3:]).apply(mesh.vertices) + pose[:3], mesh.faces, mesh.colors)


if __name__ == "__main__":
    main(*folder_and_image(__doc__))
