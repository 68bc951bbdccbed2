"""What kernels of tasks with an articulated part read: the part's geometry, indices of bodies, contacts, settings."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp
from scipy.spatial.transform import Rotation

from s2a.core.bounds import NotNegative, Positive
from s2a.core.errors import InputError
from s2a.env.task import MdpConfig
from s2a.robot.tool_path import matrices
from s2a.scene.articulation import opening_sign
from s2a.sim.contacts import ContactSensor, PartContacts
from s2a.sim.simulation import Simulation
from s2a.sim.world import SimStage
from s2a.tasks.part_description import of_vector

SHORTEST_ARM = 0.05
"""[m] Shorter lever arms are not told of a hinge."""


@dataclass(frozen=True)
class PartMdp(MdpConfig):
    """What the decision processes with a part share.

    Attributes:
        velocity_scale: factor of the joint velocities in the observation.
        observation_limit: observations are clamped to +- this.
        tcp_offset: shift of the tool frame from the point between the pads, in that frame [m].
        describe_part: for a policy of many parts: observe also what tells one from another, and tell the critic what no sensor
            does (`s2a.tasks.part_observation`).
        fine_grasp: of these, observe the way to the grasp in fine too, and whether the gripper holds from within.
        grasp_error: least and greatest distance of the grasp that is seen from the true one [m], drawn for an episode; it has any
            direction.
        grasp_turn: least and greatest angle between them [degree], about any axis.
        contact_distance: distance of a contact from the annotated region up to which it is on it [m].
        contact_force: normal force from which a contact counts [N].
    """

    velocity_scale: float
    observation_limit: Positive
    tcp_offset: tuple[float, float, float]
    describe_part: bool
    fine_grasp: bool
    grasp_error: tuple[NotNegative, NotNegative]
    grasp_turn: tuple[NotNegative, NotNegative]
    contact_distance: NotNegative
    contact_force: NotNegative


@wp.struct
class PartGeometry:
    """A world's part and grasp.

    Attributes:
        grasp: grasp frame in the part's body.
        base: world from the robot's base.
        lever_arm: opening per unit of the joint's coordinate [1 or m], positive opens.
        axis, origin: of the joint, world frame [1, m].
        slides: 1 for a slide, 0 for a hinge.
        coord, dof: index of the joint's coordinate and of its velocity within the world.
        travel: opening at the open limit [m].
        size: extents of the grasp region along the grasp frame's axes [m].
        pinchable: 1 where two fingers can hold the region: it is thinner than the gripper opens, or held from within.
    """

    grasp: wp.transform
    base: wp.quat
    lever_arm: float
    axis: wp.vec3
    origin: wp.vec3
    slides: int
    coord: int
    dof: int
    travel: float
    size: wp.vec3
    pinchable: int


@wp.struct
class EstimatedPart:
    """What a policy is told of a part by an estimate (`s2a.tasks.part_description`), the part at zero, world frame.

    Attributes:
        grasp: the grasp frame.
        axis: of the joint, positive opens.
        along: direction in which the grasp point moves first when the part opens.
        origin: of the joint [m].
        size: extents of the grasp region along the grasp frame's axes [m].
        slides: 1 for a slide, 0 for a hinge.
        lever_arm: of a hinge [m], 0 for a slide.
        travel: opening at the open limit [m].
    """

    grasp: wp.transform
    axis: wp.vec3
    along: wp.vec3
    origin: wp.vec3
    size: wp.vec3
    slides: int
    lever_arm: float
    travel: float


@wp.struct
class Bodies:
    """Indices within a world: the tool's link, the fingers, the part; the tool frame in its link."""

    tool_link: int
    left: int
    right: int
    part: int
    tool: wp.transform


@wp.struct
class PartHandles:
    """What the tasks with a part share.

    Attributes:
        part: shape [world].
        bodies: indices, the same in all worlds.
        contacts: of the last physics step.
        region_force: max force of the left and right finger on the region in the control step [N], shape [world 2].
        contact_force: force from which a contact counts [N].
        velocity_scale: factor of the joint velocities in the observation.
        observation_limit: observations are clamped to +- this.
        seen: the grasp that is seen, in the grasp frame, shape [world].
        resistance: of the part's joint: dry friction [N or N m], damping [N s/m or N m s/rad]; log of its mass, shape [world].
        is_estimated: 1 where a policy is told an estimate of the part, not the truth.
        estimates: of each stage's frames, shape [stage frame]; those of a stage that has fewer are repeated.
        stage: index of each world's stage, shape [world].
        frame: which of them a policy is told in the running episode, shape [world].
        tracked: how far the part is open and how fast, as the robot's own motion tells [m, m/s]; shape [world].
        tool_before: place of the tool a control step ago [m], shape [world].
        control_step: [s].
    """

    part: wp.array(dtype=PartGeometry)
    bodies: Bodies
    contacts: PartContacts
    region_force: wp.array2d(dtype=float)
    contact_force: float
    velocity_scale: float
    observation_limit: float
    seen: wp.array(dtype=wp.transform)
    resistance: wp.array(dtype=wp.vec3)
    is_estimated: int
    estimates: wp.array2d(dtype=EstimatedPart)
    stage: wp.array(dtype=int)
    frame: wp.array(dtype=int)
    tracked: wp.array(dtype=wp.vec2)
    tool_before: wp.array(dtype=wp.vec3)
    control_step: float


