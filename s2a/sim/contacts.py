"""Contacts: forces between the robot's links and one body of every world, by link and region; depths at which bodies overlap.

The gripper's pads are the fingers' links. A contact belongs to where it lies, whatever collider carries it.
"""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING

import mujoco
import mujoco_warp
import newton
import numpy as np
import warp as wp
from scipy.spatial.transform import Rotation

from s2a.scene.articulation import carried, lever_arm, transform
from s2a.scene.geometry.convex import sections
from s2a.scene.scene import Joint, Mesh
from s2a.scene.usd.sim_scene import Collider, SimBody
from s2a.sim.world import touched

if TYPE_CHECKING:  # it needs torch, and the depths are measured without
    from s2a.sim.simulation import Simulation

# What a collider belongs to: a finger, any other link of the robot, the body that is watched; -1 for anything else
LEFT, RIGHT, LINK, PART = (wp.constant(i) for i in range(4))


@wp.struct
class PartContacts:
    """Contacts of the robot in the last physics step; forces in N, directions in the world frame."""

    # sum of the normal forces with which the left and right finger press on the region, shape [world 2] of vec3
    normal: wp.array2d(dtype=wp.vec3)
    on_region: wp.array2d(dtype=float)  # their magnitude added up, shape [world 2]
    off_region: wp.array2d(dtype=float)  # that of each finger on the rest of the body, shape [world 2]
    other_links: wp.array(dtype=float)  # that of all other links of the robot on the body, shape [world]
    # force that the fingers exert on the region (0) and all else of the robot on the body (1), as a wrench on the
    # body about the world's origin, shape [world 2] of (force, torque)
    pull: wp.array2d(dtype=wp.spatial_vector)
    # largest normal force of any contact of the robot since it was last set to zero, shape [world]
    peak: wp.array(dtype=float)


@wp.struct
class Sensor:
    """What the sensor reads: the solver's contacts, who owns which collider, where the regions are."""

    owner: wp.array2d(dtype=int)
    region: wp.array(dtype=wp.uint64)
    body: int
    distance: float
    count: wp.array(dtype=int)
    geom: wp.array(dtype=wp.vec2i)
    world: wp.array(dtype=int)
    pos: wp.array(dtype=wp.vec3)
    frame: wp.array(dtype=wp.mat33)
    row: wp.array2d(dtype=int)
    force: wp.array(dtype=wp.spatial_vector)
    body_q: wp.array2d(dtype=wp.transform)


@wp.kernel
def clear(contacts: PartContacts):
    """Forget the contacts of the physics step before."""
    world = wp.tid()
    for i in range(2):
        contacts.normal[world, i] = wp.vec3()
        contacts.on_region[world, i] = 0.0
        contacts.off_region[world, i] = 0.0
        contacts.pull[world, i] = wp.spatial_vector()
    contacts.other_links[world] = 0.0


@wp.kernel
def collect(s: Sensor, contacts: PartContacts):
    """Add up the forces of a physics step, one thread a contact.

    `s.body_q` is that before the step, where the contacts were found: at 1.5 m/s a part is 6 mm farther after it.
    """
    contact = wp.tid()
    if contact >= s.count[0] or s.row[contact, 0] < 0:
        return
    world = s.world[contact]
    first, second = s.owner[world, s.geom[contact][0]], s.owner[world, s.geom[contact][1]]
    # MuJoCo's contact force acts on the second geom, along the frame's first row from the first to the second.
    swapped = first == PART or first < 0
    link, other = wp.where(swapped, second, first), wp.where(swapped, first, second)
    sign = wp.where(swapped, -1.0, 1.0)
    if link < LEFT or link > LINK:
        return
    pressed = wp.spatial_top(s.force[contact])[0]
    wp.atomic_max(contacts.peak, world, pressed)
    if other != PART:
        return
    at = s.pos[contact]
    force = sign * (wp.spatial_top(s.force[contact]) @ s.frame[contact])
    wrench = wp.spatial_vector(force, wp.cross(at, force))
    local = wp.transform_point(wp.transform_inverse(s.body_q[world, s.body]), at)
    if link == LINK:
        wp.atomic_add(contacts.other_links, world, pressed)
        wp.atomic_add(contacts.pull, world, 1, wrench)
    elif wp.mesh_query_point_no_sign(s.region[world], local, s.distance).result:
        wp.atomic_add(contacts.normal, world, link, sign * pressed * s.frame[contact][0])
        wp.atomic_add(contacts.on_region, world, link, pressed)
        wp.atomic_add(contacts.pull, world, 0, wrench)
    else:
        wp.atomic_add(contacts.off_region, world, link, pressed)
        wp.atomic_add(contacts.pull, world, 1, wrench)


