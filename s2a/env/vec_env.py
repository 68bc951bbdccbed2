"""The environment: physics and task kernels of all worlds in one launch a control step."""

from __future__ import annotations

from collections.abc import Mapping

import newton
import numpy as np
import torch
import warp as wp
from numpy.typing import ArrayLike

from s2a.articulation import opening_sign
from s2a.errors import InputError
from s2a.robot.model import JOINTS
from s2a.sim.simulation import Simulation
from s2a.sim.world import SimStage
from s2a.tasks.open_part import kernels, metrics
from s2a.tasks.open_part.config import COUNTS, OBSERVATIONS, RESULTS, REWARD_TERMS, OpenDrawerConfig


class OpenDrawerEnv:
    """Worlds in which a Franka opens the target of a sim.usd.

    Attributes:
        num_envs, num_actions, max_episode_length: as a vectorised environment has them.
        observation: shape [world 23], overwritten by every step.
        reward: shape [world].
        done, time_out: 0 or 1, shape [world], int32; a time-out is not a termination.
        terms: unweighted reward terms in the order of REWARD_TERMS, shape [world 9].
        touch: largest normal force of the left and right finger on the grasp region in the step [N], shape [world 2].
        elsewhere: the same on the rest of the part.
        result: how each world's last finished episode went, in the order of RESULTS, shape [world 15].
        counts: sums over finished episodes in the order of COUNTS since they were last set to zero, shape [16].
        episode_step: control steps since the reset, shape [world], int32.
        openings: what counts as opened in this stage [m], by name: "success", "wide", "static", "full".
        midway: 1 where whoever set `episode_step` says that the running episode shall not be counted, shape [world], int32.
    """

    num_actions = JOINTS

    def __init__(
        self,
        sim: Simulation,
        config: OpenDrawerConfig,
        weights: Mapping[str, float],
        seed: int,
        graph: bool = True,
        ahead: tuple[ArrayLike, float] | None = None,
    ) -> None:
        """Prepare the kernels' data, reset all worlds, capture the step where there is a GPU and `graph` is true.

        Args:
            sim: the worlds.
            config: the task.
            weights: of all reward terms, by name.
            seed: of the start noise.
            graph: whether to capture the step on a GPU.
            ahead: joint targets [step 9] of a motion that closes the hand on the handle, and the share of episodes that
                start somewhere on the way to it or in it; None: none does.
        """
        self.sim, self.config = sim, config
        self.num_envs, self.max_episode_length = sim.worlds, config.episode_steps
        self._weights_given = _weights(weights)
        motion, self._ahead_share = ahead or ([sim.robot.start], 0.0)
        with wp.ScopedDevice(sim.device):
            self._allocate(seed)
            self._ahead = wp.array(np.asarray(motion, dtype=np.float32), dtype=float)
        names = ("success", "wide", "static", "full")
        self.openings = {name: float(getattr(self._constants, f"{name}_opening")) for name in names}
        self._whole_step = sim.capture(self._step) if graph else self._step
        self.reset_all()

    def step(self, action: torch.Tensor) -> None:
        """Apply an action [world 9] in [-1, 1] for one control step; worlds whose episode ends are reset within it."""
        self._action_view.copy_(action)
        self._whole_step()

    def reset_all(self) -> None:
        """Start a new episode in every world; counts begin at zero."""
        self._done.fill_(1)
        self._reset_and_observe()
        self._done.zero_()
        self.counts.zero_()
        self.midway.zero_()

    def _step(self) -> None:
        """Do one control step: act, physics, judge, reset, observe (all on the device, nothing allocated)."""
        sim, q = self.sim, self._views
        inputs = [self._constants, self._lower, self._upper, self._action, self._targets, self._touch]
        self._launch(kernels.act, [*inputs, self._elsewhere])
        sim.step()
        inputs = [self._constants, self._weights, self._upper, q["joint_q"], q["joint_qd"], q["body_q"], self._action]
        self._launch(metrics.give_reward, [*inputs, self._touch, self._lead, self._terms, self._reward])
        inputs = [self._constants, q["joint_q"], q["joint_qd"], self._action, self._terms, self._touch, self._elsewhere]
        inputs += [self._overflow, self._steps, self._midway, self._progress]
        self._launch(metrics.tally, [*inputs, self._done, self._time_out, self._result, self._counts])
        self._reset_and_observe()

    def feel(self) -> None:
        """Find the forces of each finger on the grasp region and on the rest of the part in the last physics step."""
        data, contact = self.sim.solver.mjw_data, self.sim.solver.mjw_data.contact
        inputs = [self._constants, self._region.id, self._geom_kind, data.nacon, contact.geom, contact.worldid]
        inputs += [
            contact.pos,
            contact.efc_address,
            data.efc.force,
            self.sim.before.body_q.reshape((self.num_envs, -1)),
        ]
        self._launch(metrics.feel, [*inputs, self._touch, self._elsewhere], dim=data.naconmax)

    def _after_substep(self) -> None:
        """Keep what the solver forgets in its next step."""
        self._launch(metrics.keep_overflow, [self.sim.solver.mjw_data.overflow, self._overflow])
        self.feel()

    def _reset_and_observe(self) -> None:
        """Reset the worlds that are done, then write every world's observation."""
        sim, q = self.sim, self._views
        inputs = [
            self._constants,
            self._scanned,
            self._start,
            self._ahead,
            self._ahead_share,
            self._lower,
            self._upper,
            self._done,
            self._rng,
        ]
        inputs += [q["joint_q"], q["joint_qd"], self._targets, self._steps, self._progress, self._lead]
        self._launch(kernels.reset, [*inputs, self._world_mask, self._articulation_mask])
        # Clears warm starts and forces; the coordinates were just written (flags=0 leaves them alone).
        sim.solver.reset(sim.state, world_mask=self._world_mask, flags=0)
        mask = self._articulation_mask.flatten()
        newton.eval_fk(sim.model, sim.state.joint_q, sim.state.joint_qd, sim.state, mask=mask)
        inputs = [self._constants, self._lower, self._upper, q["joint_q"], q["joint_qd"], q["body_q"]]
        self._launch(kernels.observe, [*inputs, self._observation])

    def _launch(self, kernel: wp.Kernel, inputs: list, dim: int | None = None) -> None:
        wp.launch(kernel, dim=dim or self.num_envs, inputs=inputs, device=self.sim.device)

    def _allocate(self, seed: int) -> None:
        """Create the arrays that live as long as the environment; a captured graph keeps their addresses."""
        sim, n = self.sim, self.num_envs
        self._constants = _constants(sim, self.config)
        self._weights = wp.array(self._weights_given, dtype=float)
        self._lower = wp.array(sim.model.joint_limit_lower.numpy()[:JOINTS], dtype=float)
        self._upper = wp.array(sim.model.joint_limit_upper.numpy()[:JOINTS], dtype=float)
        self._scanned = wp.clone(sim.model.joint_q[: sim.model.joint_coord_count // n])
        self._start = wp.array(sim.robot.start, dtype=float)
        self._rng = wp.zeros(n, dtype=wp.uint32)
        self._launch(kernels.seed_worlds, [seed, self._rng])
        self._views = {
            "joint_q": sim.state.joint_q.reshape((n, -1)),
            "joint_qd": sim.state.joint_qd.reshape((n, -1)),
            "body_q": sim.state.body_q.reshape((n, -1)),
        }
        self._targets = sim.control.joint_target_q.reshape((n, -1))
        self._action = wp.zeros((n, JOINTS), dtype=float)
        self._observation = wp.zeros((n, OBSERVATIONS), dtype=float)
        self._terms = wp.zeros((n, len(REWARD_TERMS)), dtype=float)
        self._touch, self._elsewhere, self._lead = (wp.zeros((n, 2), dtype=float) for _ in range(3))
        self._progress = wp.zeros((n, len(metrics.PROGRESS)), dtype=float)
        self._result = wp.zeros((n, len(RESULTS)), dtype=float)
        self._counts = wp.zeros(len(COUNTS), dtype=float)
        self._reward = wp.zeros(n, dtype=float)
        self._done, self._time_out, self._steps, self._midway = (wp.zeros(n, dtype=int) for _ in range(4))
        self._overflow = wp.zeros(n, dtype=int)
        sim.after_substep = self._after_substep
        self._world_mask = wp.zeros(n + 1, dtype=bool)
        self._articulation_mask = wp.zeros((n, sim.model.articulation_count // n), dtype=bool)
        self._region = _region(sim.stage, sim.device)
        self._geom_kind = wp.array(_geom_kinds(sim), dtype=int)
        self._action_view = wp.to_torch(self._action)
        self.observation, self.terms, self.touch = map(wp.to_torch, (self._observation, self._terms, self._touch))
        self.elsewhere, self.midway = map(wp.to_torch, (self._elsewhere, self._midway))
        self.reward, self.done, self.time_out = map(wp.to_torch, (self._reward, self._done, self._time_out))
        self.result, self.counts, self.episode_step = map(wp.to_torch, (self._result, self._counts, self._steps))


def _weights(weights: Mapping[str, float]) -> list[float]:
    """Return the reward weights in the kernel's order; InputError for an unknown or missing name."""
    for name in weights:
        if name not in REWARD_TERMS:
            raise InputError(f"reward term {name!r} does not exist; known: {', '.join(REWARD_TERMS)}")
    missing = [name for name in REWARD_TERMS if name not in weights]
    if missing:
        raise InputError(f"reward weights lack {', '.join(missing)}; give 0 for a term that shall not count")
    return [float(weights[name]) for name in REWARD_TERMS]


def _constants(sim: Simulation, config: OpenDrawerConfig) -> kernels.Constants:
    """Return the kernels' constants for a stage; openings are scaled down where the part travels a shorter way."""
    stage, c = sim.stage, kernels.Constants()
    way = stage.travel
    scale = min(1.0, way / config.full_travel)
    c.link7, c.left, c.right = (sim.body(f"panda_{name}") for name in ("link7", "leftfinger", "rightfinger"))
    c.target = sim.body(stage.target)
    # The left finger's frame stands turned by -45 degrees about link 7's z (panda URDF, panda_hand_joint).
    c.hand = wp.transform(config.hand_point, wp.quat_from_axis_angle(wp.vec3(0.0, 0.0, 1.0), -np.pi / 4))
    c.grasp = wp.transform(*stage.grasp[:3], *stage.grasp[3:])
    c.base = wp.quat(*stage.base[3:])
    c.lever = opening_sign(stage.joint) * stage.lever
    c.action_step = config.action_scale * sim.config.dt * sim.config.substeps
    c.bonus = wp.vec3(*(scale * x for x in config.bonus_openings))
    c.end_opening = scale * config.end_opening
    c.success_opening = scale * config.success_opening
    c.wide_opening = scale * config.wide_opening
    c.static_opening, c.full_opening = way * config.static_share, way * config.full_share
    for name in (
        "finger_speed",
        "velocity_scale",
        "observation_limit",
        "start_noise",
        "close_distance",
        "static_speed",
    ):
        setattr(c, name, getattr(config, name))
    c.pyramidal = int(sim.config.cone == "pyramidal")
    c.episode_steps, c.touch_distance, c.touch_force = config.episode_steps, config.touch_distance, config.touch_force
    return c


def _region(stage: SimStage, device: str) -> wp.Mesh:
    """Return the annotated grasp region's surface in the target's body frame (its scene pose at joint zero)."""
    points = wp.array(stage.region.vertices, dtype=wp.vec3, device=device)
    return wp.Mesh(points, wp.array(stage.region.faces.ravel(), dtype=int, device=device))


def _geom_kinds(sim: Simulation) -> list[int]:
    """Return what each MuJoCo geom of a world belongs to: 0 left finger, 1 right finger, 2 target, -1 anything else."""
    kinds = {sim.body("panda_leftfinger"): 0, sim.body("panda_rightfinger"): 1, sim.body(sim.stage.target): 2}
    shape_body = sim.world.shape_body
    geoms = sim.solver.mjc_geom_to_newton_shape.numpy()[0]
    return [kinds.get(shape_body[shape], -1) if shape >= 0 else -1 for shape in geoms]
