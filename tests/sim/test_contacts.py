"""What the robot presses on, against plain references: numpy on random contacts, and MuJoCo's own forces in a grip."""

from __future__ import annotations

from dataclasses import replace

import mujoco_warp
import numpy as np
import pytest
import torch
import trimesh
import warp as wp
from cabinet import HANDLE, write_cabinet
from part_worlds import RADIUS, contacts, grasped, make_env, opening_forces, term
from scipy.spatial.transform import Rotation
from settings import load

from s2a.learn.evaluate import evaluate
from s2a.motion.policy import Planner
from s2a.motion.trajectory import PlannerConfig
from s2a.scene.geometry.mesh_ops import keep, normals
from s2a.scene.scene import Joint, Mesh
from s2a.scene.usd.sim_scene import Collider
from s2a.sim.contacts import ContactSensor
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import SimStage, read_stage, touched
from s2a.tasks.env import VecEnv

LEFT, RIGHT, LINK, PART, OTHER = 0, 1, 2, 3, -1
FOUND = ("normal", "on_region", "off_region", "other_links", "pull", "peak")


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> SimStage:
    """A hand-made cabinet with a drawer of 0.4 m."""
    return read_stage(write_cabinet(tmp_path_factory.mktemp("cabinet") / "sim.usda"))


def distances(region: trimesh.Trimesh, places: np.ndarray) -> np.ndarray:
    """Return the distance of points from a surface [m], triangle by triangle."""
    repeated = np.repeat(places, len(region.faces), axis=0)
    nearest = trimesh.triangles.closest_point(np.tile(region.triangles, (len(places), 1, 1)), repeated)
    return np.linalg.norm(nearest - repeated, axis=1).reshape(len(places), -1).min(axis=1)


def test_forces_are_added_up_by_link_and_place_as_a_plain_reference_says(
    stage: SimStage, monkeypatch: pytest.MonkeyPatch
) -> None:
    sim, count, rng = Simulation(stage, load(SimConfig, "sim/paper"), 3), 600, np.random.default_rng(0)
    sensor = ContactSensor(sim, 0.005)
    region = trimesh.Trimesh(stage.region.vertices, stage.region.faces, process=False)
    places = trimesh.sample.sample_surface(region, count, seed=0)[0] + rng.uniform(-0.01, 0.01, (count, 3))
    poses = np.hstack([rng.uniform(-1.0, 1.0, (3, 3)), Rotation.random(3, rng=rng).as_quat()]).astype(np.float32)
    wp.to_torch(sim.before.body_q).view(3, -1, 7)[:, sim.body("drawer_2")] = torch.tensor(poses)
    owners = np.array(
        [[LEFT, RIGHT, LINK, PART, OTHER], [PART, OTHER, LEFT, RIGHT, LINK], [LINK, LEFT, PART, OTHER, 1]]
    )
    pairs, worlds = rng.integers(0, 5, (count, 2)), rng.integers(0, 3, count)
    points = poses[worlds, :3] + Rotation.from_quat(poses[worlds, 3:]).apply(places)
    bases, rows = Rotation.random(count, rng=rng).as_matrix(), rng.integers(-1, 50, (count, 4))
    forces = np.hstack([rng.uniform(0.0, 3.0, (count, 1)), rng.uniform(-1.0, 1.0, (count, 5))])
    last = count - 10  # what lies behind the last contact is of an earlier step
    data, s = vars(sim.solver.mjw_data), sensor._sensor
    data.update(naconmax=count)
    s.owner, s.force = wp.array(owners, dtype=int), wp.array(forces, dtype=wp.spatial_vector)
    s.geom, s.world, s.pos = (
        wp.array(pairs, dtype=wp.vec2i),
        wp.array(worlds, dtype=int),
        wp.array(points, dtype=wp.vec3),
    )
    s.frame, s.row, s.count = wp.array(bases, dtype=wp.mat33), wp.array(rows, dtype=int), wp.array([last], dtype=int)
    monkeypatch.setattr(mujoco_warp, "contact_force", lambda *_: None)  # whose result lies in s.force already
    sensor.update()

    found, far = sensor.found, distances(region, places)
    expected = {name: np.zeros(getattr(found, name).numpy().shape) for name in FOUND}
    for i in range(last):
        first, second = owners[worlds[i], pairs[i]]
        if rows[i, 0] < 0 or not {first, second} & {LEFT, RIGHT, LINK}:
            continue
        expected["peak"][worlds[i]] = max(expected["peak"][worlds[i]], forces[i, 0])
        if PART not in (first, second):
            continue
        link, side = (first, 1.0) if second == PART else (second, -1.0)
        push = side * (bases[i].T @ forces[i, :3])  # MuJoCo's force acts on the second of the pair
        on = far[i] <= 0.005 and link != LINK
        expected["pull"][worlds[i], 0 if on else 1] += np.concatenate([push, np.cross(points[i], push)])
        if link == LINK:
            expected["other_links"][worlds[i]] += forces[i, 0]
        else:
            expected["on_region" if on else "off_region"][worlds[i], link] += forces[i, 0]
        if on:
            expected["normal"][worlds[i], link] += side * forces[i, 0] * bases[i][0]
    assert 0.2 < (far > 0.005).mean() < 0.8
    for name, values in expected.items():
        assert (values != 0.0).any(axis=0).all(), name
        assert np.allclose(getattr(found, name).numpy(), values, atol=1e-4), name


