"""Drop test: does a placed object stay where it is when it falls from a little above?

The obstacles are the scan's own triangles near the object, each a thin prism behind its face, so that nothing rests on a
hull that the scan does not have. The object is its convex hulls.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from s2a.core.bounds import NotNegative, Positive
from s2a.scene.scene import Mesh

ANGLES = np.arange(12) * np.pi / 12
# Directions in which triangles may be too far away to matter, shape [13 3]: boxes turned by 15 deg, of which one fits
SIDES = np.array([[0.0, 0.0, 1.0], *np.stack([np.cos(ANGLES), np.sin(ANGLES), 0.0 * ANGLES], axis=1)])
# Until an object has moved by almost so much, triangles farther away than this in one of these directions do not
# matter [m]
CLOSE = 0.025


def near(support: Mesh, bounds: np.ndarray, reach: float) -> np.ndarray:
    """Return the triangles that hulls may touch [m], shape [face 3 3], float64.

    Args:
        support: the scene's triangles.
        bounds: of the hulls [m], shape [hull 2 3].
        reach: triangles within this distance of a hull's box are meant [m].
    """
    triangles = support.vertices[support.faces].astype(np.float64)
    return triangles[_meet(triangles, bounds, reach) & (support.face_areas > 1e-8)]


def close(triangles: np.ndarray, hulls: Sequence[Mesh]) -> np.ndarray:
    """Return which triangles matter as long as the hulls hardly move, shape [face]."""
    along = [hull.vertices @ SIDES.T for hull in hulls]
    return _meet(triangles @ SIDES.T, np.array([(own.min(axis=0), own.max(axis=0)) for own in along]), CLOSE)


def _meet(triangles: np.ndarray, spans: np.ndarray, reach: float) -> np.ndarray:
    """Return which triangles [face 3 axis] are within a distance of any span [span 2 axis] along all axes, shape [face]."""
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    meets = np.zeros(len(triangles), bool)
    for first, last in spans:
        meets |= ((low <= last + reach) & (high >= first - reach)).all(axis=1)
    return meets


def model(hulls: Sequence[Mesh], triangles: np.ndarray, center: np.ndarray, config: DropTestConfig) -> mujoco.MjModel:
    """Return a model of prisms and a free body, its frame at the object's middle."""
    spec = mujoco.MjSpec()
    spec.option.timestep = config.step
    # A wide flat object touches thousands of prisms at once, for which MuJoCo's own guess is too small
    spec.memory = (1 << 24) + (1 << 16) * len(triangles)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.default.mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
    geom = spec.default.geom
    geom.type, geom.density, geom.condim = mujoco.mjtGeom.mjGEOM_MESH, config.density, 6
    geom.friction, geom.solref[:] = config.friction, [config.stiffness, 1.0]
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    behind = across / np.linalg.norm(across, axis=1, keepdims=True) * config.thickness
    prisms = np.concatenate([triangles, triangles - behind[:, None]], axis=1) - center
    for number, prism in enumerate(prisms):
        _geom(spec, spec.worldbody, f"prism_{number}", prism)
    body = spec.worldbody.add_body(name="object")
    body.add_freejoint()
    for number, hull in enumerate(hulls):
        _geom(spec, body, f"hull_{number}", hull.vertices.astype(np.float64) - center)
    return spec.compile()


def _geom(spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, points: np.ndarray) -> None:
    """Add the convex hull of points [point 3] to a body."""
    spec.add_mesh(name=name, uservert=points.ravel())
    body.add_geom(meshname=name)


INTERVAL = 10  # Steps between two tests of rest
FIRST_TRIANGLES = 200  # Nearest triangles to a wall-mounted object that are tested first
# Change of a speed that is none [m/s]: what a slow fall would grow to in two seconds from there is under a millimetre
NONE = 1e-9