class ContactSensor:
    """Feels the contacts of the robot with the watched body of every world in each physics step.

    Attributes:
        found: the contacts of the last physics step.
    """

    def __init__(self, sim: "Simulation", distance: float) -> None:
        """Watch the target of a simulation; a contact within `distance` [m] of the annotated region is on it."""
        n, data = sim.num_envs, sim.solver.mjw_data
        self._sim = sim
        regions = [query_mesh(touched(stage)) for stage in sim.stages]
        self._regions = regions  # a mesh lives as long as somebody holds it
        s = self._sensor = Sensor()
        s.owner = wp.array(_owners(sim), dtype=int)
        s.region = wp.array([regions[i].id for i in sim.stage_of_env], dtype=wp.uint64)
        s.body, s.distance = sim.layout.part_body, distance
        s.count, s.geom, s.world, s.pos = data.nacon, data.contact.geom, data.contact.worldid, data.contact.pos
        s.frame, s.row = data.contact.frame, data.contact.efc_address
        s.force = wp.zeros(data.naconmax, dtype=wp.spatial_vector)
        self._ids = wp.array(np.arange(data.naconmax), dtype=int)
        f = self.found = PartContacts()
        f.normal, f.pull = wp.zeros((n, 2), dtype=wp.vec3), wp.zeros((n, 2), dtype=wp.spatial_vector)
        f.on_region, f.off_region = wp.zeros((n, 2), dtype=float), wp.zeros((n, 2), dtype=float)
        f.other_links, f.peak = wp.zeros(n, dtype=float), wp.zeros(n, dtype=float)

    def update(self) -> None:
        """Read the contacts of the physics step that just ended."""
        sim, data = self._sim, self._sim.solver.mjw_data
        wp.launch(clear, dim=sim.num_envs, inputs=[self.found])
        mujoco_warp.contact_force(sim.solver.mjw_model, data, self._ids, False, self._sensor.force)
        self._sensor.body_q = sim.before.body_q.reshape((sim.num_envs, -1))
        wp.launch(collect, dim=data.naconmax, inputs=[self._sensor, self.found])


def query_mesh(mesh: Mesh) -> wp.Mesh:
    """Return a mesh for queries in kernels, on Warp's default device; who uses its id keeps it."""
    points = wp.array(np.asarray(mesh.vertices, np.float32), dtype=wp.vec3)
    return wp.Mesh(points, wp.array(np.asarray(mesh.faces, np.int32).ravel(), dtype=int))


def _owners(sim: "Simulation") -> np.ndarray:
    """Return what each MuJoCo geom of a world belongs to, shape [world geom]: LEFT, RIGHT, LINK, PART, or -1."""
    bodies = sim.model.body_count // sim.num_envs
    of_body = np.full(bodies + 1, -1)  # the last entry stands for the immovable room
    of_body[list(sim.layout.robot_bodies)], of_body[sim.layout.part_body] = LINK, PART
    of_body[list(sim.layout.finger_bodies)] = LEFT, RIGHT
    shapes = sim.solver.mjc_geom_to_newton_shape.numpy()
    body = sim.model.shape_body.numpy()[shapes]
    return np.where((shapes >= 0) & (body >= 0), of_body[np.where(body >= 0, body % bodies, bodies)], -1)


STATIC = "static"  # Id of the static room
POSES = 33  # Coordinates between the limits of a joint at which Newton measures overlaps
SECTION = 0.1  # [rad] of a turn whose bounds tell which hulls it may meet
STRIDE = (
    1e-3  # [m] Path of a point between two depths that MuJoCo measures: none between is deeper by more than half of it
)
CONTACTS = 8  # of a pair of convex hulls in Newton at most
FAR = 1.0  # [m] Gap above which no distance is sought

# Hulls that move, hulls that stay, their joint, and pairs that may meet, each with two coordinates between which they may ->
# indices of a hull that moves and of one that stays, coordinate, and depth there [m]
Meeting = tuple[int, int, float, float]
Engine = Callable[[Sequence[Mesh], Sequence[Mesh], Joint, Sequence[Meeting]], Iterator[tuple[int, int, float, float]]]