def push_of_the_robot(env: VecEnv) -> torch.Tensor:
    """Return the generalised force of the robot's contacts on the part's joint [world], by MuJoCo's Jacobian [N or N m]."""
    data, dof = env.sim.solver.mjw_data, env.sim.layout.part_dof
    owner = env.task.sensor._sensor.owner.numpy()
    jacobian, force = data.efc.J.numpy(), data.efc.force.numpy()
    total = torch.zeros(env.num_envs)
    for i in range(int(data.nacon.numpy()[0])):
        world, pair = data.contact.worldid.numpy()[i], data.contact.geom.numpy()[i]
        kinds = set(owner[world, pair])
        if PART in kinds and kinds & {LEFT, RIGHT, LINK}:
            for row in data.contact.efc_address.numpy()[i]:
                total[world] += float(jacobian[world, row, dof] * force[world, row]) if row >= 0 else 0.0
    return total


def gripping(env: VecEnv, more: int = 9) -> Planner:
    """Let the planner bring the hand to the handle, close it and go on for some steps; but the last in captured worlds."""
    sim, settings = env.sim, load(PlannerConfig, "planner/default")
    captured = make_env(sim.stage, sim=Simulation(sim.stages, sim.config, sim.num_envs), graph=True)
    leader, planner = Planner(captured, settings), Planner(env, settings)
    for _ in range(planner.grasp_steps + more - 1):
        captured.step(leader(captured.observation.clone()))
    env.load_state_dict(captured.state_dict())
    planner.load_state_dict(leader.state_dict())
    env.step(planner(env.observation.clone()))
    return planner


@pytest.mark.slow
@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_a_grip_is_felt_on_the_region_and_pulls_the_drawer_as_mujoco_says(stage: SimStage, cone: str) -> None:
    env = make_env(stage, sim=Simulation(stage, load(SimConfig, "sim/planner", cone=cone), 2))
    gripping(env)
    found = contacts(env)
    # The fingers press with stiffness 2000 N/m over half the bar's thickness, 11.9 mm: the left from above, the right below.
    assert found["on_region"].flatten().tolist() == pytest.approx([23.8] * 4, rel=0.2)
    assert found["normal"][:, :, 2].tolist() == [pytest.approx([-23.8, 23.8], rel=0.2)] * 2
    assert float(found["off_region"].abs().max()) == float(found["other_links"].abs().max()) == 0.0
    assert term(env, "grip").tolist() == term(env, "pinch").tolist() == [1.0, 1.0] and grasped(env) == [1, 1]
    planner = gripping(env, 89)  # it is drawn open
    pulls, before = [], env.sim.joint_qd[:, 9].clone()

    def watch() -> None:
        pulls.append(opening_forces(env))
        assert torch.allclose(pulls[-1].sum(dim=1), push_of_the_robot(env), atol=1e-3)

    env.sim.after_substep.append(watch)
    env.step(planner(env.observation.clone()))
    pull = torch.stack(pulls).mean(dim=0)
    assert float(pull[:, 1].abs().max()) == 0.0
    # What draws the drawer of 5.32 kg: a spring of 10 N/m and a damper of 1 N s/m hold it back.
    q, qd = env.sim.joint_q[:, 9], env.sim.joint_qd[:, 9]
    assert q.min() > 0.07 and qd.min() > 0.05
    assert torch.allclose(pull[:, 0], 10.0 * q + qd + 5.32 * (qd - before) * 60.0, atol=0.05)
    drawn = found["pull"][:, 0]
    assert torch.allclose(drawn[:, 0], pulls[-1][:, 0], atol=1e-4)  # the drawer opens towards +x
    middle = torch.linalg.cross(torch.tensor(HANDLE).float().expand(2, 3), drawn[:, :3])
    assert torch.allclose(drawn[:, 3:], middle, atol=8.0), (
        "a wrench about the world's origin, of forces near the handle"
    )