@dataclass(frozen=True)
class DropTestConfig:
    """Settings of a drop test."""

    drop: NotNegative = 0.005  # height from which it falls [m]
    seconds: Positive = 2.0  # duration, unless it rests before [s]
    still: NotNegative = 0.1  # window in which its speed must not have changed for it to rest [s]
    steady: NotNegative = 0.01  # fraction by which the speed may have changed meanwhile
    # how far that speed may take it in the time that is left [m]; below 0 the test runs to the end
    creep: float = 5e-05
    step: Positive = 0.002  # of the simulation [s]
    search_radius: NotNegative = 0.015  # triangles within this distance of a hull's box take part [m]
    thickness: Positive = 0.008  # of the prisms behind them [m]
    density: Positive = 300.0  # of the object [kg/m^3]
    # sliding [1], torsional [m] and rolling [m]
    friction: tuple[NotNegative, NotNegative, NotNegative] = (1.0, 0.005, 0.0005)
    stiffness: Positive = 0.005  # time constant of contacts [s]
    drift: NotNegative = 0.01  # max distance from the placed position [m]
    tilt: NotNegative = 0.0873  # max angle from the placed pose [rad]. 5°
    penetration: NotNegative = 0.001  # max depth at rest [m]
    contact_distance: NotNegative = 0.006  # a wall-mounted object has a surface within this distance behind it [m]


@dataclass(frozen=True)
class DropTestResult:
    """Result of a drop test."""

    drift: float  # distance from the placed position at the end [m]
    tilt: float  # angle of its upright from the placed one [rad]
    penetration: float  # max depth of a contact in the last quarter [m]
    problem: str  # why the object does not stay; empty if it does
    # where one that does not stay came to rest all the same: `about`, a point [m]; `shift` of that point [m];
    # `turn` about it, xyzw; None if it did not rest, or was not dropped
    rest: dict[str, list[float]] | None = None

    @property
    def stays(self) -> bool:
        """The object stays where it was placed."""
        return not self.problem


def drop_test(
    hulls: Sequence[Mesh], support: Mesh, config: DropTestConfig, hangs_on: np.ndarray | None = None
) -> DropTestResult:
    """Drop an object.

    Args:
        hulls: convex hulls of the object, placed in the scene [m].
        support: the scene's triangles around it, looking outwards.
        config: the drop and its bounds.
        hangs_on: for what is attached: direction to the wall, shape [3]; it does not fall, only its contact is tested.

    Raises:
        ValueError: no hulls.
    """
    if not hulls:
        raise ValueError("an object without convex hulls cannot be dropped")
    bounds = np.array([hull.bounds for hull in hulls])
    center = (bounds[:, 0].min(axis=0) + bounds[:, 1].max(axis=0)) / 2
    triangles = near(support, bounds, config.search_radius)
    if hangs_on is not None:
        return _hangs(hulls, triangles, center, np.asarray(hangs_on, float), config)
    radius = float(np.linalg.norm(bounds[:, 1].max(axis=0) - center))
    few = triangles[close(triangles, hulls)]
    result = _dropped(model(hulls, few, center, config), radius, CLOSE - config.thickness, config)
    if result is None:
        result = _dropped(model(hulls, triangles, center, config), radius, np.inf, config)
    assert result is not None  # nothing moves farther than infinitely far
    return result if result.rest is None else replace(result, rest={"about": center.tolist(), **result.rest})


def _dropped(built: mujoco.MjModel, radius: float, stray: float, config: DropTestConfig) -> DropTestResult | None:
    """Return the result for an object that falls; None if a point of it moves too far.

    Args:
        built: it and its obstacles.
        radius: distance of its farthest point from its middle [m].
        stray: distance that is too far [m].
        config: of the drop test.
    """
    data = mujoco.MjData(built)
    data.qpos[2] += config.drop
    steps, window = round(config.seconds / config.step), round(config.still / config.step)
    speeds = np.full((window, 6), np.inf)
    deepest, touches, resting = 0.0, False, False
    for step in range(steps):
        mujoco.mj_step(built, data)
        speeds[step % window] = data.qvel * ([1.0] * 3 + [radius] * 3)
        left = (steps - 1 - step) * config.step
        probe = step % INTERVAL == 0
        if probe and _moved(data.qpos, radius) > stray:
            return None
        resting = probe and rests(speeds, speeds[step % window], left, config)
        if resting or step >= 0.75 * steps:
            deepest, touches = max(deepest, _depth(data)), touches or data.ncon > 0
        if resting:
            mujoco.mj_integratePos(built, data.qpos, data.qvel, left)
            break
    drift = float(np.linalg.norm(data.qpos[:3]))
    upright = np.clip(1.0 - 2.0 * (data.qpos[4] ** 2 + data.qpos[5] ** 2), -1.0, 1.0)
    tilt = float(np.arccos(upright))
    problem = "" if np.isfinite(drift) else "the simulation diverged"
    # Clauses in the order in which a reader wants them: what fell also drifted.
    clauses = [
        (touches, "it falls: nothing supports it"),
        (tilt <= config.tilt, f"it tilts by {np.degrees(tilt):.1f} deg"),
    ]
    clauses += [(drift <= config.drift, f"it drifts by {1000 * drift:.0f} mm")]
    clauses += [(deepest <= config.penetration, f"it sinks in by {1000 * deepest:.1f} mm")]
    problem = problem or next((words for holds, words in clauses if not holds), "")
    return DropTestResult(drift, tilt, deepest, problem, _rest(data) if problem and resting else None)


