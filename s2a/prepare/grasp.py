"""The grasp of a part, free of collisions, and the heading of a robot that opens it."""

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from s2a import robot
from s2a.core.errors import InputError
from s2a.motion.obstacles import Obstacles
from s2a.motion.trajectory import STRAIGHT_APPROACH
from s2a.robot.collision import RobotShape, robot_shape
from s2a.robot.spec import GripperSpec, RobotSpec
from s2a.scan.evidence.surface import HOLE_REACH
from s2a.scene.articulation import opening_direction
from s2a.scene.geometry.bar import bar_profile
from s2a.scene.geometry.front_panel import Pocket, find_pocket, front_behind
from s2a.scene.geometry.mesh_ops import centroids, extents, merge, normals
from s2a.scene.geometry.simplify import is_structure
from s2a.scene.scene import Joint, Mesh, Scene, Vec3, problems
from s2a.scene.usd.sim_scene import DEFAULT_ROBOT, Grasp, Quat

ROUND = 1.5  # A grasp region whose section is less elongated than this can be held at any gripper roll
# [degrees] Rolls about the approach, the preferred one first: the fingers close along the vertical
TURNS = (0, 90, 45, -45)
SEARCH_RADIUS = 0.4  # [m] Radius of the gripper around the grasp in plan
BETTER = 0.005  # [m] Another roll or side has to penetrate the room by so much less: scans are rough
SLICES = 12  # Places along a bar at which its thickness is measured
ROOM = 0.003  # [m] Between closed fingers and the walls of a pocket on either side: a scan's are off by so much
OFF_FLOOR = 0.0015  # [m] Between the fingertips and a pocket's floor
FLOOR = ("floor", "floors")  # Last words of a label that make it the floor's


def find_grasp(scene: Scene, target: str, spec: RobotSpec | None = None, approach: float = STRAIGHT_APPROACH) -> Grasp:
    """Return the grasp of a movable part: point, frame and extents of its annotated region.

    The gripper approaches in the direction in which the part closes; if it would collide there, and the region is a bar,
    from another side of the bar. A recessed pull is held from within, where closed fingers fit into it and reach its walls.

    Args:
        scene: the room.
        target: id of the part.
        spec: the robot; None: the Panda.
        approach: straight path before the grasp that has to be free [m].

    Raises:
        InputError: the part is unknown, does not move, or has no surface.
    """
    point = scene.grasp_point(target)
    region = merge([scene.parts[i].mesh for i in scene.handle_parts(target)])
    spec = spec or robot.load(DEFAULT_ROBOT)
    shape = robot_shape(spec)
    first = _grasp(point, region, -opening_direction(scene.joint(target), point))
    if (internal := _internal(scene, target, region, first, spec.gripper)) is not None:
        return internal
    if is_round(first):
        return free_roll(scene, target, first, shape, approach)
    across = Rotation.from_quat(first.orientation).as_matrix()[:, 1]
    sides = (_grasp(point, region, side) for side in (-across, across))
    return free_side(scene, target, first, sides, shape, approach)


def _grasp(point: np.ndarray, region: Mesh, inwards: np.ndarray) -> Grasp:
    """Return the grasp of a region at a point [m] by a gripper that approaches along `inwards`."""
    frame = grasp_frame(region, inwards)
    size = np.subtract(*extents(region, frame)[::-1])
    profile = bar_profile(region, frame, SLICES)
    if profile is not None:
        size[1] = profile.thickness
    return Grasp(_vec3(point), _quat(frame), _vec3(size), region)


