"""Many worlds of one sim.usd, stepped together."""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import mujoco_warp
import newton
import numpy as np
import torch
import warp as wp

from s2a import robot
from s2a.core.errors import InputError
from s2a.core.workers import spread
from s2a.robot.tool_path import matrices
from s2a.scene.usd.sim_scene import ALL
from s2a.sim.solver import IGNORED_OVERFLOWS, Layout, SimConfig, hooks, layout, make_solver, vary
from s2a.sim.world import SimStage, axis_of, body_index, build_world, empty_world

_log = logging.getLogger(__name__)

FEW = 8  # Stages that are built before a helper has started
ATTRIBUTES = "custom_attributes"
# Poses on a part's path in which pairs of hulls are counted, and those of the part for which `sim.nconmax` has room
POSES, OWN = 9, 20
# Hulls that do not move, for whose pairs with the arm `sim.nconmax` has room. Among 245 of a scanned kitchen a
# planner's arm had 72 pairs at most, so that every second hull beyond gets room
FIXED = 64
# Rows of constraints of a part: its friction, limits, and a contact; of an object at rest: 12 contacts, each with a normal
# force and two of friction
JOINT_ROWS, OBJECT_ROWS = 6, 36
# [m] By which boxes of paths are larger than those of POSES poses on them: a door of 1 m that turns by half a turn bulges out
# by 20 mm between two, and stops yield
PATH_MARGIN = 0.05
COLLIDES = int(newton.ShapeFlags.COLLIDE_SHAPES)


def build_worlds(stages: Sequence[SimStage], config: SimConfig, *, with_robot: bool) -> list[newton.ModelBuilder]:
    """Return a builder for each stage, in their order.

    Where some parts slide and others turn, each gets a slide and a hinge; see `build_world`.
    """
    both_kinds = len({stage.joint.kind for stage in stages}) > 1
    return [_unpack(values) for values in spread(_packed_world, (config, with_robot, both_kinds), stages, few=FEW)]


def _packed_world(settings: tuple[SimConfig, bool, bool], stage: SimStage) -> dict[str, Any]:
    """Return a stage's world as values that another process can be sent."""
    (config, with_robot, both_kinds), spec = settings, robot.load(stage.robot)
    return _pack(
        build_world(
            stage,
            config.joint,
            config.dt,
            robot=spec if with_robot else None,
            gains=config.gains_of(spec),
            gravity_compensation=config.gravity_compensation,
            static_colliders=config.load_static_colliders,
            realistic=config.limits is not None and config.limits.drives,
            coupled_fingers=config.coupled_fingers,
            both_kinds=both_kinds,
        )
    )


def _pack(world: newton.ModelBuilder) -> dict[str, Any]:
    """Return a builder's state; of its attributes only the values, as their types cannot be sent (warp's, made at run time)."""
    return vars(world) | {ATTRIBUTES: {name: each.values for name, each in world.custom_attributes.items()}}


def _unpack(state: dict[str, Any]) -> newton.ModelBuilder:
    world = empty_world()
    for name, values in state[ATTRIBUTES].items():
        world.custom_attributes[name].values = values
    vars(world).update(state | {ATTRIBUTES: world.custom_attributes})
    return world