@dataclass(frozen=True)
class OverlapDepth:
    """Deepest overlap of an articulated part and another body that stands at its scanned pose, no pair filtered."""

    rest: float = 0.0  # at the scanned pose [m]
    travel: float = 0.0  # anywhere between the joint's limits [m]
    q: float = 0.0  # the coordinate of that [m] or [rad]


@dataclass(frozen=True)
class RestingRoom:
    """Bodies of a room at their scanned poses, of which one part at a time moves, and what of the room never does.

    Attributes:
        bodies: articulated parts and furniture by id.
        joints: of the articulated parts.
        parents: body that each of these moves against.
        static: colliders of the rest of the room.
    """

    bodies: Mapping[str, SimBody]
    joints: Mapping[str, Joint]
    parents: Mapping[str, str]
    static: Sequence[Collider] = field(default=(), repr=False)

    def overlaps(self, part: str, engine: Engine | None = None) -> dict[str, OverlapDepth]:
        """Return how deep a part, and what it carries, overlaps other bodies, by their ids; of STATIC all that does not move.

        Args:
            part: the articulated part; all others stand at their scanned poses.
            engine: measures depths; None: MuJoCo's exact depth of convex hulls.
        """
        result: dict[str, OverlapDepth] = {}
        for (_, other), depth in self.pairs(part, engine).items():
            last = result.get(other, OverlapDepth())
            travel = max((last.travel, last.q), (depth.travel, depth.q))
            result[other] = OverlapDepth(max(last.rest, depth.rest), *travel)
        return result

    def pairs(
        self, part: str, engine: Engine | None = None, beside: Collection[str] = ()
    ) -> dict[tuple[str, str], OverlapDepth]:
        """Return the same by what overlaps: the part, or what it carries, and the other body.

        Args:
            part: the articulated part.
            engine: measures depths.
            beside: bodies that are not asked against the part itself, only against what it carries.
        """
        joint, group = self.joints[part], carried(part, self.parents)
        moving = [(body, c.mesh) for body in group for c in self.bodies[body].colliders]
        others = {i: body.colliders for i, body in self.bodies.items() if i not in group} | {STATIC: self.static}
        pool = [(i, c.mesh) for i, colliders in others.items() for c in colliders]
        ours, theirs = [mesh for _, mesh in moving], [mesh for _, mesh in pool]
        meetings = [
            each
            for each in _meetings(ours, theirs, joint)
            if moving[each[0]][0] != part or pool[each[1]][0] not in beside
        ]
        result: dict[tuple[str, str], OverlapDepth] = {}
        for one, other, q, depth in (engine or mujoco_depths)(ours, theirs, joint, meetings) if meetings else ():
            pair = moving[one][0], pool[other][0]
            last = result.get(pair, OverlapDepth())
            rest = max(last.rest, depth) if q == 0.0 else last.rest
            result[pair] = OverlapDepth(rest, *max((last.travel, last.q), (depth, q)))
        return result


def _meetings(moving: Sequence[Mesh], others: Sequence[Mesh], joint: Joint) -> list[Meeting]:
    """Return the pairs of hulls whose bounds overlap in a section of the path, with the limits of the section."""
    boxes = np.array([mesh.bounds for mesh in others]).reshape(-1, 2, 3)
    meetings: list[Meeting] = []
    for i, mesh in enumerate(moving):
        points = sections(mesh, joint, SECTION)
        stops = np.linspace(*joint.limits, len(points) + 1).tolist()
        for each, (start, end) in zip(points, pairwise(stops), strict=True):
            meet = ((each.min(axis=0) < boxes[:, 1]) & (boxes[:, 0] < each.max(axis=0))).all(axis=1)
            meetings += [(i, j, start, end) for j in np.flatnonzero(meet).tolist()]
    return meetings


