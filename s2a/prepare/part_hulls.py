"""Convex hulls of an articulated part with a free finger gap, and of the furniture that it moves against."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from s2a.core.bounds import AtLeast, Count, CountFromZero, Positive
from s2a.core.cache import recall
from s2a.prepare.grasp import Target
from s2a.prepare.mass import annotated_mass, box_mass
from s2a.prepare.room_hulls import cut_all
from s2a.robot.spec import GripperSpec
from s2a.scene.articulation import opening_direction
from s2a.scene.geometry.bar import bar_hulls, bar_profile
from s2a.scene.geometry.convex import (
    box,
    clip,
    coacd_default,
    hull,
    one_hull,
    overlap,
    subtract,
    vhacd,
)
from s2a.scene.geometry.front_panel import (
    CLEARANCE,
    FingerSpace,
    Pocket,
    facing_frame,
    find_pocket,
    finger_space,
    front_behind,
    front_coordinate,
    patch,
    pocket_hulls,
    pocketed,
    reassign_border,
    slab,
)
from s2a.scene.geometry.knob import knob_hulls
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.sheet import before_wall, hidden_wall, sheet_hulls, sheet_opening, straight_sheet
from s2a.scene.scene import Joint, Mesh, Scene, pack, unpack
from s2a.scene.usd.sim_scene import Collider, Mass, SimBody

BLOCKED = 2e-4  # [m] A hull that reaches into the finger gap by a smaller ball than this leaves it free


@dataclass(frozen=True)
class ColliderConfig:
    """Settings of the target's convex decomposition.

    Attributes:
        method: "handle" (each part on its own, the grasp region finer, the finger gap kept free), "coacd" (the
            library's defaults on all parts fused) or "one_hull" (all parts in one convex hull; it fills the finger gap).
    """

    method: Literal["handle", "coacd", "one_hull"]
    # places along a bar-like handle at which its section is taken; similar neighbours become one hull
    bar_slices: Count = 24
    handle_hulls: Count = 12  # max number of hulls of a grasp region that is neither bar nor knob
    front_panel_hulls: Count = 8  # max number of hulls of each other part
    thickness: Positive = 0.02  # of the front, inwards from its outer surface, of which alone a scan knows [m]
    resolution: Count = 30000  # voxels of the decomposition
    max_vertices: Annotated[int, AtLeast(4)] = 32  # max number of vertices of a hull
    seed: CountFromZero = 0  # of the decomposition


@dataclass(frozen=True)
class Handle:
    """The handle of a part, and the front panel behind it."""

    frame: np.ndarray  # the grasp frame's axes as columns [3 3]: z into the furniture
    region: Mesh  # the grasp region, borders tidied
    # the front behind it as outward normal and offset [m]; None where none was scanned
    plane: tuple[np.ndarray, float] | None
    # where the line through the grasp point along z meets that plane: its coordinate on z [m]; without a plane
    # that of the grasp point
    front: float
    space: FingerSpace  # where the fingers go
    pocket: Pocket | None = None  # that the region lines, where it is a recessed pull


def find_handle(target: Target) -> tuple[Handle, dict[str, Mesh]]:
    """Return the handle at the grasp, and the tidied surface of every other part of the body, by id."""
    region, frame, point = target.grasp.region, target.frame, target.point
    others = {i: mesh for i, mesh in target.surfaces.items() if i not in target.grasp_parts}
    plane = front_behind(others[target.id], region, frame) if target.id in others else None
    if plane is None:
        return Handle(frame, region, None, float(point @ frame[:, 2]), FingerSpace(None, ())), others
    others[target.id], region = reassign_border(others[target.id], region, frame, plane)
    front = front_coordinate(plane, frame, point)
    pocket = find_pocket(region, frame, plane)
    if pocket is not None:
        return Handle(frame, region, plane, front, FingerSpace(None, ()), pocket), others
    return Handle(frame, region, plane, front, finger_space(region, point, frame, front)), others


def target_colliders(
    target: Target, handle: Handle, others: dict[str, Mesh], config: ColliderConfig
) -> tuple[Collider, ...]:
    """Return the convex hulls of an articulated part's body."""
    if config.method != "handle":
        fused = target.surface
        hulls = (
            one_hull(fused, config.max_vertices)
            if config.method == "one_hull"
            else coacd_default(fused, config.max_vertices, config.seed)
        )
        return tuple(Collider(target.id, piece) for piece in hulls)
    colliders = []
    plate = _plate(handle, others.get(target.base_plate or ""))
    for i, mesh in others.items():
        hulls = _front_panel_hulls(mesh, handle, config) if i == target.id else _rough_hulls(mesh, config)
        if handle.pocket is not None:
            hulls = [piece for whole in hulls for piece in pocketed(whole, handle.pocket)]
        if plate is not None and i == target.base_plate:  # noise and the handle's foot at its border stand out of it
            hulls = [piece for whole in hulls if (piece := clip(whole, *plate)) is not None]
        colliders += [Collider(i, piece) for piece in flatten(hulls, handle)]
    hulls = (
        _handle_hulls(handle, others.get(target.id), _ground(handle, plate), config)
        if handle.pocket is None
        else pocket_hulls(handle.pocket)
    )
    colliders += [Collider(target.grasp_parts[0], piece) for piece in free_fingers(hulls, handle.space)]
    return tuple(colliders)


def _front_panel_hulls(mesh: Mesh, handle: Handle, config: ColliderConfig) -> list[Mesh]:
    """Return a flat front as one slab; another shape as hulls, with what the handle hid from the scanner."""
    whole = slab(mesh, -handle.frame[:, 2], config.thickness)
    if whole is not None:
        return [whole]
    hidden = [] if handle.plane is None else [patch(handle.region, mesh, handle.frame, handle.plane, config.thickness)]
    inwards = config.thickness * handle.frame[:, 2]
    solid = [hull(np.concatenate([p.vertices, p.vertices + inwards])) for p in _rough_hulls(mesh, config)]
    return [*(piece for piece in solid if piece is not None), *hidden]


def _plate(handle: Handle, base: Mesh | None) -> tuple[np.ndarray, float] | None:
    """Return the plane of a base plate before the front as outward normal and offset [m]; None without one."""
    return None if base is None else front_behind(base, handle.region, handle.frame)


def _ground(handle: Handle, plate: tuple[np.ndarray, float] | None) -> float | None:
    """Return the depth below the front's plane's origin, against its normal, of what a handle's posts stand on [m].

    That is a base plate before the front; None: the front.
    """
    if plate is None or handle.plane is None:
        return None
    frame = facing_frame(handle.frame, handle.plane[0])
    return min(-handle.plane[1], front_coordinate(plate, frame, handle.region.vertices.mean(axis=0)))


def _handle_hulls(handle: Handle, front: Mesh | None, ground: float | None, config: ColliderConfig) -> list[Mesh]:
    """Return a sheet in patches, a bar in slices (which end where fingers need space), a knob in frusta, else hulls."""
    if handle.plane is not None:
        frame, deep = facing_frame(handle.frame, handle.plane[0]), -handle.plane[1]
        opening = None if front is None else sheet_opening(handle.region, frame, handle.plane, front)
        if opening is not None:
            return _sheet_hulls(handle, frame, opening, config)
        profile = bar_profile(handle.region, frame, config.bar_slices)
        if profile is not None:
            hulls = bar_hulls(handle.region, frame, profile, deep, ground)
        else:
            hulls = knob_hulls(handle.region, frame, deep)
        if hulls is not None:
            return hulls
    return vhacd(handle.region, config.handle_hulls, config.resolution, config.max_vertices)


def _sheet_hulls(handle: Handle, frame: np.ndarray, opening: np.ndarray, config: ColliderConfig) -> list[Mesh]:
    """Return a sheet in a frame square on the front: as lip and wall where it is straight, else in patches."""
    assert handle.plane is not None
    front = -handle.plane[1]
    wall = hidden_wall(handle.region, frame, opening, front)
    if opening.any():
        border = None if wall is None else float((wall.vertices @ opening).min())
        pieces = straight_sheet(handle.region, frame, opening, front, border)
        if pieces is not None:
            return pieces
    patches = sheet_hulls(handle.region, frame, opening, config.handle_hulls, config.max_vertices)
    return patches if wall is None else [*before_wall(patches, wall, opening), wall]


def _rough_hulls(mesh: Mesh, config: ColliderConfig) -> list[Mesh]:
    return vhacd(mesh, config.front_panel_hulls, config.resolution, config.max_vertices)


def flatten(hulls: Iterable[Mesh], handle: Handle) -> list[Mesh]:
    """Cut hulls of the front that reach into the fingers' space off at the front's plane."""
    flat = []
    for piece in hulls:
        reaches = any(overlap(piece, block) > BLOCKED for block in handle.space.boxes)
        flat.append(clip(piece, *handle.plane) if reaches and handle.plane is not None else piece)
    return [piece for piece in flat if piece is not None]


def free_fingers(hulls: Iterable[Mesh], space: FingerSpace) -> list[Mesh]:
    """Cut the fingers' space out of hulls, which may come apart into several."""
    free = list(hulls)
    for block in space.boxes:
        parts = [subtract(piece, block) if overlap(piece, block) > BLOCKED else [piece] for piece in free]
        free = [part for group in parts for part in group]
    return free


# [m] On either side of the gripper's body that stays free: the arm's error, and that of a handle's axis
BODY_MARGIN = 0.01


@dataclass(frozen=True, kw_only=True)
class CabinetConfig:
    """How furniture with articulated parts becomes convex hulls.

    Attributes:
        resolution: voxels of the decomposition.
    """

    # largest number of hulls of the cabinet's own surface; each part that is fixed to it gets one more
    hulls: Count = 8
    thickness: Positive = 0.02  # of the front of a frozen drawer or door, inwards from its outer surface [m]
    resolution: Count
    max_vertices: Annotated[int, AtLeast(4)] = 32  # largest number of vertices of a hull
    # mass by the volume of its bounding box [kg/m^3], where none is annotated; without effect on a body that is
    # fixed to the world, but a simulator needs a number. [kg/m^3] of its box: a base cabinet of 0.6 x 0.56 x 0.72
    # m weighs 29 kg with what is in it
    density: Positive = 120.0
    # width, height and length [m] of the gripper's path to the handle, which no hull may block: along the handle,
    # across it, and outwards from where fingers end before the front. Behind the fingers it is as high as the
    # gripper's body, if that is higher
    corridor: tuple[Positive, Positive, Positive] = (0.3, 0.16, 0.3)


def anchor(target: Target) -> SimBody:
    """Return the empty fixed body of an articulated part that belongs to no furniture."""
    return SimBody(f"{target.id}_anchor", merge([]), (), Mass(1.0, target.joint.origin, (0.01, 0.01, 0.01)))


def cabinet_body(
    scene: Scene, members: Sequence[str], obstacles: Sequence[Mesh], walls: Sequence[Mesh], config: CabinetConfig
) -> SimBody:
    """Return the fixed body of a piece of furniture.

    Args:
        scene: the room.
        members: ids of its parts, the object first; a joint among them is frozen.
        obstacles: convex hulls that none of its own may reach into, such as the gripper's path to a handle.
        walls: what was not scanned of it.
        config: how fine.
    """
    visual = merge([*(scene.parts[i].mesh for i in members), *walls])
    colliders = []
    for i in members:
        colliders += [Collider(i, part) for hull in _hulls(scene, i, config) for part in cut_all(hull, obstacles)]
    colliders += [Collider(members[0], wall) for wall in walls]
    completed = sum(len(wall.faces) for wall in walls)
    scanned = merge([scene.parts[i].mesh for i in members])
    size = np.ptp(scanned.bounds, axis=0) if len(scanned.vertices) else np.zeros(3)
    estimate = config.density * float(np.prod(np.maximum(size, 0.1)))
    mass = annotated_mass(scene, members) or estimate
    return SimBody(members[0], visual, tuple(colliders), box_mass(scanned, mass, np.eye(3)), completed)


def _hulls(scene: Scene, part: str, config: CabinetConfig) -> list[Mesh]:
    """Return a flat front as a slab, a cabinet as several hulls, anything else as one."""
    mesh, motion = scene.parts[part].mesh, scene.parts[part].motion
    if isinstance(motion, Joint) and len(mesh.faces):
        front = slab(mesh, opening_direction(motion, mesh.bounds.mean(axis=0)), config.thickness)
        if front is not None:
            return [front]
    if scene.parts[part].parent is None:
        fineness = (config.hulls, config.resolution, config.max_vertices)
        return unpack(recall("cabinet", [mesh, repr(fineness)], lambda: pack(vhacd(mesh, *fineness))))
    return one_hull(mesh, config.max_vertices)


def gripper_corridor(handle: Handle, target: Target, config: CabinetConfig, gripper: GripperSpec) -> list[Mesh]:
    """Return the boxes through which the gripper comes to the handle.

    The first, for its fingers, goes outwards from where they end before the front; the other, for its body, from behind them. A
    worktop that stands out less stays whole.
    """
    along, across, length = config.corridor
    end, boxes = handle.front - CLEARANCE, []
    behind, body = gripper.tip_ahead + gripper.body_behind, gripper.body_box[1] + 2 * BODY_MARGIN
    for high, gap in ((across, 0.0), (max(across, body), behind)):
        middle = handle.frame.T @ target.point
        middle[2] = end - (gap + length) / 2
        boxes.append(box(handle.frame @ middle, handle.frame, np.array([along, high, length - gap])))
    return boxes