class Simulation:
    """Physics of `num_envs` worlds on one device; world i is a copy of stage i modulo their number.

    Attributes:
        stages: what is simulated; `stage` is the first.
        stage_of_env: index of each world's stage, shape [world].
        robot: the robot that the stages were prepared for.
        arm_limits: what its controller lets an action ask for.
        plan_limits: what the arm keeps up, for a plan.
        world: builder of the first stage's world.
        layout: which body and coordinate of a world is what; of the first stage.
        part_coord: the part's coordinate in each world, shape [world]; where stages have slides and hinges, that differs.
        part_dof: its velocity likewise.
        model: the Newton model of all worlds.
        solver: MuJoCo (Warp) with hull contacts.
        state: joint and body state before and after every `step` (always this same buffer).
        before: the same before the last physics step, in which its contacts were found.
        control: joint targets.
        joint_q: joint coordinates [m or rad], torch view of state.joint_q, shape [world coord]; the arm's come first: those
            of a base that drives, which the model has before them, are not among them.
        joint_qd: joint velocities, torch view of state.joint_qd, shape [world dof], likewise.
        body_q: body poses (position, quaternion xyzw), torch view of state.body_q, shape [world body 7].
        joint_target_q: joint targets, torch view of the control's, shape [world dof], likewise.
        base_q: coordinates of a base that drives: x, y, yaw, lift [m, rad], torch view, shape [world 4]; [world 0] without one.
        base_qd: their velocities [m/s, rad/s], likewise.
        base_target_q, base_target_qd: targets of its joints and their velocities [m/s, rad/s], likewise.
        before_substep: what to call before every physics step; captured with it.
        after_substep: what to call after every physics step; captured with it. The solver forgets contacts and overflows in the
            next.
    """

    layout: Layout
    part_coord: np.ndarray
    part_dof: np.ndarray

    def __init__(
        self,
        stages: SimStage | Sequence[SimStage],
        config: SimConfig,
        num_envs: int,
        device: str = "cpu",
        with_robot: bool = True,
    ) -> None:
        """Build the worlds; the first call on a machine compiles kernels for a minute.

        Raises:
            InputError: an odd number of substeps; stages for different robots.
        """
        if config.substeps % 2:
            raise InputError(f"key 'sim.substeps' is {config.substeps}; a captured step needs an even number")
        self.stages = [stages] if isinstance(stages, SimStage) else list(stages)
        self.stage, self.config, self.num_envs, self.device = self.stages[0], config, num_envs, device
        self.stage_of_env = np.arange(num_envs) % len(self.stages)
        self._moving = {*self.stage.active}
        robots = {stage.robot: stage for stage in reversed(self.stages)}
        if len(robots) > 1:
            one, other = list(robots.values())[:2]
            raise InputError(
                f"{one.path} ({one.target}) and {other.path} ({other.target}) differ in their robot; "
                "simulate them in batches of their own"
            )
        self.robot = robot.load(self.stage.robot)
        limits, gains = self.robot.limits, config.gains_of(self.robot)
        self.arm_limits = config.limits.of(limits) if config.limits else limits
        self.plan_limits = config.limits.sustained(limits, gains) if config.limits else limits
        with wp.ScopedDevice(device):
            worlds = build_worlds(self.stages, config, with_robot=with_robot)
            self.world = worlds[0]
            self.model = _finalized(_batch(worlds, num_envs))
            if with_robot:
                layouts = [layout(world, self.robot, stage) for world, stage in zip(worlds, self.stages, strict=True)]
                self.layout = layouts[0]
                self.part_coord = np.array([each.part_coord for each in layouts])[self.stage_of_env]
                self.part_dof = np.array([each.part_dof for each in layouts])[self.stage_of_env]
                if config.vary is not None:
                    vary(self.model, self.layout, self.robot.base_joints, self.part_dof, config.vary)
            if with_robot or self.stage.is_live:
                poses = self._paths(worlds)
                config = self._with_capacity(config, poses)
            self.solver = make_solver(self.model, config)
            if self.stage.is_live:
                keep_pairs(self.solver, self.model, poses)
            self.solver.mjw_model.opt.warn_overflow &= ~int(IGNORED_OVERFLOWS)
            self.state, self.before = self.model.state(), self.model.state()
            self.control = self.model.control()
            newton.eval_fk(self.model, self.model.joint_q, self.model.joint_qd, self.state)
            self._resistance = hooks(self, worlds)
        self.before_substep: list[Callable[[], None]] = [*self._resistance]
        first = self.robot.base_joints if with_robot else 0
        whole = (self.state.joint_q, self.state.joint_qd, self.control.joint_target_q, self.control.joint_target_qd)
        q, qd, target, speed = (wp.to_torch(each).view(num_envs, -1) for each in whole)
        self.joint_q, self.joint_qd, self.joint_target_q = (each[:, first:] for each in (q, qd, target))
        base = (each[:, :first] for each in (q, qd, target, speed))
        self.base_q, self.base_qd, self.base_target_q, self.base_target_qd = base
        self.body_q = wp.to_torch(self.state.body_q).view(num_envs, -1, 7)
        self.after_substep: list[Callable[[], None]] = []

    def aim(self, stage: SimStage) -> None:
        """Make another part or object that moves the target, for the next task; nothing in the worlds changes.

        What the last task has called before and after every physics step is called no more.

        `stage`: of the same room and robot, at the same base unless that drives; what moves may be where it is now.

        Raises:
            InputError: another file, robot or base; something that does not move here; worlds of several stages.
        """
        missing = {*stage.active} - self._moving
        if stage.path != self.stage.path or missing or len(self.stages) > 1:
            raise InputError(
                f"{stage.path}: {', '.join(sorted(missing)) or stage.target} does not move in these worlds of "
                f"{self.stage.path}; make them with also={ALL}"
            )
        stays = self.robot.drive is not None or np.allclose(stage.base, self.stage.base, atol=1e-6)
        if stage.robot != self.stage.robot or not stays:
            raise InputError(
                f"{stage.path}: the robot {self.stage.robot} of these worlds stands at {np.round(self.stage.base[:3], 2)} m, "
                f"and {stage.target!r} is for {stage.robot} at {np.round(stage.base[:3], 2)} m; plan from where the robot stands"
            )
        self.stage, self.stages, self.layout = stage, [stage], layout(self.world, self.robot, stage)
        self.part_coord, self.part_dof = (
            np.full(self.num_envs, each) for each in (self.layout.part_coord, self.layout.part_dof)
        )
        self.before_substep, self.after_substep = [*self._resistance], []

    def snapshot(self) -> dict[str, torch.Tensor]:
        """Return copies of all that physics reads; see `restore`."""
        return {name: wp.to_torch(array).clone() for name, array in self.persistent().items()}

    def restore(self, snapshot: Mapping[str, torch.Tensor]) -> None:
        """Go on from exactly where a snapshot of these worlds was taken."""
        for name, array in self.persistent().items():
            wp.to_torch(array).copy_(snapshot[name])

    def persistent(self) -> dict[str, wp.array]:
        """Return every array that a later physics step reads before it is written, by name."""
        arrays = {name: getattr(self.state, name) for name in ("joint_q", "joint_qd", "body_q", "body_qd")}
        targets = {name: getattr(self.control, name) for name in ("joint_target_q", "joint_target_qd")}
        return arrays | targets | {"warm_start": self.solver.mjw_data.qacc_warmstart}

    def _with_capacity(self, config: SimConfig, poses: Sequence[np.ndarray]) -> SimConfig:
        """Return the settings with room for the contacts of what moves and an arm among many hulls.

        MuJoCo drops what is beyond `nconmax` pairs of hulls whose bounding boxes overlap, whether they touch or not. Those of
        what moves with all else are counted along all paths at once in the first world of each stage; those beyond OWN get
        further room, and so does the arm for hulls beyond FIXED. Of a live room each part and object also gets further
        rows of constraints.

        `poses`: of all bodies along the paths of what moves, shape [body 7] each.
        """
        model, first = self.model, min(len(self.stages), self.num_envs)
        fixed = np.bincount(model.shape_world.numpy()[_fixed(model)] + 1, minlength=2)[1:].max()
        further = max(most_pairs(model, poses, first) - OWN, 0) + max(int(fixed) - FIXED, 0) // 2
        live = (stage for stage in self.stages if stage.is_live)
        rows = [JOINT_ROWS * len(s.room.articulations) + OBJECT_ROWS * len(s.room.free) for s in live]
        return replace(config, nconmax=config.nconmax + further, njmax=config.njmax + max(rows, default=0))

    def _paths(self, worlds: Sequence[newton.ModelBuilder]) -> list[np.ndarray]:
        """Return poses of all bodies [body 7] as the parts of each stage's first world go through their range together."""
        model, first = self.model, min(len(self.stages), self.num_envs)
        axes = [
            np.array([model.joint_coord_count, model.joint_dof_count]) // self.num_envs * i
            + axis_of(world, part, stage.room.articulations[part].joint.kind)
            for i, (stage, world) in enumerate(zip(self.stages[:first], worlds, strict=False))
            for part in stage.active
            if part in stage.room.articulations
        ]
        coords, dofs = np.array(axes, dtype=int).reshape(-1, 2).T
        limits = np.stack([model.joint_limit_lower.numpy()[dofs], model.joint_limit_upper.numpy()[dofs]])
        poses, start = [], model.joint_q.numpy().copy()  # on a CPU numpy() is the model's own memory
        for fraction in np.linspace(0.0, 1.0, POSES):
            start[coords] = limits[0] + fraction * (limits[1] - limits[0])
            state = model.state()
            newton.eval_fk(model, wp.array(start, dtype=float), model.joint_qd, state)
            poses.append(state.body_q.numpy())
        return poses

    def of_worlds(self, array: wp.array) -> wp.array:
        """Return an array of all coordinates or velocities as shape [world coord], without those of a base that drives."""
        return array.reshape((self.num_envs, -1))[:, self.robot.base_joints :]

    def axis_of(self, part: str) -> tuple[int, int]:
        """Return the columns of a part's, or free object's, first coordinate and velocity in `joint_q` and `joint_qd`."""
        joint = self.stage.room.articulations.get(part)
        coord, dof = axis_of(self.world, part, joint.joint.kind if joint else "prismatic")
        return coord - self.robot.base_joints, dof - self.robot.base_joints

    def body(self, name: str) -> int:
        """Return the index of a body within a world."""
        return body_index(self.world, name)

    def step(self) -> None:
        """Advance all worlds by one control step (`substeps` physics steps)."""
        for _ in range(self.config.substeps):
            for function in self.before_substep:
                function()
            self.solver.step(self.state, self.before, self.control, None, self.config.dt)
            self.state, self.before = self.before, self.state
            for function in self.after_substep:
                function()

    def capture(self, function: Callable[[], None]) -> Callable[[], None]:
        """Return `function` as one captured graph: a CUDA graph, or on a CPU Warp's list of launches, replayed without Python.

        What the graph reads and writes must stay where it is, and a Python number is frozen at its value of now.
        """
        function()  # compiles and loads every kernel, which capture forbids
        # Torch works on the device's null stream, which cannot be captured; Warp's own stream waits for it and it for
        # Warp's, so both see each other's results in order.
        with wp.ScopedDevice(self.model.device), wp.ScopedCapture() as capture:
            function()
        return lambda: wp.capture_launch(capture.graph)