def _rest(data: mujoco.MjData) -> dict[str, list[float]]:
    """Return how a dropped object has moved and turned about its middle."""
    w, x, y, z = data.qpos[3:7].tolist()
    return {"shift": data.qpos[:3].tolist(), "turn": [x, y, z, w]}


def _moved(pose: np.ndarray, radius: float) -> float:
    """Return how far the points of an object have moved at most [m], for its pose and its radius [m]."""
    turn = 2.0 * np.arctan2(np.linalg.norm(pose[4:]), abs(pose[3]))
    return float(np.linalg.norm(pose[:3]) + radius * turn)


def rests(speeds: np.ndarray, speed: np.ndarray, left: float, config: DropTestConfig) -> bool:
    """Return whether an object stays at rest for the time that is left [s].

    At rest, the contacts of the simulation yield at a constant speed of micrometres a second. What is about to fall is as slow
    at first, but its speed grows: by a multiple, within the window of the test.

    Args:
        speeds: of late, of its surface by moving and by turning [m/s], shape [step 6].
        speed: the last one, shape [6].
        left: until the end of the test.
        config: its bounds.
    """
    fast, change = np.linalg.norm(speed), np.linalg.norm(speeds - speed, axis=1).max()
    return bool(fast * left <= config.creep and change <= config.steady * fast + NONE)


def _hangs(
    hulls: Sequence[Mesh], triangles: np.ndarray, center: np.ndarray, toward: np.ndarray, config: DropTestConfig
) -> DropTestResult:
    """Return whether an attached object is at its wall and not in it."""
    # The wall alone: a prism behind a ragged edge of the scan would reach into the room.
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    wall = triangles[across @ toward < -0.5 * np.linalg.norm(across, axis=1)]
    # What is not before the object's foremost point is not in it, and a few triangles suffice to find a contact.
    gaps = (wall @ toward).min(axis=1) - max(float((hull.vertices @ toward).max()) for hull in hulls)
    wall = wall[np.argsort(gaps, kind="stable")]
    for count in (max(FIRST_TRIANGLES, int((gaps <= 0).sum())), len(wall)):
        result = _attached(model(hulls, wall[:count], center, config), toward, config)
        if result.stays or result.penetration > config.penetration or count >= len(wall):
            break
    return result


def _attached(built: mujoco.MjModel, toward: np.ndarray, config: DropTestConfig) -> DropTestResult:
    """Return whether an object at its place penetrates nothing, and has contact a little farther on."""
    data = mujoco.MjData(built)
    mujoco.mj_forward(built, data)
    deepest = _depth(data)
    data.qpos[:3] += toward * config.contact_distance
    mujoco.mj_forward(built, data)
    touches = data.ncon > 0
    problem = "" if touches else f"there is nothing within {1000 * config.contact_distance:.0f} mm behind it"
    if deepest > config.penetration:
        problem = f"it penetrates its obstacles by {1000 * deepest:.1f} mm"
    return DropTestResult(0.0, 0.0, deepest, problem)


def _depth(data: mujoco.MjData) -> float:
    """Return the depth of the deepest contact [m]."""
    return max(0.0, -float(data.contact.dist.min())) if data.ncon else 0.0
