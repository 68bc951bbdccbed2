"""Worlds of a room: what is active moves, what is not stands still, and the colliders that matter are there."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

import newton
import numpy as np
import pytest
import torch
import warp as wp
from cabinet import HANDLE, box, free_cube, write_cabinet
from nested_room import INNER, LONE, nested_room, quick
from settings import load

from s2a.core.errors import InputError
from s2a.prepare.room import prepare
from s2a.scene.articulation import open_limit
from s2a.scene.geometry.convex import deepest
from s2a.scene.scene import Mesh
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import ALL, Base, Collider
from s2a.sim.simulation import SimConfig, Simulation, boxes, boxes_at
from s2a.sim.world import JointConfig, axis_of, build_world, read_stage
from s2a.tasks import make_env
from s2a.tasks.env import DemoStarts
from s2a.tasks.open_part import OpenPartConfig, OpenPartMetrics

FREE = JointConfig(0.0, 0.0, "grasp")
PARTS = ("drawer_7", "drawer_8", "door_5", "door_6", INNER, LONE)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = Path(tmp_path_factory.mktemp("room") / "room.usd")
    sim_stage.write(prepare(nested_room(), "all", quick()), path)
    return path


def world(path: Path, part: str, *also: str, static: bool = True) -> newton.ModelBuilder:
    return build_world(read_stage(path, part, also=also), FREE, 1 / 240, static_colliders=static)


def ends(labels: list[str]) -> list[str]:
    return [label.split("/")[-1] for label in labels]


def below(builder: newton.ModelBuilder, body: str) -> set[str]:
    """Return the bodies whose colliders a body of a world has."""
    index = ends(builder.body_label).index(body)
    own = [label for label, owner in zip(builder.shape_label, builder.shape_body, strict=True) if owner == index]
    names = [label.split("/")[2:4] for label in own if "hull_" in label]
    return {inner.removeprefix("frozen_") if inner.startswith("frozen_") else outer for outer, inner in names}


def test_a_room_of_several_parts_asks_which(path: Path) -> None:
    with pytest.raises(InputError, match=r"6 articulated parts; give part= one of: drawer_7, drawer_8"):
        read_stage(path)
    with pytest.raises(InputError, match="'table_4' is not an articulated part"):
        read_stage(path, "table_4")
    with pytest.raises(InputError, match="'cup_1' neither moves on a joint nor lies free"):
        read_stage(path, "drawer_7", also=("cup_1",))
    with pytest.raises(InputError, match="no base pose for robot 'ur5', but for: panda"):
        read_stage(path, "drawer_7", robot="ur5")


@pytest.mark.parametrize("part", PARTS)
def test_every_part_gives_a_world_of_the_same_layout(part: str, path: Path) -> None:
    builder = world(path, part)
    carrier = f"{LONE}_anchor" if part == LONE else "cabinet_3"
    assert ends(builder.body_label) == ends(builder.joint_label) == [carrier, part]
    assert builder.joint_parent == [-1, 0]


def test_what_is_frozen_belongs_to_what_it_hangs_on(path: Path) -> None:
    drawer = world(path, "drawer_7")
    assert below(drawer, "drawer_7") == {"drawer_7"}
    assert below(drawer, "cabinet_3") >= {"cabinet_3", "drawer_8"}
    # A drawer behind a door goes with the door, and hangs on the cabinet where the door is frozen.
    assert INNER in below(world(path, "door_5"), "door_5")
    inner = world(path, INNER)
    assert "door_5" in below(inner, "cabinet_3") and below(inner, INNER) == {INNER}


def test_two_active_parts_move_apart_from_each_other(path: Path) -> None:
    builder = world(path, "door_5", INNER)
    assert ends(builder.body_label) == ["cabinet_3", "door_5", INNER]
    assert builder.joint_parent[ends(builder.joint_label).index(INNER)] == 1


def test_nothing_of_the_file_is_lost_where_newton_reads_it_by_itself(path: Path) -> None:
    builder, room = newton.ModelBuilder(), sim_stage.read(path)
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    builder.rigid_gap = 0.01
    builder.add_usd(str(path))
    assert set(ends(builder.body_label)) == set(room.bodies)
    assert builder.joint_dof_count == len(room.articulations)
    hulls = sum(len(body.colliders) for body in room.bodies.values()) + len(room.static_colliders)
    assert sum("/colliders/" in label for label in builder.shape_label) == hulls
    model = builder.finalize()
    solver = newton.solvers.SolverMuJoCo(model, use_mujoco_cpu=True)
    state, other, control = model.state(), model.state(), model.control()
    for _ in range(240):
        solver.step(state, other, control, None, 1.0 / 240.0)
        state, other = other, state
    assert np.abs(state.joint_q.numpy()).max() < 1e-3


def hulls_of(builder: newton.ModelBuilder, body: str) -> list[Mesh]:
    """Return the colliders that a body of the file has in a world."""
    found = [i for i, label in enumerate(builder.shape_label) if label.startswith(f"/scene/{body}/colliders/")]
    return [Mesh(builder.shape_source[i].vertices, builder.shape_source[i].indices.reshape(-1, 3)) for i in found]


@pytest.mark.slow
def test_what_is_frozen_in_the_path_of_a_part_is_cut_in_its_worlds_alone(tmp_path: Path) -> None:
    scene = nested_room()
    near = scene.parts["drawer_7"].mesh.bounds.mean(axis=0) + [0.35, 0.2, 0.0]
    moved = {
        i: replace(scene.parts[i], mesh=Mesh(scene.parts[i].mesh.vertices - shift, scene.parts[i].mesh.faces))
        for shift in [scene.parts[LONE].mesh.bounds.mean(axis=0) - near]
        for i in (LONE, "handle_41")
    }
    room = prepare(replace(scene, parts={**scene.parts, **moved}), ["drawer_7", LONE], quick())
    assert LONE in room.articulations["drawer_7"].filtered
    sim_stage.write(room, tmp_path / "room.usd")
    own = [collider.mesh for collider in room.bodies["drawer_7"].colliders]
    slide = room.articulations["drawer_7"].joint
    frozen, active = (hulls_of(world(tmp_path / "room.usd", part), LONE) for part in ("drawer_7", LONE))
    whole = [collider.mesh for collider in room.bodies[LONE].colliders]
    assert deepest(own, whole, slide) > 0.005 > 5e-4 > deepest(own, frozen, slide)
    assert len(active) == len(whole)


def crowded(tmp_path: Path, count: int, apart: float) -> Path:
    """Return a cabinet with so many small boxes between robot and drawer, `apart` [m] from each other."""
    boxes = [box((HANDLE[0] + 0.3, 0.3, 0.2 + apart * k), 3 * (0.002,)) for k in range(count)]
    return write_cabinet(tmp_path / "sim.usda", beside=boxes)


def static(builder: newton.ModelBuilder) -> list[str]:
    return [label for label, body in zip(builder.shape_label, builder.shape_body, strict=True) if body == -1]


@pytest.mark.slow
def test_all_colliders_near_a_path_are_loaded_however_many(tmp_path: Path) -> None:
    """500 boxes between robot and drawer, up to 1 m above the floor, and the floor; the wall is out of reach."""
    names = static(world(crowded(tmp_path, 500, 0.0016), "drawer_2"))
    assert [int(name[-3:].lstrip("_")) for name in names] == [0, *range(2, 502)]


@pytest.mark.slow
def test_a_world_has_room_for_the_contacts_of_all_that_it_loads(tmp_path: Path) -> None:
    (tmp_path / "few").mkdir()
    many, few = crowded(tmp_path, 400, 0.002), crowded(tmp_path / "few", 20, 0.04)
    settings = load(SimConfig, "sim/paper")
    sizes = [
        Simulation(stages, settings, 2).solver.mjw_data.naconmax // 2
        for stages in ([read_stage(path, "drawer_2") for path in paths] for paths in ([few], [many], [few, many]))
    ]
    # Floor and boxes, 401 of them, of which 64 have room already; a batch has the room of its most crowded world.
    assert sizes == [settings.nconmax, settings.nconmax + (401 - 64) // 2, settings.nconmax + (401 - 64) // 2]


@pytest.mark.parametrize("height", [0.0, 0.6])
def test_the_floor_is_loaded_though_no_arm_reaches_it_and_a_ceiling_is_not(height: float, tmp_path: Path) -> None:
    path = write_cabinet(tmp_path / "sim.usda")
    room = sim_stage.read(path)
    floor, wall = room.static_colliders
    ceiling = Collider("room_3", box((0.5, 0.0, 2.4), (2.0, 2.0, 0.01)), structure=True)
    part = room.articulations["drawer_2"]
    part = replace(part, bases={"panda": replace(part.bases["panda"], position=(0.9, 0.0, height))})
    colliders = (replace(floor, structure=True), replace(wall, structure=True), ceiling)
    sim_stage.write(replace(room, static_colliders=colliders, articulations={"drawer_2": part}), path)
    names = static(world(path, "drawer_2"))
    assert "/scene/static/colliders/room_3_00" in names and "/scene/static/colliders/room_3_02" not in names


def test_what_carries_a_free_object_is_loaded_though_out_of_reach(tmp_path: Path) -> None:
    """A shelf 0.6 m below a cube in the air, 2.4 m from the robot's base: it falls onto it."""
    shelf, beside = box((0.6, 2.4, 0.3), (0.2, 0.2, 0.01)), box((0.6, 3.0, 0.3), (0.2, 0.2, 0.01))
    path = write_cabinet(
        tmp_path / "sim.usda", beside=[shelf, beside], free=[free_cube("cube_9", (0.6, 2.4, 0.9), 0.05)]
    )
    names = [name[-2:] for name in static(world(path, "drawer_2", "cube_9"))]
    assert "02" in names and "03" not in names