@pytest.mark.slow
def test_every_physics_step_is_felt_where_the_part_was_and_the_largest_force_is_kept(stage: SimStage) -> None:
    env = make_env(stage, sim="sim/planner")
    planner, felt = gripping(env), []
    touch = wp.to_torch(env.task.world.region_force)

    def watch() -> None:
        felt.append((contacts(env)["on_region"].clone(), touch.clone()))

    env.sim.after_substep.append(watch)
    env.step(planner(env.observation.clone()))
    env.sim.after_substep.remove(watch)
    assert len(felt) == 4 and felt[0][1].min() > 0.0
    now = torch.stack([each for each, _ in felt])
    assert torch.equal(torch.stack([each for _, each in felt]), now.cummax(dim=0).values)
    # Contacts lie where the part was before the physics step, not where that took it.
    wp.to_torch(env.sim.state.body_q).view(2, -1, 7)[:, env.sim.body("drawer_2"), 0] += 0.05
    env.task.sensor.update()
    assert torch.equal(contacts(env)["on_region"], now[-1])
    wp.to_torch(env.sim.state.body_q).view(2, -1, 7)[:, env.sim.body("drawer_2"), 0] -= 0.05
    raise_region(env)
    env.step(planner(env.observation.clone()))
    assert contacts(env)["on_region"].tolist() == touch.tolist() == [[0.0, 0.0], [0.0, 0.0]]
    assert contacts(env)["off_region"].flatten().tolist() == pytest.approx([23.8] * 4, rel=0.2)


def raise_region(env: VecEnv) -> None:
    """Move the annotated region 4 cm above the bar."""
    region = env.task.sensor._regions[0]
    region.points = wp.array(region.points.numpy() + [0.0, 0.0, 0.04], dtype=wp.vec3)


@pytest.mark.slow
def test_a_hinge_that_moves_is_held_back_as_mujoco_says(tmp_path_factory: pytest.TempPathFactory) -> None:
    joint = Joint("revolute", (0.0, 0.0, 1.0), tuple(HANDLE + [0.0, RADIUS, 0.0]), (-0.5, 1.2))
    stage = read_stage(write_cabinet(tmp_path_factory.mktemp("door") / "sim.usda", joint=joint))
    env = make_env(stage, sim="sim/planner")
    gripping(env, 0)
    env.sim.joint_qd[:, env.sim.layout.part_dof] = torch.tensor([0.3, -0.3])  # the grip stops it
    env.sim.step()
    pull = opening_forces(env).sum(dim=1)
    assert pull[0] < -1.0 and pull[1] > 1.0
    assert torch.allclose(pull * RADIUS, push_of_the_robot(env), atol=1e-3)  # [N m] about the hinge


@pytest.mark.slow
def test_openings_without_the_region_in_the_fingers_use_no_handle(stage: SimStage) -> None:
    env = make_env(stage, 2, sim="sim/planner")  # not captured: its region is another one
    raise_region(env)
    result = evaluate(env, Planner(env, load(PlannerConfig, "planner/default")))
    assert result["success"]["rate"] == 1.0
    assert result["handle_success"]["rate"] == result["grasp_success"]["rate"] == 0.0
    assert result["off_handle_success"]["rate"] == 1.0
    assert result["invalid"] == 0


def test_hulls_of_the_handle_complete_a_region_that_was_scanned_from_one_side(stage: SimStage) -> None:
    # The scan saw the bar from above; its lower side lies 23.8 mm below.
    top = keep(stage.region, np.flatnonzero(normals(stage.region)[:, 2] > 0.9))
    body = stage.room.bodies["drawer_2"]
    bar, *others = (collider.mesh for collider in body.colliders)
    plate = Mesh(
        bar.vertices + np.float32([0.0, 0.0, 0.04]), bar.faces
    )  # claimed by the handle too, and on no side of the region

    def seen(part: str) -> Mesh:
        mine = [Collider("handle_4", plate), Collider(part, bar), *(Collider("drawer_2", mesh) for mesh in others)]
        room = replace(stage.room, bodies={**stage.room.bodies, "drawer_2": replace(body, colliders=tuple(mine))})
        return touched(replace(stage, region=top, room=room))

    assert np.allclose(seen("drawer_2").bounds, top.bounds), "a hull of the front completes nothing"
    assert np.allclose(seen("handle_4").bounds, bar.bounds)
