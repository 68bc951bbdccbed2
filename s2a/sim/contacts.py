"""Contacts: forces between the robot's links and one body of every world, by link and region; depths at which bodies overlap.

The gripper's pads are the fingers' links. A contact belongs to where it lies, whatever collider carries it.
"""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import mujoco
import mujoco_warp
import newton
import numpy as np
import warp as wp
from scipy.spatial.transform import Rotation

from s2a.scene.articulation import transform
from s2a.scene.geometry.convex import sections
from s2a.scene.scene import Joint, Mesh
from s2a.scene.usd.sim_scene import Collider, SimBody
from s2a.sim.simulation import Simulation
from s2a.sim.world import touched

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

    def __init__(self, sim: Simulation, distance: float) -> None:
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


def _owners(sim: Simulation) -> np.ndarray:
    """Return what each MuJoCo geom of a world belongs to, shape [world geom]: LEFT, RIGHT, LINK, PART, or -1."""
    bodies = sim.model.body_count // sim.num_envs
    of_body = np.full(bodies + 1, -1)  # the last entry stands for the immovable room
    of_body[list(sim.layout.robot_bodies)], of_body[sim.layout.part_body] = LINK, PART
    of_body[list(sim.layout.finger_bodies)] = LEFT, RIGHT
    shapes = sim.solver.mjc_geom_to_newton_shape.numpy()
    body = sim.model.shape_body.numpy()[shapes]
    return np.where((shapes >= 0) & (body >= 0), of_body[np.where(body >= 0, body % bodies, bodies)], -1)


STATIC = "static"  # Id of the static room
POSES = 33  # Coordinates of a joint at which overlaps are measured, closer to each other near the scanned pose
REACH_STEP = 0.1  # [rad] Section of a turn whose bounds tell which hulls it may meet

# Hulls that move, hulls that stay, poses of the first [pose 4 4], and the gap [m] up to which pairs are reported ->
# of each pose the pairs by index, with their depth [m], negative where there is a gap
Engine = Callable[[Sequence[Mesh], Sequence[Mesh], np.ndarray, float], Iterator[list[tuple[int, int, float]]]]


@dataclass(frozen=True)
class OverlapDepth:
    """Deepest overlap of an articulated part and another body that stands at its scanned pose, no pair filtered."""

    rest: float  # at the scanned pose [m]; negative: a gap
    travel: float  # anywhere between the joint's limits [m]
    q: float  # the coordinate of that [m] or [rad]


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

    def carried(self, part: str) -> list[str]:
        """Return a part and those that move with it."""
        group = [part]
        for body in group:
            group += [child for child, parent in self.parents.items() if parent == body]
        return group

    def overlaps(self, part: str, engine: Engine | None = None, within: float = 0.0) -> dict[str, OverlapDepth]:
        """Return how deep a part, and what it carries, overlaps other bodies, by their ids; of STATIC all that does not move.

        Args:
            part: the articulated part; all others stand at their scanned poses.
            engine: measures depths; None: MuJoCo's exact depth of convex hulls.
            within: gaps up to this are reported too [m].
        """
        joint, group = self.joints[part], self.carried(part)
        near, far = sorted(joint.limits, key=abs)
        steps = np.linspace(0.0, 1.0, POSES) ** 2
        stops = np.unique([0.0, *(far * steps), *(near * steps)])
        poses = np.array([transform(joint, q) for q in stops])
        moving = [c.mesh for body in group for c in self.bodies[body].colliders]
        low, high = _reach(moving, joint) + [[-within], [within]]
        others = {i: body.colliders for i, body in self.bodies.items() if i not in group} | {STATIC: self.static}
        pool = [(i, c.mesh) for i, colliders in others.items() for c in colliders]
        pool = [each for each in pool if (each[1].bounds[0] < high).all() and (each[1].bounds[1] > low).all()]
        result: dict[str, OverlapDepth] = {}
        if not moving or not pool:
            return result
        depths = (engine or mujoco_depths)(moving, [mesh for _, mesh in pool], poses, within)
        for q, pairs in zip(stops.tolist(), depths, strict=True):
            for _, other, depth in pairs:
                last = result.get(pool[other][0], OverlapDepth(-np.inf, -np.inf, q))
                rest = max(last.rest, depth) if q == 0.0 else last.rest
                deeper = depth > last.travel
                result[pool[other][0]] = OverlapDepth(rest, *((depth, q) if deeper else (last.travel, last.q)))
        return result