def _internal(scene: Scene, target: str, region: Mesh, grasp: Grasp, gripper: GripperSpec) -> Grasp | None:
    """Return the grasp from within of a region that lines a pocket of the front, None where it does not, or no gripper fits."""
    front = scene.parts[target].mesh
    if target in scene.handle_parts(target) or not len(front.faces):
        return None
    frame = Rotation.from_quat(grasp.orientation).as_matrix()
    plane = front_behind(front, region, frame)
    pocket = None if plane is None else find_pocket(region, frame, plane)
    side = None if pocket is None else spread_side(pocket, gripper)
    if pocket is None or side is None:
        return None
    x, y, z = pocket.frame.T
    turned = np.stack([x, y, z] if side == 1 else [-y, x, z], axis=1)
    size = (*(pocket.size if side == 1 else pocket.size[::-1]), pocket.depth)
    point = pocket.center + (pocket.depth - OFF_FLOOR - gripper.tip_ahead) * z
    return Grasp(_vec3(point), _quat(turned), _vec3(np.array(size)), region, internal=True)


def spread_side(pocket: Pocket, gripper: GripperSpec) -> int | None:
    """Return along which side of a pocket a gripper's fingers spread, the shorter one (1) first; None: it fits neither way."""
    width, closed = gripper.finger_box[0], 2 * gripper.finger_box[1]
    for side in (1, 0):
        along, across = pocket.size[side], pocket.size[1 - side]
        if closed + 2 * ROOM <= along <= closed + gripper.max_opening - 2 * ROOM and across >= width + 2 * ROOM:
            return side
    return None


def grasp_frame(region: Mesh, inwards: np.ndarray) -> np.ndarray:
    """Return a rotation [3 3]: x along the region, y across its thin section, z into the furniture."""
    middle = centroids(region)
    flat = np.eye(3) - np.outer(inwards, inwards)
    centred = (middle - np.average(middle, axis=0, weights=region.face_areas)) @ flat
    spread, axes = np.linalg.eigh((centred * region.face_areas[:, None]).T @ centred)
    # The smallest spread lies along `inwards`, from which it was projected out; the next is the thin direction.
    order = np.argsort(np.abs(axes.T @ inwards))
    thin, wide = sorted(order[:2], key=lambda i: spread[i])
    upright = flat @ [0.0, 0.0, 1.0]
    is_round = spread[wide] < ROUND**2 * spread[thin] and np.linalg.norm(upright) > 0.1
    y = upright if is_round else flat @ axes[:, thin]
    y /= np.linalg.norm(y)
    if y[2] < -1e-6 or (abs(y[2]) <= 1e-6 and y[0] < 0):
        y = -y
    return np.stack([np.cross(y, inwards), y, inwards], axis=1)


def heading(scene: Scene, target: str) -> np.ndarray:
    """Return the level unit direction (x, y) in which a robot before the handle of a part faces it."""
    point = scene.grasp_point(target)
    outwards = opening_direction(scene.joint(target), point)
    if math.hypot(outwards[0], outwards[1]) < 0.3:  # a lid opens upwards: stand before the middle of its front edge
        outwards = point - np.nanmean(scene.parts[target].mesh.bounds, axis=0)
    length = math.hypot(outwards[0], outwards[1])
    return -outwards[:2] / length if length > 1e-6 else np.array([-1.0, 0.0])


def floor_points(scene: Scene) -> np.ndarray:
    """Return points of the floor [m], of the parts labelled so, shape [point 3], by increasing x; none where no part is."""
    floors = merge([part.mesh for part in scene.parts.values() if is_structure(part.label, FLOOR)])
    level = centroids(floors)[normals(floors)[:, 2] > 0.5]
    return level[np.argsort(level[:, 0], kind="stable")]


def lowest_point(scene: Scene) -> np.ndarray:
    """Return a point at a room's lowest height [m], shape [1 3], which stands for a floor that nobody labelled."""
    return np.array([[0.0, 0.0, np.nanmin([part.mesh.bounds[0, 2] for part in scene.parts.values()])]])


