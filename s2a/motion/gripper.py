"""A parallel gripper: its shape in the tool frame, how deep it reaches into a room, and what its pads must find to hold."""

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from s2a.motion.obstacles import Obstacles
from s2a.robot.spec import GripperSpec

CLEARANCE = 0.004  # [m] Between an open finger and the object, and around the gripper
AROUND = 0.002  # [m] Around the gripper what it passes must leave free: the arm's error
COARSE = 7  # Every so many of the gripper's spheres are looked at first
# [m] From the object on either side to which the fingers open: fully open, they would meet what stands beside it
SPREAD = 0.012


@dataclass(frozen=True)
class Spheres:
    """Spheres that fill a gripper, in the tool frame."""

    centers: np.ndarray  # with the fingers fully open [m], shape [sphere 3]
    radii: np.ndarray  # [m], shape [sphere]
    side: np.ndarray  # towards which of the fingers they move as those open: 1, -1, or 0 for the body, shape [sphere]
    most: float  # full opening [m]

    def placed(self, tool: np.ndarray, opened: np.ndarray | None = None, every: int = 1) -> np.ndarray:
        """Return the centers [pose sphere 3] at tool poses [pose 4 4] and distances of the pads [m] [pose]; None: fully open."""
        centers, side = self.centers[::every], self.side[::every]
        places = centers @ tool[:, :3, :3].transpose(0, 2, 1) + tool[:, None, :3, 3]
        if opened is not None:
            places += (0.5 * (opened - self.most))[:, None, None] * side[:, None] * tool[:, None, :3, 1]
        return places


def opening(width: np.ndarray, gripper: GripperSpec) -> np.ndarray:
    """Return the distances of the pads [m] with which grasps of these widths [m] are approached and left, shape [grasp]."""
    return np.minimum(width + 2 * SPREAD, gripper.max_opening)


def inside_gripper(tool: np.ndarray, opened: np.ndarray, surface: np.ndarray, gripper: GripperSpec) -> np.ndarray:
    """Return which grasps [grasp] have a point of the surface in a finger or in the gripper body.

    Args:
        tool: poses of the tool frame [grasp 4 4].
        opened: distances of the pads [m], shape [grasp].
        surface: points [point 3].
        gripper: which.
    """
    inside = np.zeros(len(tool), bool)
    for k in range(0, len(tool), 512):
        some, closed = tool[k : k + 512], 0.5 * (gripper.max_opening - opened[k : k + 512])
        x, y, z = (surface @ some[:, :3, :3] - some[:, None, :3, 3] @ some[:, :3, :3]).transpose(2, 0, 1).copy()
        for (low, high), side in zip(gripper_boxes(gripper), (1, -1, 0), strict=True):
            moved, near = y + side * closed[:, None], CLEARANCE / 2
            within = np.ones(x.shape, bool)
            for along, least, most in zip((x, moved, z), low - near, high + near, strict=True):
                within &= (along > least) & (along < most)
            inside[k : k + 512] |= within.any(axis=1)
    return inside


def gripper_boxes(gripper: GripperSpec) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the lower and upper corners [m] of both fingers, fully open, and of the gripper body, in the tool frame."""
    half = gripper.max_opening / 2
    x, thick, _ = gripper.finger_box
    front = -gripper.body_behind
    fingers = [
        (np.array([-x / 2, low, front]), np.array([x / 2, low + thick, gripper.tip_ahead]))
        for low in (half, -half - thick)
    ]
    body = np.array(gripper.body_box)
    return [
        *fingers,
        (np.array([-body[0] / 2, -body[1] / 2, front - body[2]]), np.array([body[0] / 2, body[1] / 2, front])),
    ]


@cache
def gripper_spheres(gripper: GripperSpec, fingers: bool = True) -> Spheres:
    """Return spheres that fill the gripper body, and the fingers.

    They stay within the boxes, whose edges stand out of the gripper body's by 7 mm: the spheres of the robot's links stand out of
    it by up to 20 mm, which is what is free beside many an object.
    """
    *both, body = gripper_boxes(gripper)
    filled = [(*_filled(*body, 0.25 * float((body[1] - body[0]).min())), 0)]
    if fingers:
        filled += [
            (*_filled(low, high, 0.5 * float(np.sort(high - low)[:2].mean())), side)
            for (low, high), side in zip(both, (1, -1), strict=True)
        ]
    centers, radii = (np.concatenate([each[k] for each in filled]) for k in range(2))
    return Spheres(
        centers, radii, np.repeat([s for *_, s in filled], [len(r) for _, r, _ in filled]), gripper.max_opening
    )


def _filled(low: np.ndarray, high: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Return spheres that fill a box between two corners [m]: centers [sphere 3] and radii [sphere]."""
    axes = []
    for a, b in zip(low, high, strict=True):
        free = b - a - 2 * radius
        count = int(np.ceil(free / (1.5 * radius))) + 1 if free > 0.1 * radius else 1
        axes.append(np.linspace(a + radius, b - radius, count) if count > 1 else np.array([(a + b) / 2]))
    centers = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return centers, np.full(len(centers), radius)