def test_what_no_arm_reaches_and_nothing_meets_is_not_loaded_in_silence(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    far, beside = box((HANDLE[0] + 0.55, 3.0, 0.5), 3 * (0.1,)), box((HANDLE[0] + 0.3, 0.3, 0.5), 3 * (0.02,))
    path = write_cabinet(tmp_path / "sim.usda", beside=[far, beside])
    with caplog.at_level(logging.INFO, logger="s2a.sim.room"):
        names = static(world(path, "drawer_2"))
    # Neither the box in the distance nor the wall behind the cabinet.
    assert [name[-2:] for name in names] == ["00", "03"]
    assert "2 of 4 static colliders are loaded" in caplog.text
    assert not any(record.levelno == logging.WARNING for record in caplog.records)
    assert static(world(path, "drawer_2", static=False)) == []


def test_a_robot_on_a_pedestal_stands_on_a_collider(tmp_path: Path) -> None:
    path = write_cabinet(tmp_path / "sim.usda")
    room = sim_stage.read(path)
    raised = {"panda": Base((0.9, 0.0, 0.4), (0.0, 0.0, 1.0, 0.0), pedestal=0.4)}
    part = replace(room.articulations["drawer_2"], bases=raised)
    sim_stage.write(replace(room, articulations={"drawer_2": part}), path)
    assert "/scene/static/colliders/pedestal_00" in static(world(path, "drawer_2"))


def test_in_a_live_room_everything_moves_and_every_collider_is_there(path: Path) -> None:
    room, builder = sim_stage.read(path, visuals=False), world(path, "drawer_7", ALL)
    assert set(ends(builder.body_label)) == set(room.bodies)
    assert builder.joint_dof_count == len(room.articulations)
    assert len(static(builder)) >= len(room.static_colliders)


def test_no_shape_of_a_live_room_leaves_the_box_that_decides_what_it_may_meet(path: Path) -> None:
    sim = Simulation(read_stage(path, "drawer_7", also=(ALL,)), load(SimConfig, "sim/pick_place"), 1)
    model, shapes = sim.model, np.arange(sim.model.shape_count)
    bounds = boxes(model, shapes, sim._paths([sim.world]))
    low, high = model.joint_limit_lower.numpy(), model.joint_limit_upper.numpy()
    state, random = model.state(), np.random.default_rng(0)
    for q in random.uniform(low, high, (20, len(low))).astype(np.float32):
        newton.eval_fk(model, wp.array(q, dtype=float), model.joint_qd, state)
        center, half = boxes_at(model, shapes, state.body_q.numpy())
        assert (bounds[:, 0] <= center - half).all() and (center + half <= bounds[:, 1]).all()
    assert np.isfinite(bounds).all()
    # The drawer that stands alone, 1.2 m beside the cabinet, meets none of its parts, and the robot only what it reaches.
    pairs = sim.solver.mjc_geom_to_newton_shape.numpy()[0][sim.solver.mjw_model.nxn_geom_pair_filtered.numpy()]
    bodies = model.shape_body.numpy()[pairs]
    lone, door = sim.body(LONE), sim.body("door_5")
    assert not (np.sort(bodies, axis=1) == sorted((lone, door))).all(axis=1).any()
    assert ((bodies == lone).any(axis=1) & np.isin(bodies, sim.layout.robot_bodies).any(axis=1)).any()


@pytest.mark.slow
def test_the_next_task_goes_on_where_the_last_one_ended(path: Path) -> None:
    stages = [read_stage(path, part, also=(ALL,)) for part in ("drawer_7", "door_5")]
    stages[1] = replace(stages[1], base=stages[0].base)  # the robot stays where it stands
    sim = Simulation(stages[0], load(SimConfig, "sim/pick_place"), 2)
    task, metrics = load(OpenPartConfig, "task/open_part", episode_steps=4), load(OpenPartMetrics, "metrics/open_part")
    first = make_env(sim, task, metrics, {}, 0)
    axes = [axis_of(sim.world, stage.target, stage.joint.kind) for stage in stages]
    sim.joint_qd[:, axes[1][1]] = 0.2 * np.sign(open_limit(stages[1].joint))
    action = torch.full((2, first.num_actions), 0.1)
    first.step(action)
    before = sim.snapshot()
    with pytest.raises(InputError, match="demonstrations would move"):
        make_env(sim, task, metrics, {}, 0, continues=True, demo=DemoStarts([], 0.0, 0.0))
    with pytest.raises(InputError, match="plan from where the robot stands"):
        sim.aim(replace(stages[1], base=stages[1].base + [0.1, 0, 0, 0, 0, 0, 0]))
    sim.aim(replace(stages[1], also=()))
    sim.aim(stages[1])
    env = make_env(sim, task, metrics, {}, 0, continues=True)
    assert all(torch.equal(sim.snapshot()[name], value) for name, value in before.items())
    assert (sim.layout.part_coord, sim.layout.part_dof) == axes[1]
    last = sim.joint_q.clone()
    for _ in range(4):  # over the end of an episode
        env.step(action)
        assert 0.0 < float((sim.joint_q - last).abs().max()) < 0.05
        last = sim.joint_q.clone()
    assert (last[:, axes[1][0]] * np.sign(open_limit(stages[1].joint)) > 0.008).all()
    with pytest.raises(InputError, match="also=all"):
        Simulation(read_stage(path, "drawer_7"), load(SimConfig, "sim/pick_place"), 1).aim(stages[1])


@pytest.mark.parametrize("use_c", [False, True])
def test_small_free_objects_stay_where_they_were_scanned(use_c: bool, tmp_path: Path) -> None:
    # On a shelf of its own, far from the scene's origin; 50 g and 3 cm: NaN where the frame is the scene's.
    shelf = box((0.6, 0.9, 0.5), (0.2, 0.2, 0.02))
    cubes = [free_cube(f"cube_{k}", (0.5 + 0.08 * k, 0.9, 0.5355), 0.03, 0.05) for k in range(3)]
    path = write_cabinet(tmp_path / "sim.usda", beside=[shelf], free=cubes)
    # A cube is one hull: with one contact a pair of hulls it would stand on a corner.
    settings = load(SimConfig, "sim/paper", multiccd=True)
    sim = Simulation(read_stage(path, also=tuple(cube.id for cube in cubes)), settings, 1, with_robot=False)
    in_c = newton.solvers.SolverMuJoCo(sim.model, use_mujoco_cpu=True, enable_multiccd=True)
    solver = in_c if use_c else sim.solver
    start, state, other = sim.body_q[0].clone(), sim.state, sim.before

    def twice() -> None:
        solver.step(state, other, sim.control, None, 1 / 240)
        solver.step(other, state, sim.control, None, 1 / 240)

    step = twice if use_c else sim.capture(twice)
    for _ in range(240):
        step()
    end = torch.from_numpy(state.body_q.numpy()).view(start.shape)
    for cube in cubes:
        assert float((end - start)[sim.body(cube.id), :3].norm()) < 0.003


def test_free_objects_that_are_not_active_are_part_of_the_room(tmp_path: Path) -> None:
    path = write_cabinet(tmp_path / "sim.usda", free=[free_cube("cube_5", (0.6, 0.3, 0.5))])
    builder = world(path, "drawer_2")
    assert "cube_5" not in ends(builder.body_label)
    label = next(label for label in builder.shape_label if "cube_5" in label)
    assert list(builder.shape_transform[builder.shape_label.index(label)])[:3] == pytest.approx([0.6, 0.3, 0.5])