def mujoco_depths(
    moving: Sequence[Mesh], others: Sequence[Mesh], joint: Joint, meetings: Sequence[Meeting]
) -> Iterator[tuple[int, int, float, float]]:
    """Yield depths of convex hulls by MuJoCo's distance, STRIDE apart, farther where a gap allows (an `Engine`)."""
    ours, theirs = sorted({i for i, *_ in meetings}), sorted({j for _, j, *_ in meetings})
    spec = mujoco.MjSpec()
    for name, mesh in [*((f"m{i}", moving[i]) for i in ours), *((f"o{j}", others[j]) for j in theirs)]:
        asset = spec.add_mesh(name=name)
        asset.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        asset.uservert, asset.userface = mesh.vertices.astype(np.float64).ravel(), mesh.faces.ravel()
        spec.worldbody.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    places, frames = data.geom_xpos.copy(), data.geom_xmat.copy().reshape(-1, 3, 3)

    def gap(a: int, b: int, q: float) -> float:
        moved = transform(joint, q)
        data.geom_xpos[a] = moved[:3, :3] @ places[a] + moved[:3, 3]
        data.geom_xmat[a] = (moved[:3, :3] @ frames[a]).ravel()
        return float(mujoco.mj_geomDistance(model, data, a, b, FAR, None))

    for i, j, start, end in meetings:
        a, b = model.geom(f"m{i}").id, model.geom(f"o{j}").id
        speed = max(lever_arm(joint, point) for point in moving[i].vertices)
        deepest, q = 0.0, start
        if start <= 0.0 <= end and (depth := -gap(a, b, 0.0)) > 0.0:
            yield i, j, 0.0, depth
        while speed > 0.0:
            apart = gap(a, b, q)
            if -apart > deepest:
                deepest = -apart
                yield i, j, q, deepest
            if q >= end:
                break
            q = min(end, q + max(STRIDE, apart + deepest) / speed)


def newton_depths(
    moving: Sequence[Mesh], others: Sequence[Mesh], joint: Joint, meetings: Sequence[Meeting]
) -> Iterator[tuple[int, int, float, float]]:
    """Yield depths of convex hulls by Newton's own contacts, at POSES coordinates at once (an `Engine`)."""
    ours, theirs = sorted({i for i, *_ in meetings}), sorted({j for _, j, *_ in meetings})
    if not meetings:
        return
    stops = np.unique([0.0, *np.linspace(*joint.limits, POSES)])
    poses = np.array([transform(joint, q) for q in stops])
    with wp.ScopedDevice("cpu"):
        builder = newton.ModelBuilder()
        cfg = builder.default_shape_cfg
        cfg.margin, cfg.gap, cfg.density = 0.0, 1e-6, 0.0
        shapes: dict[tuple[int, int], int] = {}
        meshes = {i: newton.Mesh(moving[i].vertices, moving[i].faces.ravel(), compute_inertia=False) for i in ours}
        for k, pose in enumerate(poses):
            place = wp.transform(pose[:3, 3], Rotation.from_matrix(pose[:3, :3]).as_quat())
            body = builder.add_body(xform=place, mass=1.0, inertia=wp.mat33(np.eye(3)))
            shapes |= {(k, i): builder.add_shape_convex_hull(body, mesh=meshes[i]) for i in ours}
        fixed = {}
        for j in theirs:
            mesh = newton.Mesh(others[j].vertices, others[j].faces.ravel(), compute_inertia=False)
            fixed[builder.add_shape_convex_hull(-1, mesh=mesh)] = j
        pairs = [
            (shapes[k, i], shape)
            for shape, j in fixed.items()
            for i in {i for i, other, *_ in meetings if other == j}
            for k in range(len(stops))
        ]
        model = builder.finalize()
        pipeline = newton.CollisionPipeline(
            model,
            broad_phase="explicit",
            shape_pairs_filtered=wp.array(pairs, dtype=wp.vec2i),
            rigid_contact_max=CONTACTS * len(pairs),
        )
        contacts = pipeline.contacts()
        pipeline.collide(model.state(), contacts)
    count = int(contacts.rigid_contact_count.numpy()[0])
    if count > CONTACTS * len(pairs):
        raise RuntimeError(
            f"{count} contacts of {len(pairs)} pairs of hulls, more than the {CONTACTS} each that are kept"
        )
    ends, points = (
        np.stack([getattr(contacts, f"rigid_contact_{name}{k}").numpy()[:count] for k in range(2)])
        for name in ("shape", "point")
    )
    which = np.full(model.shape_count, -1)  # pose of a hull that moves, by shape
    which[[*shapes.values()]] = [k for k, _ in shapes]
    hull = {shape: i for (_, i), shape in shapes.items()}
    k = which[ends]
    turned = np.einsum("knij,knj->kni", poses[k, :3, :3], points) + poses[k, :3, 3]
    first, second = np.where((k >= 0)[..., None], turned, points)
    depths = ((first - second) * contacts.rigid_contact_normal.numpy()[:count]).sum(axis=1)
    owners = np.where(k < 0, ends, 0).max(axis=0), np.where(k >= 0, ends, 0).max(axis=0)
    for still, own, pose, depth in zip(*owners, k.max(axis=0), depths, strict=True):
        if depth > 0.0:
            yield hull[int(own)], fixed[int(still)], float(stops[pose]), float(depth)
