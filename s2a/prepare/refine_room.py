"""The joints of a room as one problem: observations of its scan, and the parameters that fit them best."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from s2a.prepare.refine_front import Faces, FrontSide, Seen, seen_front
from s2a.prepare.refine_loss import (
    ALONG_FRAME,
    AXIS,
    COUNT,
    FACE,
    FLUSH,
    LEVEL,
    LINE,
    PRIOR,
    SHIFT,
    TILT,
    ZERO,
    Loss,
    PartPath,
    RefineConfig,
    Term,
    path,
)
from s2a.scan.evidence.front import front
from s2a.scan.evidence.surface import ScanSurface
from s2a.scene.articulation import opening_sign
from s2a.scene.scene import Joint, Scene

# Directions nearer than this are meant to be the same; an axis that errs by more is not refined but wrong (`s2a check`)
ALIKE = np.cos(np.radians(10.0))
# [m] A leaf of furniture is no thicker (16 to 22 mm); about which edge of a thicker lid it turns, nobody can see
LEAF = 0.022
UP = np.array([0.0, 0.0, 1.0])


def frame_of(normals: Sequence[np.ndarray], axes: Sequence[np.ndarray]) -> np.ndarray:
    """Return the axes of a piece of furniture as columns [3 3]: across its fronts, along them, up.

    `normals`: of its fronts, the most certain first; `axes`: of its joints, for furniture without upright fronts.
    """
    for direction in (*normals, *axes):
        level = direction * (1.0, 1.0, 0.0)
        if abs(direction[2]) < 1.0 - ALIKE:
            forward = level / np.linalg.norm(level)
            return np.stack([forward, np.cross(UP, forward), UP], axis=1)
    return np.eye(3)


def joint_terms(number: int, joint: Joint, seen: Seen | None, config: RefineConfig) -> list[Term]:
    """Return what a joint's own front says about it."""
    if seen is None:
        return []
    axis = np.array(joint.axis)
    along = abs(float(axis @ seen.normal))
    if along > ALIKE:  # pulled forwards, or turned in its plane
        first = np.cross(seen.normal, UP if abs(seen.normal[2]) < 0.9 else np.eye(3)[0])
        first /= np.linalg.norm(first)
        return [
            Term(AXIS, number, float(np.hypot(seen.sigma(d), config.hang)), direction=d, cut=config.cut)
            for d in (first, np.cross(seen.normal, first))
        ]
    if along > np.sin(np.arccos(ALIKE)):  # neither along the front nor across it
        return []
    sigma = float(np.hypot(seen.sigma(axis), config.hang))
    terms = [Term(AXIS, number, sigma, direction=seen.normal, cut=config.cut)]
    for side in seen.sides:
        across = side.outward if abs(axis @ side.along) > ALIKE else side.along
        if np.isfinite(side.angle) and abs(axis @ across) < np.sqrt(1.0 - ALIKE**2):
            sigma = float(np.hypot(side.angle, config.hang))
            terms.append(Term(AXIS, number, sigma, direction=across / np.linalg.norm(across), cut=config.cut))
    if joint.kind == "revolute" and (edge := hinge_side(joint, seen)) is not None:
        outward = edge.outward / np.linalg.norm(edge.outward)
        sigma, depth = (
            np.hypot(edge.sigma, config.edge),
            np.linalg.norm([seen.height, config.depth, max(0.0, seen.thickness - LEAF)]),
        )
        place = float(edge.middle @ outward) - config.inset
        terms.append(
            Term(LINE, number, float(sigma), direction=outward, point=edge.middle, expected=place, cut=config.cut)
        )
        level = float(seen.center @ seen.normal)
        terms.append(
            Term(LINE, number, float(depth), direction=seen.normal, point=edge.middle, expected=level, cut=config.cut)
        )
    return terms


