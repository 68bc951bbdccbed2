"""The grasp: the finger gap that the scan leaves free and colliders fill, and the test that a gripper holds the part."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from s2a.certify.contents import Contents
from s2a.certify.physics import MujocoWorld
from s2a.core.bounds import Fraction, NotNegative, Numbers, Positive
from s2a.motion.trajectory import STRAIGHT_APPROACH
from s2a.robot.spec import GripperSpec
from s2a.scan.visuals import visible
from s2a.scene.geometry.front_panel import fraction_inside
from s2a.scene.geometry.mesh_ops import keep, merge, sample
from s2a.scene.geometry.mesh_query import RayMesh, first_hits, nearest_faces, ray_mesh
from s2a.scene.scene import Mesh
from s2a.scene.usd.stage import read_attribute, read_mesh, world_pose
from s2a.sim.world import OPPOSED, touched

MARGIN = 0.002  # [m] Accuracy of a scan: points nearer to its surface count as occupied
# [m] Length of the gripper body's swept volume before the grasp: its own depth and its straight approach
APPROACH = 0.2
BLOCKED = 0.005  # [m] Penetration depth of the gripper body that is more than the scan's roughness
POINTS = 1500  # Samples on either side


@dataclass(frozen=True)
class GapConfig:
    """Bounds on the finger gap."""

    min_free_fraction: Fraction = 0.9  # free fraction of each finger's space in the scan from which a part is graspable
    max_fill_ratio: Fraction = 0.01  # gap fill ratio from which colliders block the fingers


@dataclass(frozen=True)
class Gap:
    """The finger gap at the grasp."""

    free_fraction: float  # of each finger's space, free as scanned; the minimum of both, 0 to 1
    fill_ratio: float  # fraction of the free space that colliders fill, 0 to 1; NaN where nothing is free
    thickness: float  # of the region between the fingers, or of closed fingers within it [m]
    max_opening: float  # of the gripper [m]
    # max depth of scanned surfaces in the path of the gripper body [m], and the name of the deepest
    body_penetration: tuple[float, str] = (0.0, "")

    def graspable(self, config: GapConfig) -> bool:
        """The fingers of a parallel gripper fit, by the scan alone."""
        return self.free_fraction >= config.min_free_fraction and self.thickness < self.max_opening

    def reasons(self, config: GapConfig) -> list[str]:
        """Return in words why no parallel gripper could hold the region, as scanned; empty where one could."""
        texts = [self.blocked] if self.blocked else []
        if not self.thickness < self.max_opening:
            texts.append(
                f"the region is {1000 * self.thickness:.0f} mm thick, the gripper opens {1000 * self.max_opening:.0f}"
            )
        elif not self.free_fraction >= config.min_free_fraction:
            texts.append(f"the scan leaves {self.free_fraction:.0%} of the fingers' space beside the region free")
        return texts

    @property
    def blocked(self) -> str:
        """Message about a scanned obstacle in the path of the gripper body; empty if there is none."""
        depth, name = self.body_penetration
        return (
            f"{name} is {1000 * depth:.0f} mm deep in the path of the gripper body, as scanned"
            if depth > BLOCKED
            else ""
        )


def gap(path: Path, held: Contents, gripper: GripperSpec) -> Gap:
    """Measure the finger gap beside the grasp region of a valid sim.usd.

    Of a recessed pull it is the space of closed fingers within it. A point there is free as scanned if a straight line along
    the gripper's approach reaches it without meeting the scan.
    """
    assert held.target is not None
    site = held.target.GetChild("grasp")
    origin, orientation = world_pose(site)
    frame = Rotation.from_quat(orientation).as_matrix()
    region = (sample(read_mesh(held.target.GetChild("region")), 20000, seed=0) - origin) @ frame
    here = region[np.abs(region[:, 0]) < gripper.finger_box[0] / 2]
    if len(here) < 50:
        return Gap(0.0, float("nan"), float("nan"), gripper.max_opening)
    (low, face), (high, _) = np.quantile(here[:, 1:], [0.02, 0.98], axis=0)
    scene = visible(path)
    colliders = [mesh for _, mesh in scene.colliders if _near(mesh, origin)]
    whole = merge(list(scene.surfaces.values()))
    surface = ray_mesh(whole.vertices, whole.faces)
    thick, deep, starts = float(high - low), min(face, 0.0), ((low - MARGIN, -1.0), (high + MARGIN, 1.0))
    if read_attribute(site, "internal", bool, False):  # closed, in the middle; as thick as they are
        thick, deep, starts = 2 * gripper.finger_box[1], 0.0, ((0.0, -1.0), (0.0, 1.0))
    sides = [_fill(start, (deep, gripper.tip_ahead), gripper) for start in starts]
    free = [_reached(points, surface, origin, frame) for points in sides]
    open_points = np.concatenate([points[mask] for points, mask in zip(sides, free, strict=True)])
    filled = fraction_inside(colliders, origin + open_points @ frame.T) if len(open_points) else float("nan")
    penetration = max((_body_penetration(mesh, origin, frame, gripper), name) for name, mesh in scene.surfaces.items())
    return Gap(float(min(mask.mean() for mask in free)), filled, thick, gripper.max_opening, penetration)


def _body_penetration(mesh: Mesh, origin: np.ndarray, frame: np.ndarray, gripper: GripperSpec) -> float:
    """Return how deep a surface is in the box that the gripper body sweeps on its approach [m]."""
    corners = mesh.vertices[mesh.faces]
    width, height, end = gripper.body_box[0] / 2, gripper.body_box[1] / 2, -gripper.body_behind
    reach = APPROACH + height
    near = ((corners.min(axis=1) < origin + reach) & (corners.max(axis=1) > origin - reach)).all(axis=1)
    if not mesh.face_areas[near].any():
        return 0.0
    places = (sample(keep(mesh, near), 50000, seed=0) - origin) @ frame
    room = np.stack([width - np.abs(places[:, 0]), height - np.abs(places[:, 1]), end - places[:, 2]], axis=1)
    within = places[:, 2] > end - APPROACH
    return float(max(0.0, room.min(axis=1)[within].max(initial=0.0)))


def _fill(start: tuple[float, float], depth: tuple[float, float], gripper: GripperSpec) -> np.ndarray:
    """Return points of a fingertip beside the region, in the grasp frame [m], shape [point 3]."""
    y, side = start
    unit = np.random.default_rng(0).uniform(size=(POINTS, 3))
    x = (unit[:, 0] - 0.5) * gripper.finger_box[0]
    return np.stack(
        [x, y + side * unit[:, 1] * gripper.finger_box[1], depth[0] + unit[:, 2] * (depth[1] - depth[0])], axis=1
    )


def _reached(points: np.ndarray, surface: RayMesh, origin: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """Return which points of the grasp frame a line along the approach reaches with a margin, shape [point], bool."""
    away = 0.15
    starts = origin + (points - [0.0, 0.0, away]) @ frame.T
    directions = np.tile(frame[:, 2], (len(points), 1))
    distance = first_hits(surface, starts, directions)
    return distance > away + MARGIN


def _near(mesh: Mesh, origin: np.ndarray, reach: float = 0.15) -> bool:
    low, high = mesh.bounds
    return bool(((low < origin + reach) & (high > origin - reach)).all())


# [N] Force with which a finger counts as pressing; [m] distance of a contact from the region that it is on. Those of
# the tasks' files, `contact_force` and `contact_distance`, which a check of the room alone does not read
PRESS_FORCE, ON_REGION = 1.0, 0.005


@dataclass(frozen=True)
class GripConfig:
    """Settings of the grasp-hold test."""

    approach: Positive = STRAIGHT_APPROACH  # length of the straight approach [m]
    # how far the point between the pads goes past the grasp point [m]; the first that holds counts
    depths: Numbers = (0.0, 0.005, -0.005)
    # clearance on either side of the region's thin section to which the fingers open before the approach [m],
    # besides fully open
    margins: tuple[float, ...] = (0.012,)
    max_penetration: NotNegative = 0.001  # of the open gripper on its approach [m]
    # how far the part is open meanwhile, as displacement of the grasp point [m]; at most half of its range
    opened: NotNegative = 0.05
    force: Positive = 30.0  # of each closing finger [N]; the Franka Hand holds with up to 70 N
    # of each finger as it closes, at most the gripper's [m/s]: a faster one digs into the hulls before it stops, and where two
    # of them meet it then counts as wedged between them
    speed: Positive = 0.005
    damping: NotNegative = 100.0  # of each closed finger [N s/m]
    gear: NotNegative = 20000.0  # how stiffly the closed fingers resist moving to one side together [N/m]
    close_time: Positive = 0.4  # after the fingers could have closed [s]
    pull: NotNegative = 20.0  # along the joint, towards its closed end, while the gripper stands still [N]
    pull_time: Positive = 1.0  # how long [s]
    slip: NotNegative = 0.002  # how far the part may move meanwhile [m]
    # time step [s]; short, because at the steps of training MuJoCo's soft friction creeps by millimetres
    dt: Positive = 0.001


@dataclass(frozen=True)
class GripTest:
    """Result of one attempt."""

    # The gripper reached the grasp, its fingers press on the region from opposed sides, and the part did not slip
    holds: bool
    message: str  # description of the attempt
    slip: float | None  # how far the part moved under the pull [m]; None without a pull
    prim: str  # path of the collider in collision, or of the region


def grip(world: MujocoWorld, config: GripConfig) -> GripTest:
    """Try the depths and finger openings in turn; return the first attempt that holds, else the one that came farthest."""
    # What turns about the grasp point itself opens without displacement: there half of the range counts alone.
    travel = config.opened / world.lever_arm if world.lever_arm > 0.0 else math.inf
    q = world.sign * min(travel, 0.5 * max(map(abs, world.stage.joint.limits)))
    thin, gripper = float(world.stage.grasp_size[1]), world.robot.gripper
    finger_openings = [gripper.finger_joint_open, *(gripper.coordinate(thin + 2 * each) for each in config.margins)]
    if world.stage.internal:  # the fingers go into the pocket closed
        finger_openings = [0.0]
    attempts = []
    for depth in config.depths:
        attempt = _first_approach(world, q, depth, finger_openings, config)
        attempts.append(attempt)
        if attempt.holds:
            return attempt
    return max(attempts, key=lambda attempt: attempt.slip is not None)


def _first_approach(
    world: MujocoWorld, q: float, depth: float, finger_openings: list[float], config: GripConfig
) -> GripTest:
    """Return the attempt with the widest opening with which the gripper reaches a depth."""
    blocked = []
    for opening in finger_openings:
        # In the closed pose, where the furniture is nearest, and where the part stands open for the pull.
        collisions = [_obstacle(world, at, depth, opening, config) for at in (0.0, q)]
        if not any(collisions):
            return _hold(world, q, depth, opening, config)
        blocked.append(next(collision for collision in collisions if collision))
    prim, into = min(blocked, key=lambda collision: collision[1])
    return GripTest(False, f"the open gripper penetrates {prim} by {1000 * into:.1f} mm on its approach", None, prim)


def _obstacle(
    world: MujocoWorld, q: float, depth: float, opening: float, config: GripConfig
) -> tuple[str, float] | None:
    """Return the deepest collision of the open gripper on its straight approach, path and depth [m]; None without."""
    gripper = world.geoms(world.robot.gripper.body, *world.robot.gripper.links)
    obstacles = world.geoms(world.stage.target, world.carrier, "static")
    data = world.data(q, opening)
    worst, prim = config.max_penetration, ""
    for short in np.linspace(config.approach, 0.0, 11):
        world.place_gripper(data, _gripper_pose(world, q, depth - short))
        into, _, other = world.deepest(data, gripper, obstacles)
        if into > worst:
            worst, prim = into, world.labels[other]
    return (prim, worst) if prim else None


def _hold(world: MujocoWorld, q: float, depth: float, opening: float, config: GripConfig) -> GripTest:
    """Close the fingers on the part, or spread them within it, pull it, and measure its slip.

    Its weight is carried until the gripper has closed, since a lid would fall shut before; then the gripper carries it, and
    the pull. Each finger closes by itself, as a compliant arm lets them; then they are geared to each other, as the gripper's
    are, and it stands still: equal forces alone would follow a load from one finger to the other.
    """
    stage, joint, fingers, dofs = world.stage, world.joint, world.fingers, world.finger_dofs
    data, gripper = world.data(q, opening), world.robot.gripper
    ratio, speed = gripper.ratio, min(gripper.finger_speed, config.speed / gripper.ratio)
    world.mj.opt.timestep, world.mj.dof_damping[dofs] = config.dt, config.force * ratio / speed
    world.place_gripper(data, _gripper_pose(world, q, depth))
    pull, towards = -world.sign * config.pull * world.lever_arm, 1.0 if stage.internal else -1.0

    mujoco.mj_forward(world.mj, data)

    def run(seconds: float, torque: float, gear: float = 0.0, carried: bool = False) -> None:
        closed = data.qpos[fingers].copy()
        for _ in range(round(seconds / config.dt)):
            moved = data.qpos[fingers] - closed
            data.qfrc_applied[dofs] = towards * config.force * ratio - gear * ratio**2 * (moved - moved.mean())
            data.qfrc_applied[world.dof] = torque + carried * data.qfrc_bias[world.dof]
            mujoco.mj_step(world.mj, data)

    region = f"/scene/{stage.target}/region"
    grips = "opens" if stage.internal else "closes"
    run(gripper.finger_joint_open / speed + config.close_time, 0.0, carried=True)
    if missing := _missing(world, data):
        between = f"the gripper {grips} to {1000 * ratio * data.qpos[fingers].sum():.0f} mm, but {missing}"
        return GripTest(False, between, None, region)
    world.mj.dof_damping[dofs] = config.damping * ratio**2
    before, width = float(data.qpos[joint]), ratio * float(data.qpos[fingers].sum())
    run(config.pull_time, pull, config.gear)
    slip = abs(float(data.qpos[joint]) - before) * world.lever_arm
    word = f"{1000 * width:.0f} mm between the fingers; {config.pull:g} N for {config.pull_time:g} s move it {1000 * slip:.1f} mm"
    return GripTest(bool(slip <= config.slip), word, slip, region)


def _missing(world: MujocoWorld, data: mujoco.MjData) -> str:
    """Return in words why the fingers do not pinch the region; empty where both press on it from opposed sides.

    Not the whole rule of the tasks' metrics (`is_grasped`): there one finger is enough for a region wider than the gripper opens,
    and nothing else of the robot may push the part harder.
    """
    surface = touched(world.stage)
    region = ray_mesh(surface.vertices, surface.faces)
    pressed, normals = np.zeros(2), np.zeros((2, 3))
    for k, finger in enumerate(world.robot.gripper.links):
        for at, normal, force in _contacts(world, data, finger):
            if nearest_faces(region, at[None], ON_REGION)[0][0] >= 0:
                pressed[k] += force
                normals[k] += force * normal
    if (pressed < PRESS_FORCE).any():
        return (
            f"{'neither finger presses' if (pressed < PRESS_FORCE).all() else 'only one finger presses'} on the region"
        )
    cosine = float(normals[0] @ normals[1] / np.linalg.norm(normals, axis=1).prod())
    if cosine < OPPOSED:
        return ""
    apart, needed = (math.degrees(math.acos(min(max(each, -1.0), 1.0))) for each in (cosine, OPPOSED))
    return f"the forces of its fingers are {apart:.0f} degrees apart, less than {needed:.0f}"


def _contacts(world: MujocoWorld, data: mujoco.MjData, finger: str) -> Iterator[tuple[np.ndarray, np.ndarray, float]]:
    """Yield a finger's contacts with the target: place in its body's frame [m], direction of the force on it, force [N]."""
    one, other, force = set(world.geoms(finger)), set(world.geoms(world.stage.target)), np.zeros(6)
    for i, contact in enumerate(data.contact):
        first, second = contact.geom1, contact.geom2
        if not ((first in one and second in other) or (second in one and first in other)):
            continue
        mujoco.mj_contactForce(world.mj, data, i, force)
        body = world.mj.geom_bodyid[second if second in other else first]
        at = (contact.pos - data.xpos[body]) @ data.xmat[body].reshape(3, 3)
        # The force acts on the second geom, along the frame's first row from the first to the second.
        yield at, contact.frame[:3] * (1.0 if second in other else -1.0), float(force[0])


def _gripper_pose(world: MujocoWorld, q: float, inwards: float) -> np.ndarray:
    """Return the gripper body's pose, 7-vector, with the tool frame's origin `inwards` [m] past the grasp point."""
    grasp = world.grasp_pose(q)
    offset = np.array([0.0, 0.0, inwards]) - world.robot.tool_offset
    return np.concatenate([grasp[:3] + Rotation.from_quat(grasp[3:]).apply(offset), grasp[3:]])
