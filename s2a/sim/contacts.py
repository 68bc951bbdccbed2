"""Contact forces between the robot's links and one body of every world, by link and by region of the surface.

The gripper's pads are the fingers' links. A contact belongs to where it lies, whatever collider carries it.
"""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import mujoco_warp
import numpy as np
import warp as wp

from s2a.scene.scene import Mesh
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