def hinge_side(joint: Joint, seen: Seen) -> FrontSide | None:
    """Return the side of a front along which a hinge turns, or None if it turns about none."""
    axis, origin = np.array(joint.axis), np.array(joint.origin)
    sides = [side for side in seen.sides if abs(axis @ side.along) > ALIKE]
    if not sides:
        return None

    def away(side: FrontSide) -> float:
        near = origin + axis * float((side.middle - origin) @ axis)
        return abs(float((near - side.middle) @ side.outward))

    return min(sides, key=away)


def frame_terms(
    number: int, joint: Joint, seen: Seen | None, frame: int, axes: np.ndarray, config: RefineConfig
) -> list[Term]:
    """Return that joint and front are parallel to the furniture, as its other ones are."""
    axis, terms = np.array(joint.axis), []
    terms += [Term(ALONG_FRAME, number, config.parallel, frame, k, cut=config.cut) for k in _others(axis, axes)]
    if seen is not None:
        for k in _others(seen.normal, axes):
            sigma = float(np.hypot(seen.sigma(axes[:, k]), config.parallel))
            terms.append(Term(FACE, number, sigma, frame, k, seen.normal, cut=config.cut))
    return terms


def _others(direction: np.ndarray, axes: np.ndarray) -> list[int]:
    """Return the two axes [3 3] across which a direction should be, as it is along the third; none where it is along none."""
    close = np.abs(direction @ axes)
    return [k for k in range(3) if k != int(close.argmax())] if close.max() > ALIKE else []


def level_terms(frame: int, config: RefineConfig) -> list[Term]:
    """Return that a piece of furniture stands upright."""
    return [Term(LEVEL, 0, config.level, frame, k) for k in (0, 1)] + [Term(LEVEL, 0, 1.0, frame, 2)]


def prior_terms(number: int, axis: float, origin: float, config: RefineConfig, kind: str) -> list[Term]:
    """Return that a joint is as annotated, with the annotator's standard deviations [rad] and [m]."""
    zero = config.zero_angle if kind == "revolute" else config.zero
    values = {**dict.fromkeys(TILT, axis), **dict.fromkeys(SHIFT, origin), ZERO: zero}
    return [Term(PRIOR, number, sigma, index=index) for index, sigma in values.items()]


