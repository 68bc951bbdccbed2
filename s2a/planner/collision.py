"""Which of several joint paths keeps clear of the collision hulls in a simulated world, without simulating."""

from __future__ import annotations

import mujoco
import numpy as np

from s2a.planner.part_reach import arm_in_part, part_hulls
from s2a.robot.collision import SLACK, RobotShape, Surfaces, robot_shape
from s2a.robot.tool_path import matrices, straight
from s2a.scene.scene import Mesh
from s2a.sim.simulation import Simulation

TRIED = 16
"""Number of joint paths that are checked."""


def most_clear(sim: Simulation, paths: np.ndarray, coordinates: np.ndarray | None = None) -> int:
    """Return the index of the first joint path [path pose arm] that collides with nothing, else of the one that does least.

    What it meets itself weighs more than what is on the way to it, which may be led around.

    The arm turns all joints evenly from home to a path's first pose, where nothing may touch; from there on the gripper and
    the part move together, and the rest of the arm may not touch that either.

    Args:
        sim: the world.
        paths: the joint paths.
        coordinates: of the part at each pose [m or rad], shape [pose]; None: it stands at zero.
    """
    shape, base = robot_shape(sim.robot), matrices(sim.stage.base[None])[0]
    coordinates = np.zeros(paths.shape[1]) if coordinates is None else coordinates
    part, start = part_hulls(sim.stage), float(coordinates[0])
    static, all_hulls = _hulls(sim, start, moving=False), _hulls(sim, start, moving=True)
    home = np.array(sim.robot.home)
    best = (np.inf, np.inf, 0)
    for k, path in enumerate(paths[:TRIED]):
        reach = straight(home, path[0])
        own = max(
            _penetration(shape, base, static, path, fingers=False),
            arm_in_part(shape, part, sim.stage.joint, coordinates, path, base),
            shape.self_penetration(path)[0],
        )
        on_the_way = max(_penetration(shape, base, all_hulls, reach, fingers=True), shape.self_penetration(reach)[0])
        if max(own, on_the_way) <= SLACK:
            return k
        best = min(best, (max(own, SLACK), on_the_way, k))
    return best[2]


def _penetration(shape: RobotShape, base: np.ndarray, hulls: Surfaces, q: np.ndarray, *, fingers: bool) -> float:
    """Return how deep the robot in joints [pose arm] reaches into hulls [m]."""
    chosen = shape.moving & (~shape.fingers | fingers)
    centers = shape.centers(q)[:, chosen] @ base[:3, :3].T + base[:3, 3]
    return hulls.penetration(centers.reshape(-1, 3), np.tile(shape.radii[chosen], len(q)))[0]


def _hulls(sim: Simulation, start: float, *, moving: bool) -> Surfaces:
    """Return the collision hulls around the robot, the part at `start`; those of what can move only where asked for."""
    model = sim.solver.mj_model
    data = mujoco.MjData(model)
    data.qpos[sim.layout.part_coord] = start
    mujoco.mj_kinematics(model, data)
    shape_body = np.append(sim.world.shape_body, -1)
    own = {
        i for i, label in enumerate(sim.world.body_label) if label.split("/")[-1] in robot_shape(sim.robot).kin.links
    }
    found = {}
    for geom, shape in enumerate(sim.solver.mjc_geom_to_newton_shape.numpy()[0]):
        static = model.body_weldid[model.geom_bodyid[geom]] == 0
        if shape_body[shape] in own or not (static or moving) or not model.geom_contype[geom]:
            continue
        if (mesh := _mesh(model, geom)) is not None:
            points = mesh.vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
            found[f"hull_{geom}"] = Mesh(points, mesh.faces)
    return Surfaces(found)


def _mesh(model: mujoco.MjModel, geom: int) -> Mesh | None:
    """Return a geom's surface in its own frame; None where it is no mesh."""
    if model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH:
        return None
    mesh = model.geom_dataid[geom]
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    face, faces = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    return Mesh(model.mesh_vert[first : first + count].astype(float), model.mesh_face[face : face + faces])
