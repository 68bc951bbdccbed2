"""Warp kernels of the loss of a room's joints: a table of terms, and the paths of the parts through a grid of distances.

Every joint has five parameters, relative to its annotation: `TILT` turns its axis by small angles [rad] about two directions
across it, `SHIFT` moves its line along the same directions [m], `ZERO` is the coordinate at which it is closed [m] or [rad].
Every piece of furniture has a frame, turned by three small angles [rad]. Positions are scene coordinates [m], float64.
"""

import warp as wp

# Kinds of terms: what a value is of
AXIS, LINE, ALONG_FRAME, FACE, LEVEL, PRIOR, FLUSH = (wp.constant(kind) for kind in range(7))
TILT, SHIFT, ZERO = (0, 1), (2, 3), 4  # Where the parameters of a joint are among its five
COUNT = 5  # Parameters of a joint


@wp.struct
class Joints:
    """Annotated joints: kind 0 is a slide; `first` and `second` lie across the axis."""

    kind: wp.array(dtype=int)
    axis: wp.array(dtype=wp.vec3d)
    origin: wp.array(dtype=wp.vec3d)
    first: wp.array(dtype=wp.vec3d)
    second: wp.array(dtype=wp.vec3d)


@wp.struct
class Terms:
    """Columns of `refine_loss.Term`."""

    kind: wp.array(dtype=int)
    joint: wp.array(dtype=int)
    frame: wp.array(dtype=int)
    index: wp.array(dtype=int)
    direction: wp.array(dtype=wp.vec3d)
    point: wp.array(dtype=wp.vec3d)
    expected: wp.array(dtype=wp.float64)
    sigma: wp.array(dtype=wp.float64)
    cut: wp.array(dtype=wp.float64)


@wp.struct
class Paths:
    """Points at a coordinate each, and the grids of distances: those of grid g begin at `start[g]`."""

    joint: wp.array(dtype=int)
    grid: wp.array(dtype=int)
    point: wp.array(dtype=wp.vec3d)
    slack: wp.array(dtype=wp.float64)
    coordinate: wp.array(dtype=wp.float64)
    weight: wp.array(dtype=wp.float64)
    low: wp.array(dtype=wp.vec3d)
    cell: wp.array(dtype=wp.float64)
    shape: wp.array(dtype=wp.vec3i)
    start: wp.array(dtype=int)
    distance: wp.array(dtype=wp.float64)


@wp.func
def _axis(joints: Joints, values: wp.array2d(dtype=wp.float64), i: int) -> wp.vec3d:
    return wp.normalize(joints.axis[i] + values[i, 0] * joints.first[i] + values[i, 1] * joints.second[i])


@wp.func
def _origin(joints: Joints, values: wp.array2d(dtype=wp.float64), i: int) -> wp.vec3d:
    return joints.origin[i] + values[i, 2] * joints.first[i] + values[i, 3] * joints.second[i]


@wp.func
def _moved(kind: int, axis: wp.vec3d, origin: wp.vec3d, point: wp.vec3d, q: wp.float64) -> wp.vec3d:
    if kind == 0:
        return point + q * axis
    arm = point - origin
    along = wp.dot(arm, axis) * axis
    return origin + along + wp.cos(q) * (arm - along) + wp.sin(q) * wp.cross(axis, arm)


@wp.func
def _robust(residual: wp.float64, cut: wp.float64) -> wp.float64:
    half = wp.float64(0.5)
    if cut > wp.float64(0.0):
        return half * cut * cut * wp.log(wp.float64(1.0) + residual * residual / (cut * cut))
    return half * residual * residual


@wp.kernel
def sum_terms(
    joints: Joints,
    frames: wp.array(dtype=wp.mat33d),
    terms: Terms,
    values: wp.array2d(dtype=wp.float64),
    turns: wp.array2d(dtype=wp.float64),
    loss: wp.array(dtype=wp.float64),
):
    """Add up the terms."""
    tid = wp.tid()
    i = terms.joint[tid]
    f = terms.frame[tid]
    k = terms.index[tid]
    kind = terms.kind[tid]
    direction = terms.direction[tid]
    value = wp.float64(0.0)
    if kind == AXIS:
        value = wp.dot(_axis(joints, values, i), direction)
    elif kind == LINE:
        axis = _axis(joints, values, i)
        origin = _origin(joints, values, i)
        value = wp.dot(origin + wp.dot(terms.point[tid] - origin, axis) * axis, direction)
    elif kind == ALONG_FRAME or kind == FACE:
        turn = wp.vec3d(turns[f, 0], turns[f, 1], turns[f, 2])
        side = wp.vec3d(frames[f][0, k], frames[f][1, k], frames[f][2, k])
        side = wp.normalize(side + wp.cross(turn, side))
        if kind == ALONG_FRAME:
            direction = _axis(joints, values, i)
        value = wp.dot(direction, side)
    elif kind == LEVEL:
        value = turns[f, k]
    elif kind == PRIOR:
        value = values[i, k]
    else:
        axis = _axis(joints, values, i)
        origin = _origin(joints, values, i)
        value = wp.dot(_moved(joints.kind[i], axis, origin, terms.point[tid], values[i, 4]), direction)
    wp.atomic_add(loss, 0, _robust((value - terms.expected[tid]) / terms.sigma[tid], terms.cut[tid]))


@wp.func
def _corner(paths: Paths, g: int, x: int, y: int, z: int) -> wp.float64:
    size = paths.shape[g]
    return paths.distance[paths.start[g] + (x * size[1] + y) * size[2] + z]


@wp.kernel
def sum_paths(joints: Joints, paths: Paths, values: wp.array2d(dtype=wp.float64), loss: wp.array(dtype=wp.float64)):
    """Add up the squared depths of points within the rest of the scan."""
    tid = wp.tid()
    i = paths.joint[tid]
    g = paths.grid[tid]
    q = paths.coordinate[tid]
    place = _moved(joints.kind[i], _axis(joints, values, i), _origin(joints, values, i), paths.point[tid], q)
    at = (place - paths.low[g]) / paths.cell[g]
    size = paths.shape[g]
    x = int(wp.floor(at[0]))
    y = int(wp.floor(at[1]))
    z = int(wp.floor(at[2]))
    if x >= 0 and y >= 0 and z >= 0 and x < size[0] - 1 and y < size[1] - 1 and z < size[2] - 1:
        u = at[0] - wp.float64(x)
        v = at[1] - wp.float64(y)
        w = at[2] - wp.float64(z)
        low = wp.lerp(_corner(paths, g, x, y, z), _corner(paths, g, x + 1, y, z), u)
        side = wp.lerp(_corner(paths, g, x, y + 1, z), _corner(paths, g, x + 1, y + 1, z), u)
        top = wp.lerp(_corner(paths, g, x, y, z + 1), _corner(paths, g, x + 1, y, z + 1), u)
        far = wp.lerp(_corner(paths, g, x, y + 1, z + 1), _corner(paths, g, x + 1, y + 1, z + 1), u)
        depth = -wp.lerp(wp.lerp(low, side, v), wp.lerp(top, far, v), w) - paths.slack[tid]
        if depth > wp.float64(0.0):
            wp.atomic_add(loss, 0, wp.float64(0.5) * paths.weight[tid] * depth * depth)
