"""The joints of a room as one problem: what its scan tells of them, and the parameters that fit it best."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from s2a.prepare.refine_config import RefineConfig
from s2a.prepare.refine_front import Seen, seen_front
from s2a.prepare.refine_loss import COUNT, FLUSH, LEVEL, SHIFT, ZERO, Loss, PartPath, Term
from s2a.prepare.refine_path import path
from s2a.prepare.refine_sides import Faces
from s2a.prepare.refine_terms import flush_terms, frame_of, frame_terms, joint_terms, level_terms, prior_terms
from s2a.scan.evidence.front import front
from s2a.scan.evidence.surface import ScanSurface
from s2a.scene.scene import Joint, Scene

ROUNDS = 8
"""Most rounds of the optimiser, each in units of the Hessian where it begins; two or three do."""
LIMITS = {"maxiter": 30}
"""Of one round."""
MIN_CURVATURE = 100.0
"""[1/rad^2], [1/m^2] Smallest curvature that counts: the information of the widest prior."""


@dataclass(frozen=True)
class JointedRoom:
    """The joints of a room, and what its scan tells of them.

    Attributes:
        parts: ids of the parts that move.
        joints: theirs, as annotated.
        frame: number of the piece of furniture of each.
        terms: of the loss, all but the priors.
        paths: of the parts.
        loss: function of all parameters.
    """

    parts: tuple[str, ...]
    joints: tuple[Joint, ...]
    frame: tuple[int, ...]
    terms: tuple[Term, ...]
    paths: tuple[PartPath, ...]
    loss: Loss

    @property
    def free(self) -> np.ndarray:
        """What may change at all, shape [joint 5]: a slide has no place, and few fronts tell that they stand ajar."""
        found = np.ones((len(self.parts), COUNT), bool)
        found[:, ZERO] = False
        found[[joint.kind == "prismatic" for joint in self.joints], SHIFT[0] : SHIFT[1] + 1] = False
        found[[term.joint for term in self.terms if term.kind == FLUSH], ZERO] = True
        return found


@dataclass(frozen=True)
class RoomFit:
    """The best parameters of a room.

    Attributes:
        values: of the joints, shape [joint 5]; 0 where they were not free.
        sigma: their standard deviations, from the loss' second derivatives; 0 where they were not free.
        turns: of the furniture [rad], shape [frame 3].
    """

    values: np.ndarray
    sigma: np.ndarray
    turns: np.ndarray


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
    return JointedRoom(parts, joints, frame, tuple(terms), tuple(found for found in paths if found is not None), loss)


def _fronts(faces: Faces, parts: tuple[str, ...]) -> dict[str, Seen]:
    """Return the fronts that the scan shows, by part."""
    seen = {}
    for part in parts:
        found = front(faces.surface, part)
        shown = None if found is None else seen_front(faces, part, found)
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
    found = (prior_terms(i, axis, origin, config, joint.kind) for i, joint in enumerate(room.joints))
    return [term for terms in found for term in terms]


def prior_sigma(room: JointedRoom, axis: float, config: RefineConfig) -> np.ndarray:
    """Return the standard deviations of the priors, shape [joint 5]."""
    found = np.empty((len(room.parts), COUNT))
    for term in priors(room, axis, config):
        found[term.joint, term.index] = term.sigma
    return found


def fit(room: JointedRoom, axis: float, free: np.ndarray, config: RefineConfig) -> RoomFit:
    """Return the parameters with the least loss, from the annotation on.

    Args:
        room: the joints.
        axis: standard deviation of annotated axes [rad].
        free: which parameters may change, shape [joint 5].
        config: settings.
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
        found = minimize(
            _scaled(loss, start, mask, unit), np.zeros(len(unit)), jac=True, method="L-BFGS-B", options=LIMITS
        )
        full = start.copy()
        full[mask] += unit @ found.x
        if found.success:
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