def flush_terms(
    numbers: Mapping[str, int], joints: Sequence[Joint], seen: Mapping[str, Seen], config: RefineConfig
) -> list[Term]:
    """Return that closed fronts lie in one plane, for those that stand before the others' plane."""
    terms = []
    for part, own in seen.items():
        joint = joints[numbers[part]]
        others = [other for i, other in seen.items() if i != part and other.normal @ own.normal > ALIKE]
        if not others or _along_plane(joint, own):
            continue
        reach = _far(joint, own)
        planes = [float((other.center - reach) @ other.normal) for other in others]
        middle = int(np.argsort(planes)[len(planes) // 2])
        step, other = -planes[middle], others[middle]
        hinge = 2.0 * own.center - reach
        proud = joint.kind == "revolute" and (hinge - other.center) @ other.normal > step / 2
        if 0.0 < step < config.ajar and not proud:  # an open door stands out at its far edge alone
            sigma = float(np.linalg.norm([config.flush, *(_blur(one, reach, config) for one in (own, other))]))
            place = float(reach @ other.normal) - step
            terms.append(Term(FLUSH, numbers[part], sigma, direction=other.normal, point=reach, expected=place))
    return terms


def _blur(seen: Seen, point: np.ndarray, config: RefineConfig) -> float:
    """Return the standard deviation with which a front tells where its plane is at a distant point [m]."""
    way = point - seen.center
    return float(np.sqrt(seen.height**2 + way @ seen.tilt @ way + (config.parallel * np.linalg.norm(way)) ** 2))


def _along_plane(joint: Joint, seen: Seen) -> bool:
    """Return True for what moves in its front's plane: it is flush wherever it stands."""
    along = abs(float(np.array(joint.axis) @ seen.normal))
    return along < 0.7 if joint.kind == "prismatic" else along > 0.7


def _far(joint: Joint, seen: Seen) -> np.ndarray:
    """Return the point of a front that moves most when it opens [m], shape [3]: its middle, or that of a hinge's far edge."""
    if joint.kind == "prismatic":
        return seen.center
    axis, origin = np.array(joint.axis), np.array(joint.origin)
    arm = seen.center - origin
    arm -= (arm @ axis) * axis
    arm -= (
        arm @ seen.normal
    ) * seen.normal  # a line that was annotated beside the front's plane moves no point out of it
    return seen.center + 0.9 * arm


def closed(joint: Joint, zero: float) -> tuple[float, float]:
    """Return the limits of a joint whose closed coordinate is `zero`, on the far side of the scanned pose from the open one."""
    lower, upper = joint.limits
    shift = -abs(zero)
    return (shift, upper) if opening_sign(joint) > 0 else (lower, -shift)


ROUNDS = 8  # Most rounds of the optimiser, each in units of the Hessian where it begins; two or three do
LIMITS = {"maxiter": 30}  # Of one round
MIN_CURVATURE = 100.0  # [1/rad^2], [1/m^2] Smallest curvature that counts: the information of the widest prior


@dataclass(frozen=True)
class JointedRoom:
    """The joints of a room, and what its scan tells of them."""

    parts: tuple[str, ...]  # ids of the parts that move
    joints: tuple[Joint, ...]  # theirs, as annotated
    frame: tuple[int, ...]  # number of the piece of furniture of each
    terms: tuple[Term, ...]  # of the loss, all but the priors
    paths: tuple[PartPath, ...]  # of the parts
    loss: Loss  # function of all parameters

    @property
    def free(self) -> np.ndarray:
        """What may change at all, shape [joint 5]: a slide has no place, and few fronts tell that they stand ajar."""
        free = np.ones((len(self.parts), COUNT), bool)
        free[:, ZERO] = False
        free[[joint.kind == "prismatic" for joint in self.joints], SHIFT[0] : SHIFT[1] + 1] = False
        free[[term.joint for term in self.terms if term.kind == FLUSH], ZERO] = True
        return free


@dataclass(frozen=True)
class RoomFit:
    """The best parameters of a room."""

    values: np.ndarray  # of the joints, shape [joint 5]; 0 where they were not free
    sigma: np.ndarray  # their standard deviations, from the loss' second derivatives; 0 where they were not free
    turns: np.ndarray  # of the furniture [rad], shape [frame 3]


def joints_of(scene: Scene, config: RefineConfig) -> JointedRoom:
    """Return what a scan tells of all joints of a scene."""
    parts, faces = scene.movable, Faces(ScanSurface(scene))
    joints = tuple(scene.joint(part) for part in parts)
    seen = _fronts(faces, parts)
    roots = {part: scene.root(part) for part in parts}
    pieces = list(dict.fromkeys(roots.values()))
    frames = [_frame(scene, [part for part in parts if roots[part] == piece], seen) for piece in pieces]
    frame = tuple(pieces.index(roots[part]) for part in parts)
    numbers = {part: i for i, part in enumerate(parts)}
    terms: list[Term] = []
    for i, (part, joint) in enumerate(zip(parts, joints, strict=True)):
        terms += joint_terms(i, joint, seen.get(part), config)
        terms += frame_terms(i, joint, seen.get(part), frame[i], frames[frame[i]], config)
    for number, piece in enumerate(pieces):
        terms += level_terms(number, config)
        mine = {part: seen[part] for part in seen if roots[part] == piece}
        terms += flush_terms(numbers, joints, mine, config)
    weight = 1.0 / config.penetration**2
    paths = [path(faces, part, numbers[part], weight) for part in seen]
    normals = [seen[part].normal if part in seen else np.array([0.0, 0.0, 1.0]) for part in parts]
    loss = Loss(joints, normals, frames)
    return JointedRoom(parts, joints, frame, tuple(terms), tuple(path for path in paths if path is not None), loss)


def _fronts(faces: Faces, parts: tuple[str, ...]) -> dict[str, Seen]:
    """Return the fronts that the scan shows, by part."""
    seen = {}
    for part in parts:
        plane = front(faces.surface, part)
        shown = None if plane is None else seen_front(faces, part, plane)
        if shown is not None:
            seen[part] = shown
    return seen


def _frame(scene: Scene, parts: list[str], seen: Mapping[str, Seen]) -> np.ndarray:
    """Return the axes of the piece of furniture to which some parts belong, shape [3 3]."""
    shown = sorted((seen[part] for part in parts if part in seen), key=lambda one: float(np.trace(one.tilt)))
    return frame_of([one.normal for one in shown], [np.array(scene.joint(part).axis) for part in parts])


def priors(room: JointedRoom, axis: float, config: RefineConfig) -> list[Term]:
    """Return that joints are as annotated, by an annotator whose axes have this standard deviation [rad]."""
    origin = axis * config.arm
    priors = (prior_terms(i, axis, origin, config, joint.kind) for i, joint in enumerate(room.joints))
    return [term for terms in priors for term in terms]


def prior_sigma(room: JointedRoom, axis: float, config: RefineConfig) -> np.ndarray:
    """Return the standard deviations of the priors, shape [joint 5]."""
    sigmas = np.empty((len(room.parts), COUNT))
    for term in priors(room, axis, config):
        sigmas[term.joint, term.index] = term.sigma
    return sigmas


def fit(room: JointedRoom, axis: float, free: np.ndarray, config: RefineConfig) -> RoomFit:
    """Return the parameters with the least loss, from the annotation on.

    `axis`: standard deviation of annotated axes [rad]; `free`: which parameters may change, shape [joint 5].
    """
    loss = room.loss.of([*room.terms, *priors(room, axis, config)], room.paths)
    turns = loss.size - free.size
    mask = np.concatenate([free.ravel(), np.ones(turns, bool)])

    def curved(full: np.ndarray) -> np.ndarray:
        return _positive(loss.hessian(full, room.frame)[np.ix_(mask, mask)])

    full = np.zeros(loss.size)
    for _ in range(ROUNDS):
        # In units in which the loss curves alike in all directions; robust losses curve otherwise at the next place.
        start, unit = full, np.linalg.inv(np.linalg.cholesky(curved(full))).T
        solution = minimize(
            _scaled(loss, start, mask, unit), np.zeros(len(unit)), jac=True, method="L-BFGS-B", options=LIMITS
        )
        full = start.copy()
        full[mask] += unit @ solution.x
        if solution.success:
            break
    spread = np.zeros(loss.size)
    spread[mask] = np.sqrt(np.diag(np.linalg.inv(curved(full))))
    values, sigma = (every[: free.size].reshape(-1, COUNT) for every in (full, spread))
    return RoomFit(values, sigma, full[free.size :].reshape(-1, 3))


def _scaled(
    loss: Loss, start: np.ndarray, mask: np.ndarray, unit: np.ndarray
) -> Callable[[np.ndarray], tuple[float, np.ndarray]]:
    """Return a loss and its gradient as a function of steps from `start`, in units [free step] of the free parameters."""

    def scaled(step: np.ndarray) -> tuple[float, np.ndarray]:
        full = start.copy()
        full[mask] += unit @ step
        value, gradient = loss(full)
        return value, unit.T @ gradient[mask]

    return scaled


def loss_of(room: JointedRoom, number: int, values: np.ndarray, turns: np.ndarray, terms: list[Term]) -> float:
    """Return one joint's share of the loss.

    Args:
        room: the joints.
        number: which.
        values: parameters of all joints, shape [joint 5].
        turns: of the furniture [rad], shape [frame 3].
        terms: priors.
    """
    mine = [term for term in (*room.terms, *terms) if term.joint == number and term.kind != LEVEL]
    loss = room.loss.of(mine, [path for path in room.paths if path.joint == number])
    return loss(np.concatenate([values.ravel(), turns.ravel()]))[0]


def _positive(hessian: np.ndarray) -> np.ndarray:
    """Return a Hessian without the negative curvature that robust losses have beyond their cut."""
    values, vectors = np.linalg.eigh(hessian)
    return (vectors * np.maximum(values, MIN_CURVATURE)) @ vectors.T