def mujoco_depths(
    moving: Sequence[Mesh], others: Sequence[Mesh], poses: np.ndarray, within: float
) -> Iterator[list[tuple[int, int, float]]]:
    """Yield the pairs of convex hulls that are nearer than a gap, by MuJoCo's distance of convex bodies (an `Engine`)."""
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="part", mocap=True)
    for k, mesh in enumerate((*moving, *others)):
        asset = spec.add_mesh(name=str(k))
        asset.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        asset.uservert, asset.userface = mesh.vertices.astype(np.float64).ravel(), mesh.faces.ravel()
        owner = body if k < len(moving) else spec.worldbody
        owner.add_geom(name=str(k), type=mujoco.mjtGeom.mjGEOM_MESH, meshname=str(k))
    model = spec.compile()
    data = mujoco.MjData(model)
    geoms = np.array([model.geom(str(k)).id for k in range(len(moving) + len(others))])
    mine, theirs = geoms[: len(moving)], geoms[len(moving) :]
    reach = model.geom_rbound[mine][:, None] + model.geom_rbound[theirs] + within
    for pose in poses:
        data.mocap_pos[0], data.mocap_quat[0] = pose[:3, 3], np.roll(Rotation.from_matrix(pose[:3, :3]).as_quat(), 1)
        mujoco.mj_kinematics(model, data)
        apart = np.linalg.norm(data.geom_xpos[mine][:, None] - data.geom_xpos[theirs], axis=2)
        pairs = []
        for i, j in np.argwhere(apart < reach).tolist():
            depth = -mujoco.mj_geomDistance(model, data, int(mine[i]), int(theirs[j]), max(within, 1e-6), None)
            if depth > -max(within, 1e-9):
                pairs.append((i, j, depth))
        yield pairs


def newton_depths(
    moving: Sequence[Mesh], others: Sequence[Mesh], poses: np.ndarray, within: float
) -> Iterator[list[tuple[int, int, float]]]:
    """Yield the pairs of convex hulls that are nearer than a gap [m], by Newton's own contacts (an `Engine`)."""
    with wp.ScopedDevice("cpu"):
        builder = newton.ModelBuilder()
        builder.default_shape_cfg.margin, builder.default_shape_cfg.gap = 0.0, max(within, 1e-6)
        body = builder.add_body()
        for k, mesh in enumerate((*moving, *others)):
            hull = newton.Mesh(mesh.vertices, mesh.faces.ravel(), compute_inertia=False)
            builder.add_shape_convex_hull(body if k < len(moving) else -1, mesh=hull)
        model = builder.finalize()
        pipeline = newton.CollisionPipeline(model, broad_phase="explicit")
        contacts, state = pipeline.contacts(), model.state()
    for pose in poses:
        state.body_q.assign([[*pose[:3, 3], *Rotation.from_matrix(pose[:3, :3]).as_quat()]])
        pipeline.collide(state, contacts)
        count = int(contacts.rigid_contact_count.numpy()[0])
        ends = [
            [getattr(contacts, f"rigid_contact_{name}{k}").numpy()[:count] for k in range(2)]
            for name in ("shape", "point")
        ]
        shapes, points = map(np.stack, ends)
        points = np.where((shapes < len(moving))[..., None], points @ pose[:3, :3].T + pose[:3, 3], points)
        depths = -((points[1] - points[0]) * contacts.rigid_contact_normal.numpy()[:count]).sum(axis=1)
        pairs = zip(*np.sort(shapes, axis=0).tolist(), depths.tolist(), strict=True)
        yield [(i, j - len(moving), depth) for i, j, depth in pairs if depth > -max(within, 1e-9)]


def _reach(meshes: Sequence[Mesh], joint: Joint) -> np.ndarray:
    """Return the lowest and highest corner of the paths of hulls [m], shape [2 3]."""
    points = [points for mesh in meshes for points in sections(mesh, joint, REACH_STEP)]
    low, high = (edge([edge(each, axis=0) for each in points], axis=0) for edge in (np.min, np.max)) if points else (
        np.full(3, np.inf), np.full(3, -np.inf)
    )  # fmt: skip
    return np.stack([low, high])