def bind(sim: Simulation, sensor: ContactSensor, config: PartMdp) -> PartHandles:
    """Return the shared handles of worlds; InputError where the way to the grasp is asked for in fine and not in coarse."""
    if config.fine_grasp and not config.describe_part:
        raise InputError("key 'task.fine_grasp' adds to what task.describe_part=true observes; give that, too")
    h, b, (left, right) = PartHandles(), Bodies(), sim.layout.finger_bodies
    b.tool_link, b.left, b.right, b.part = sim.layout.tool_body, left, right, sim.layout.part_body
    b.tool = wp.transform(wp.vec3(*np.add(sim.robot.tool_offset, config.tcp_offset)), wp.quat_identity())
    wide = sim.robot.gripper.max_opening
    parts = [
        _part(sim.stages[i], wide, *at) for i, *at in zip(sim.stage_of_env, sim.part_coord, sim.part_dof, strict=True)
    ]
    h.part, h.bodies, h.contacts = wp.array(parts, dtype=PartGeometry), b, sensor.found
    h.region_force, h.contact_force = wp.zeros((sim.num_envs, 2), dtype=float), config.contact_force
    h.velocity_scale, h.observation_limit = config.velocity_scale, config.observation_limit
    h.seen = wp.array([wp.transform_identity()] * sim.num_envs, dtype=wp.transform)
    h.resistance = wp.array(_resistance(sim), dtype=wp.vec3)
    known = _estimates(sim.stages)
    h.is_estimated, h.control_step = int(known is not None), sim.config.control_dt
    worlds, flat = (sim.num_envs, sum(known, [])) if known else (0, [])
    h.estimates = (
        wp.array(flat, dtype=EstimatedPart).reshape((len(sim.stages), -1))
        if flat
        else wp.zeros((0, 0), dtype=EstimatedPart)
    )
    h.stage = wp.array(sim.stage_of_env, dtype=int)
    h.frame, h.tracked = wp.zeros(worlds, dtype=int), wp.zeros(worlds, dtype=wp.vec2)
    h.tool_before = wp.zeros(worlds, dtype=wp.vec3)
    return h


def _estimates(stages: Sequence[SimStage]) -> list[list[EstimatedPart]] | None:
    """Return what a policy may be told of each stage, as many frames of each; None where it is told the truth.

    Raises:
        InputError: some stages have estimates and others do not.
    """
    known = [np.zeros((0, 0)) if stage.estimates is None else stage.estimates for stage in stages]
    missing = [stage.target for stage, estimates in zip(stages, known, strict=True) if not len(estimates)]
    if len(missing) == len(stages):
        return None
    if missing:
        raise InputError(f"no camera frame shows {', '.join(missing[:5])}; leave such parts out")
    most = max(map(len, known))
    return [
        [_estimated(stage, each[i % len(each)]) for i in range(most)] for stage, each in zip(stages, known, strict=True)
    ]


def _estimated(stage: SimStage, numbers: np.ndarray) -> EstimatedPart:
    """Return an estimate in the world frame."""
    part, base, found = of_vector(numbers), matrices(stage.base[None])[0], EstimatedPart()
    turn = base[:3, :3]
    frame = turn @ np.stack([np.cross(part.across, part.inwards), part.across, part.inwards], axis=1)
    point = turn @ part.point + base[:3, 3]
    found.grasp = wp.transform(wp.vec3(*point), wp.quat(*Rotation.from_matrix(frame).as_quat()))
    found.slides, axis, along = int(part.slides > 0.5), turn @ part.axis, turn @ part.along
    if found.slides:
        axis = along  # one direction has two names
    else:
        along = along - (along @ axis) * axis
        along /= np.linalg.norm(along)
    found.lever_arm = 0.0 if found.slides else max(part.lever_arm, SHORTEST_ARM)
    found.axis, found.along = wp.vec3(*axis), wp.vec3(*along)
    found.origin = wp.vec3(*(point - found.lever_arm * np.cross(along, axis)))
    found.size, found.travel = wp.vec3(*part.size), part.travel
    return found


def _resistance(sim: Simulation) -> np.ndarray:
    """Return dry friction and damping of each world's part, and the logarithm of its mass, shape [world 3]."""
    model, worlds = sim.model, np.arange(sim.num_envs)
    of_dof = [each.numpy().reshape(sim.num_envs, -1) for each in (model.joint_friction, model.joint_target_kd)]
    mass = model.body_mass.numpy().reshape(sim.num_envs, -1)[:, sim.layout.part_body]
    return np.stack([*(each[worlds, sim.part_dof] for each in of_dof), np.log(mass)], axis=1)


def _part(stage: SimStage, max_opening: float, coord: int, dof: int) -> PartGeometry:
    p, joint = PartGeometry(), stage.joint
    p.coord, p.dof = coord, dof
    p.grasp = wp.transform(*stage.grasp[:3], *stage.grasp[3:])
    p.base = wp.quat(*stage.base[3:])
    p.lever_arm, p.travel = opening_sign(joint) * stage.lever_arm, stage.travel
    p.axis, p.origin, p.slides = wp.vec3(*joint.axis), wp.vec3(*joint.origin), int(joint.kind == "prismatic")
    p.size = wp.vec3(*stage.grasp_size)
    p.pinchable = int(stage.internal or stage.grasp_size[1] < max_opening)
    return p