def floor_height(floor: np.ndarray, place: np.ndarray, radii: Sequence[float] = (0.4, HOLE_REACH)) -> float:
    """Return the height [m] of the floor's points around a place (x, y), or of all where there are none.

    Args:
        floor: the points [m], by increasing x, shape [point 3].
        place: (x, y) [m].
        radii: what counts as around [m]; the next one where there are no points within the one before.
    """
    for radius in radii:
        first, last = np.searchsorted(floor[:, 0], [place[0] - radius, place[0] + radius])
        strip = floor[first:last]
        near = strip[np.linalg.norm(strip[:, :2] - place, axis=1) < radius]
        if len(near):
            return float(np.median(near[:, 2]))
    return float(np.median(floor[:, 2]))


def is_round(grasp: Grasp) -> bool:
    """Return whether a grasp's region can be held at any gripper roll."""
    along, across, _ = grasp.size
    return max(along, across) < ROUND * min(along, across)


def free_roll(scene: Scene, target: str, grasp: Grasp, shape: RobotShape, approach: float) -> Grasp:
    """Return a grasp of what is round, rolled about its approach if the gripper would otherwise collide with the room."""
    near = Obstacles.of_scan(scene, np.array(grasp.point), SEARCH_RADIUS).without((target, *scene.descendants(target)))
    return _collision_free(near, shape, approach, grasp, (_rolled(grasp, turn) for turn in TURNS[1:]))


def free_side(
    scene: Scene, target: str, grasp: Grasp, others: Iterable[Grasp], shape: RobotShape, approach: float
) -> Grasp:
    """Return a grasp, or one from another side if the gripper would otherwise collide with anything beside its grasp region."""
    near = Obstacles.of_scan(scene, np.array(grasp.point), SEARCH_RADIUS).without(scene.handle_parts(target))
    return _collision_free(near, shape, approach, grasp, others)


def _collision_free(
    near: Obstacles, shape: RobotShape, approach: float, grasp: Grasp, others: Iterable[Grasp]
) -> Grasp:
    """Return a grasp, or another one with a clearly smaller penetration depth on its approach."""
    depth = _depth(near, shape, approach, grasp)
    if depth <= BETTER:  # as almost always: then the others are not even made
        return grasp
    depths, grasps = zip(*((_depth(near, shape, approach, other), other) for other in others), strict=True)
    best = int(np.argmin(depths))
    return grasps[best] if depths[best] < depth - BETTER else grasp


def _rolled(grasp: Grasp, degrees: float) -> Grasp:
    """Return a grasp with its frame turned about the approach, and its extents with it."""
    if not degrees:
        return grasp
    turn = Rotation.from_quat(grasp.orientation) * Rotation.from_euler("z", degrees, degrees=True)
    x, y, z, w = map(float, turn.as_quat(canonical=True))
    points = turn.inv().apply(grasp.region.vertices[grasp.region.faces.ravel()])
    along, across = np.ptp(points[:, :2], axis=0) if degrees % 90 else (grasp.size[1], grasp.size[0])
    return replace(grasp, orientation=(x, y, z, w), size=(float(along), float(across), grasp.size[2]))


def _depth(near: Obstacles, shape: RobotShape, approach: float, grasp: Grasp) -> float:
    """Return the penetration depth of the open gripper in the obstacles on its straight approach [m]."""
    turn = Rotation.from_quat(grasp.orientation)
    back = np.linspace(0.0, approach, 6)[:, None, None] * np.array([0.0, 0.0, 1.0])
    centers = turn.apply((shape.gripper[None] - back).reshape(-1, 3)) + grasp.point
    return near.deepest(centers, np.tile(shape.gripper_radii, 6))[0]


def _vec3(values: np.ndarray) -> Vec3:
    x, y, z = map(float, values)
    return x, y, z


def _quat(frame: np.ndarray) -> Quat:
    x, y, z, w = map(float, Rotation.from_matrix(frame).as_quat(canonical=True))
    return x, y, z, w