def is_near(pose: np.ndarray, others: np.ndarray) -> bool:
    """Return whether a pose [4 4] has nearly the direction of another one [pose 4 4]: within 29 degrees."""
    return bool((np.einsum("pij,ij->p", others[:, :3, :3], pose[:3, :3]) >= 1 + 2 * math.cos(0.5)).any())


def gripper_depth(
    near: Obstacles,
    gripper: GripperSpec,
    tool: np.ndarray,
    opened: np.ndarray,
    approach: float,
    lift: float,
    limit: float = 0.0,
) -> np.ndarray:
    """Return how deep a gripper, with AROUND added, reaches into a room at tool poses and on the straight paths from them.

    Its body alone as it lifts the object or lowers it. What is deeper than the limit at one place is looked at no further.

    Args:
        near: hulls of the room.
        gripper: which.
        tool: poses of the tool frame, shape [grasp 4 4], scene frame.
        opened: distance of the pads [m], shape [grasp].
        approach: straight path before the grasp, and after the release [m].
        lift: straight path upwards [m].
        limit: [m].

    Returns:
        Depth [m], shape [grasp], 0 where it is clear.
    """
    depth, still = np.zeros(len(tool)), np.zeros((len(tool), 3))
    # A few of the spheres find most of what is hit.
    paths = [(True, COARSE, still)]
    paths += [(True, 1, -back * tool[:, :3, 2]) for back in np.linspace(0.0, approach, 4)]
    paths += [(False, 1, still + [0.0, 0.0, up]) for up in (lift / 2, lift)]
    for fingers, every, shift in paths:
        left = np.flatnonzero(depth <= limit)
        spheres = gripper_spheres(gripper, fingers)
        places = spheres.placed(tool[left], opened[left], every) + shift[left][:, None]
        depth[left] = np.maximum(depth[left], near.depth(places, spheres.radii[::every] + AROUND))
    return depth


@dataclass(frozen=True)
class Contact:
    """Requirements on what the pads find between them."""

    # up to which the surface may lie off the pads at a point that holds [m]. What is inclined more turns between
    # the pads until it is parallel to them, or is squeezed out
    flat: float
    held: float  # least fraction of the points at which both pads hold
    # largest distance of the middle of what holds from that of the surface between the pads [m]: a wedge is held
    # where it is thickest, and slips out
    centered: float
    # largest lever arm of the weight about the closing axis [m], for what turns between the pads
    lever: float = math.inf
    body_gap: float = 0.0  # least distance of the gripper's body from the object [m], where more than to be clear of it


# 5 degrees over half a pad, and a rod of 8 mm. With twice as much a perfume bottle turned by 20 degrees in the gripper
FIRM = Contact(0.0007, 0.3, 0.003)
# A doll's head, a lamp, a tube: their sides recede too much to be FIRM, and what holds lies nearer to one edge of the
# pads. They may turn in the gripper, as the perfume bottle did; it is that or no plan
SLOPING = replace(FIRM, flat=0.0014, centered=0.005)
# For a soft body, whose vertices pads meet, the best first. With 12 mm of lever arm a bear turned by 45 degrees when
# lifted; by half of the pads it was squeezed out on its way, 8 mm in 10 s; its head, 2 mm from the gripper's body,
# bulged against that
HANGING = tuple(
    replace(FIRM, held=held, lever=0.008, body_gap=body_gap)
    for held, body_gap in ((0.9, 0.012), (0.7, 0.006), (0.7, 0.0))
)