def most_pairs(model: newton.Model, poses: Sequence[np.ndarray], worlds: int) -> int:
    """Return the most pairs of shapes, one of a body that moves or is free and one of another body, with boxes that overlap.

    Args:
        model: of all worlds.
        poses: of all bodies (position, quaternion xyzw), shape [body 7] each.
        worlds: how many of the worlds are looked at, the first ones.
    """
    body, world = model.shape_body.numpy(), model.shape_world.numpy()
    some = np.flatnonzero((world >= 0) & (world < worlds) & (model.shape_flags.numpy() & COLLIDES > 0))
    body, world = body[some], world[some]
    moved = np.abs(poses[-1] - poses[0]).max(axis=1) > 1e-6
    moved[model.joint_child.numpy()[model.joint_type.numpy() == newton.JointType.FREE]] = True
    mine = (body >= 0) & moved[body]
    worlds_shapes = [np.flatnonzero(world == number) for number in range(worlds)]
    sides = [(shapes[mine[shapes]], shapes) for shapes in worlds_shapes]
    most = 0
    for pose in poses:
        center, half = boxes_at(model, some, pose)
        for own, other in sides:
            apart = (np.abs(center[own][:, None] - center[other]) > half[own][:, None] + half[other]).any(axis=2)
            # Two that both move meet twice in this table
            twice = mine[other] & (own[:, None] > other)
            most = max(most, int((~apart & ~twice & (body[own][:, None] != body[other])).sum()))
    return most