@dataclass(frozen=True)
class Target:
    """An articulated part."""

    id: str  # of the part
    joint: Joint  # how it moves, scene coordinates
    grasp: Grasp  # where a gripper takes hold of it
    grasp_parts: tuple[str, ...]  # ids of the parts that make up the grasp region
    base_plate: str | None  # id of the part that these are fixed to, if that is another one than the target; else None
    # surface of each part of its body by id, the target first; nested articulated parts are bodies of their own
    surfaces: dict[str, Mesh]
    carried: Mesh  # surface of all that moves when its joint does, nested articulated parts included
    # surface of the object that it belongs to, without that of the object's parts; empty if it is an object itself
    cabinet: Mesh

    @cached_property
    def frame(self) -> np.ndarray:
        """The grasp frame's axes as columns, shape [3 3]: z into the furniture."""
        return Rotation.from_quat(self.grasp.orientation).as_matrix()

    @cached_property
    def point(self) -> np.ndarray:
        """The grasp point [m], shape [3]."""
        return np.array(self.grasp.point)

    @property
    def front(self) -> Mesh:
        """The part's own surface."""
        return self.surfaces[self.id]

    @property
    def surface(self) -> Mesh:
        """The surface of its body."""
        return merge(list(self.surfaces.values()))


def find_target(
    scene: Scene,
    part: str,
    members: Sequence[str] | None = None,
    grasp: Grasp | None = None,
    spec: RobotSpec | None = None,
    approach: float = STRAIGHT_APPROACH,
) -> Target:
    """Return an articulated part of a scene.

    Args:
        scene: the room.
        part: its id.
        members: ids of the parts of its body, itself first; None: all below it that hang on no joint of their own.
        grasp: where to grasp it, where that is known already.
        spec: the robot that grasps it; None: the Panda.
        approach: straight path before the grasp [m]; see `find_grasp`.

    Raises:
        InputError: the part is unknown, does not move, has limits that no robot can use, or has no surface.
    """
    joint, grasp = target_joint(scene, part), grasp or find_grasp(scene, part, spec, approach)
    held, root = scene.handle_parts(part), scene.root(part)
    plate = scene.parts[held[0]].parent
    return Target(
        id=part,
        joint=joint,
        grasp=grasp,
        grasp_parts=held,
        base_plate=plate if plate != part and held[0] != part else None,
        surfaces={i: scene.parts[i].mesh for i in members or scene.members(part)},
        carried=merge([scene.parts[i].mesh for i in (part, *scene.descendants(part))]),
        cabinet=merge([]) if root == part else scene.parts[root].mesh,
    )


def target_joint(scene: Scene, target: str) -> Joint:
    """Return the joint of a part that a robot is to move.

    Raises:
        InputError: the part is unknown, does not move, or its limits leave out the scanned pose, in which every episode
            begins (the joint would throw the part open), or are too near or too far apart for any furniture.
    """
    joint = scene.joint(target)
    if wrong := problems(joint.kind, *joint.limits):
        raise InputError(
            f"part {target!r} of scene {scene.name!r}: {' and '.join(wrong)}; correct rangeMin and rangeMax in the scan's "
            "annotation (metres or radians from the scanned pose) and run s2a export again"
        )
    return joint


def bodies(scene: Scene, articulated: Collection[str]) -> dict[str, str | None]:
    """Return the body that each part of a scene belongs to; None for the static room.

    A body is an articulated part with what is fixed to it, or the object that such parts belong to with all its others;
    joints that are not among the `articulated` are frozen.
    """
    roots = {scene.root(i) for i in articulated}
    owners: dict[str, str | None] = {}
    for i, part in scene.parts.items():  # parents before children
        above = None if part.parent is None else owners[part.parent]
        owners[i] = i if i in articulated or (part.parent is None and i in roots) else above
    return owners


def parent_body(scene: Scene, part: str, owners: dict[str, str | None]) -> str:
    """Return the body that an articulated part moves against: an anchor of its own if it is an object itself."""
    above = scene.parts[part].parent
    return f"{part}_anchor" if above is None else str(owners[above])