def boxes_at(model: newton.Model, shapes: np.ndarray, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return centres and half extents [shape 3] of the bounding boxes of some shapes, their bodies at poses [body 7]."""
    low, high = (each.numpy()[shapes] for each in (model.shape_collision_aabb_lower, model.shape_collision_aabb_upper))
    bodies = np.concatenate([matrices(pose), np.eye(4)[None]])  # shapes of no body have the last, -1
    place = bodies[model.shape_body.numpy()[shapes]] @ matrices(model.shape_transform.numpy()[shapes])
    center = np.einsum("nij,nj->ni", place[:, :3, :3], (low + high) / 2) + place[:, :3, 3]
    return center, np.einsum("nij,nj->ni", np.abs(place[:, :3, :3]), (high - low) / 2)


def boxes(model: newton.Model, shapes: np.ndarray, poses: Sequence[np.ndarray]) -> np.ndarray:
    """Return boxes that shapes of the first world never leave [m], shape [shape 2 3]; infinite where nothing bounds them.

    A part on one joint keeps to the poses of its path. Any other body, as a robot's link or a drawer on a door, is no farther
    from what is fixed than its joints allow; a free one may be anywhere.

    Args:
        model: of all worlds.
        shapes: indices of the shapes.
        poses: of all bodies along the paths of what moves, shape [body 7] each.
    """
    placed = [boxes_at(model, shapes, pose) for pose in poses]
    low = np.min([center - half for center, half in placed], axis=0) - PATH_MARGIN
    high = np.max([center + half for center, half in placed], axis=0) + PATH_MARGIN
    joints, anchor, reach = _reaches(model, poses[0])
    body = model.shape_body.numpy()[shapes]  # what is fixed has the last entry, -1
    path = np.append(np.ptp(poses, axis=0).max(axis=1) > 0.0, False)
    loose = (joints[body] > 1) | ((joints[body] == 1) & ~path[body])
    size = np.abs(np.stack([model.shape_collision_aabb_lower.numpy(), model.shape_collision_aabb_upper.numpy()])).max(
        axis=0
    )
    around = reach[body] + np.linalg.norm(model.shape_transform.numpy()[shapes, :3], axis=1)
    around = (around + np.linalg.norm(size[shapes], axis=1) + PATH_MARGIN)[:, None]
    low[loose], high[loose] = (anchor[body] - around)[loose], (anchor[body] + around)[loose]
    return np.stack([low, high], axis=1)


def _reaches(model: newton.Model, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return of each body of the first world, and last of what is fixed, how many joints move it, and within what ball.

    That is centre [body 3] and radius [body] of a ball that its origin never leaves [m]. `pose`: of all bodies, shape [body 7].
    """
    worlds, lower, upper = max(1, model.world_count), model.joint_limit_lower.numpy(), model.joint_limit_upper.numpy()
    offsets = [np.linalg.norm(each.numpy()[:, :3], axis=1) for each in (model.joint_X_p, model.joint_X_c)]
    ahead, dofs, kinds = model.joint_X_p.numpy()[:, :3], model.joint_dof_dim.numpy(), model.joint_type.numpy()
    parents, children, first = model.joint_parent.numpy(), model.joint_child.numpy(), model.joint_qd_start.numpy()
    bodies = np.concatenate([matrices(pose), np.eye(4)[None]])
    moving, reach, anchor = np.zeros(len(bodies), int), np.zeros(len(bodies)), bodies[:, :3, 3].copy()
    for j in range(model.joint_count // worlds):  # parents come before children
        parent, child, slides = parents[j], children[j], slice(first[j], first[j] + dofs[j, 0])
        slide = np.maximum(np.abs(lower[slides]), np.abs(upper[slides])).sum()
        moving[child] = moving[parent] + int(dofs[j].sum())
        reach[child] = reach[parent] + offsets[1][j] + (np.inf if kinds[j] == newton.JointType.FREE else slide)
        if moving[parent]:
            anchor[child], reach[child] = anchor[parent], reach[child] + offsets[0][j]
        elif moving[child]:
            anchor[child] = bodies[parent, :3, :3] @ ahead[j] + bodies[parent, :3, 3]
    return moving, anchor, reach


def keep_pairs(solver: newton.solvers.SolverMuJoCo, model: newton.Model, poses: Sequence[np.ndarray]) -> None:
    """Leave out pairs of a live room's shapes whose boxes never meet: of a room's parts most never do.

    MuJoCo tests every pair in every physics step. `poses`: as `boxes`.
    """
    m, shapes = solver.mjw_model, solver.mjc_geom_to_newton_shape.numpy()[0]
    pairs, ids = m.nxn_geom_pair_filtered.numpy(), m.nxn_pairid_filtered.numpy()
    bounds = boxes(model, np.maximum(shapes, 0), poses)
    bounds[shapes < 0] = [3 * [-np.inf], 3 * [np.inf]]
    a, b = bounds[pairs[:, 0]], bounds[pairs[:, 1]]
    meet = ((a[:, 0] <= b[:, 1]) & (b[:, 0] <= a[:, 1])).all(axis=1)
    m.nxn_geom_pair_filtered = wp.array(pairs[meet], dtype=wp.vec2i)
    m.nxn_pairid_filtered = wp.array(ids[meet], dtype=wp.vec2i)
    m.opt.broadphase = mujoco_warp.BroadphaseType.NXN  # it took another one for many pairs
    _log.info("%d of %d pairs of shapes may meet", meet.sum(), len(meet))


def _fixed(model: newton.Model) -> np.ndarray:
    """Return which shapes collide and are of no body that moves, shape [shape]."""
    body: np.ndarray = model.shape_body.numpy()
    return (body < 0) & (model.shape_flags.numpy() & COLLIDES > 0)


def device_of(key: str) -> str:
    """Return the device that a user's key means; "auto" is a GPU where there is one.

    Raises:
        InputError: a device that this machine does not have.
    """
    devices = ["cpu", *(f"cuda:{i}" for i in range(torch.cuda.device_count()))]
    chosen = devices[:2][-1] if key == "auto" else key
    if chosen not in devices:
        raise InputError(f"key 'device' is {key!r}; on this machine one of: auto, {', '.join(devices)}")
    return chosen


def _batch(worlds: Sequence[newton.ModelBuilder], num_envs: int) -> newton.ModelBuilder:
    """Return the builder of all worlds.

    Of several stages, what may touch is said by groups instead of pairs: MuJoCo's masks have no room for the pairs of all.
    Then the part touches the robot alone; in a single stage it touches the room too.
    """
    builder = newton.ModelBuilder()
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    if len(worlds) == 1:
        builder.replicate(worlds[0], num_envs)
        return builder
    for world in worlds:
        _group(world)
    for i in range(num_envs):
        builder.add_world(worlds[i % len(worlds)])
    return builder


def _finalized(builder: newton.ModelBuilder) -> newton.Model:
    """Return a builder's model, without what only Newton's own collision detection reads; MuJoCo's is in use here.

    For that, finalize() walks the faces of every hull in Python: minutes for the rooms of a pool.
    """
    flags = np.array(builder.shape_flags, dtype=np.int32)
    builder.shape_flags = (flags & ~int(newton.ShapeFlags.COLLIDE_SHAPES)).tolist()
    model = builder.finalize()
    model.shape_flags.assign(flags)
    return model


def _group(world: newton.ModelBuilder) -> None:
    """Let the robot's shapes and all others touch each other, and none of its own kind: groups -1 and -2."""
    for shape, body in enumerate(world.shape_body):
        if world.shape_flags[shape] & newton.ShapeFlags.COLLIDE_SHAPES:
            is_robot = body >= 0 and not world.body_label[body].startswith("/scene/")
            world.shape_collision_group[shape] = -1 if is_robot else -2
    world.shape_collision_filter_pairs.clear()
