"""The dynamics of joints from recordings of how they were pulled."""

import queue
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag, toeplitz
from scipy.ndimage import binary_erosion, gaussian_filter1d
from scipy.optimize import lsq_linear, minimize

from s2a.core.errors import InputError
from s2a.joints.dynamics import LOWER, PARAMETERS, TYPICAL, UPPER, Dynamics, JointWorlds
from s2a.joints.pull import Noise, Pull, same_step
from s2a.joints.pulled import Moving
from s2a.sim.solver import EDGE

# Points [problem variable] -> values [problem] and gradients [problem variable]
Evaluate = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Minima:
    """What was found."""

    points: np.ndarray  # shape [problem variable]
    values: np.ndarray  # shape [problem]
    rounds: int  # how often all problems were evaluated


def minimize_together(
    evaluate: Evaluate, starts: np.ndarray, lower: np.ndarray, upper: np.ndarray, rounds: int, chosen: np.ndarray
) -> Minima:
    """Minimise each problem by SciPy's L-BFGS-B, a thread each, which wait for each other at every evaluation.

    Args:
        evaluate: of all problems at once; a problem that has ended is evaluated where it ended.
        starts: shape [problem variable].
        lower: bounds, shape [variable] or [problem variable].
        upper: likewise.
        rounds: at most, about.
        chosen: which problems to minimise, shape [problem]; the others stay at their starts, of infinite value.
    """
    points = starts.copy()
    low, high = (np.broadcast_to(bound, starts.shape) for bound in (lower, upper))
    requests: queue.Queue[int] = queue.Queue()
    answers: list[queue.Queue[tuple[float, np.ndarray]]] = [queue.Queue() for _ in starts]
    values = np.full(len(starts), np.inf)

    def solve(i: int) -> None:
        def ask(x: np.ndarray) -> tuple[float, np.ndarray]:
            points[i] = x
            requests.put(i)
            return answers[i].get()

        try:
            limits = list(zip(low[i], high[i], strict=True))
            minimum = minimize(ask, starts[i], jac=True, method="L-BFGS-B", bounds=limits, options={"maxfun": rounds})
            points[i], values[i] = minimum.x, minimum.fun
        finally:
            requests.put(~i)

    running, done = set(np.flatnonzero(chosen).tolist()), 0
    threads = [threading.Thread(target=solve, args=(i,), daemon=True) for i in running]
    for thread in threads:
        thread.start()
    while running:
        waiting = [requests.get() for _ in running]
        running -= {~i for i in waiting if i < 0}
        if running:
            losses, gradients = evaluate(points)
            done += 1
            for i in running:
                answers[i].put((float(losses[i]), gradients[i]))
    return Minima(points, values, done)


# [s] Standard deviation of the Gaussian that smooths motion and force alike, which leaves their relation as it is
SMOOTHED = 0.05
REACH = 2.5  # Standard deviations around a sample that have to be of the same motion
MOVES = 0.01  # [m/s] Slower, dry friction may be anything below its bound
ASKED = [PARAMETERS.index(name) for name in ("mass", "damping", "friction", "spring", "pull_in", "closing")]
SOFT_CLOSE = slice(4, 6)  # Of ASKED
TELLS = 2.0  # Deviations from 0 from which a soft close is believed


def fit(body: Moving, pulls: Sequence[Pull], force_noise: float) -> Dynamics:
    """Return the dynamics by which the motion explains the force, by least squares over the samples that move.

    A force's noise is an error of the outcome alone, and biases nothing; that of positions hardly shows in the smoothed
    accelerations. Breakaway is not asked for; a soft close is left out where it does not tell itself.

    `force_noise`: standard deviation of the samples [N], for the misfit alone.

    Raises:
        InputError: the pulls do not move long enough.
    """
    step = same_step(pulls)
    samples = [_moving_samples(body, pull) for pull in pulls]
    if (count := sum(len(force) for _, force in samples)) < 4 * len(ASKED):
        raise InputError(
            f"the part moves faster than {MOVES} m/s in {count} samples only; give pulls of half a second or longer"
        )
    wanted = np.any(np.concatenate([columns for columns, _ in samples]) != 0.0, axis=0)
    solution, spread, variance = _solve(samples, wanted, step)
    idle = np.zeros_like(wanted)
    idle[SOFT_CLOSE] = solution[SOFT_CLOSE] < TELLS * spread[SOFT_CLOSE]
    if (wanted & idle).any():
        solution, without, variance = _solve(samples, wanted & ~idle, step)
        spread = np.where(idle, spread, without)
    values, deviations = np.zeros(len(PARAMETERS)), np.full(len(PARAMETERS), np.inf)
    values[ASKED], deviations[ASKED] = solution, spread
    expected = force_noise**2 * step / (2.0 * np.sqrt(np.pi) * SMOOTHED)
    return Dynamics(values, deviations, variance / expected)


# What ASKED are multiplied with, shape [sample parameter], and the force [N], of each pull
Samples = list[tuple[np.ndarray, np.ndarray]]


def _solve(samples: Samples, wanted: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the ASKED that were requested, the others 0, their deviations, the others' infinite, and the residuals' variance.

    A deviation is that of the residuals, which the smoothing has made alike among neighbours, or that of the pulls, each left out
    in turn (the jackknife), where this is larger: a grip that rolls errs alike all along a pull.
    """
    matrix, force = (np.concatenate(each) for each in zip(*samples, strict=True))
    solution = _least_squares(matrix, force, wanted)
    residual = force - matrix @ solution
    # Smoothed white noise: samples k steps apart correlate by exp(-(k step / 2 SMOOTHED)^2).
    lengths = [len(own) for _, own in samples]
    alike = block_diag(*(toeplitz(np.exp(-((np.arange(n) * step / (2 * SMOOTHED)) ** 2))) for n in lengths))
    inverse = np.linalg.pinv(matrix[:, wanted])
    free = len(force) - np.trace(matrix[:, wanted] @ (inverse @ alike))
    variance = float(residual @ residual) / max(free, 1.0)
    deviations = np.full(len(wanted), np.inf)
    deviations[wanted] = np.sqrt(variance * np.diagonal(inverse @ alike @ inverse.T))
    if (pulls := len(samples)) > 1:
        left = np.repeat(np.arange(pulls), lengths)
        others = np.array([_least_squares(matrix[left != k], force[left != k], wanted) for k in range(pulls)])
        jackknife = np.sqrt((pulls - 1) * others.var(axis=0))
        deviations = np.maximum(deviations, np.where(wanted, jackknife, np.inf))
    return solution, deviations, variance


def _least_squares(matrix: np.ndarray, force: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    solution = np.zeros(len(wanted))
    solution[wanted] = lsq_linear(matrix[:, wanted], force, (LOWER[ASKED][wanted], UPPER[ASKED][wanted])).x
    return solution


def _moving_samples(body: Moving, pull: Pull) -> tuple[np.ndarray, np.ndarray]:
    """Return what ASKED are multiplied with, and the force [N], where a pull moves."""
    step = pull.step

    def smooth(values: np.ndarray) -> np.ndarray:
        return gaussian_filter1d(values, SMOOTHED / step, mode="nearest")

    opening = smooth(pull.opening)
    speed, speeding = np.gradient(opening, step), np.zeros_like(opening)
    speeding[1:-1] = np.diff(opening, 2) / step**2
    first, second = body.gravity
    turn = pull.opening / body.lever if body.joint.kind == "revolute" else np.zeros_like(opening)
    weight = smooth(first * np.cos(turn) + second * np.sin(turn))
    acts = smooth(np.clip((body.reach - pull.opening) / (EDGE * body.reach), 0.0, 1.0))
    soft = (acts, acts * np.minimum(speed, 0.0))
    columns = np.column_stack([body.inertia * speeding - weight, speed, np.sign(speed), opening, *soft])
    around = np.ones(2 * round(REACH * SMOOTHED / step) + 1)
    moves = binary_erosion(np.abs(speed) > MOVES, around) & binary_erosion(np.ones(len(speed), bool), around)
    return columns[moves], smooth(pull.force)[moves]


# What a joint need not have: where recordings do not tell, it is none, and the others are fitted without it
OPTIONAL = np.isin(PARAMETERS, ("breakaway", "pull_in", "closing"))
# Where the search begins if it ended in a poor minimum from what least squares tell, one after another
STARTS = np.array(
    [[1.0, 5.0, 2.0, 1.0, 10.0, 0.0, 0.0], [0.4, 2.0, 1.0, 0.2, 2.0, 0.0, 0.0], [3.0, 15.0, 5.0, 1.0, 20.0, 5.0, 40.0]]
)
POOR = 1.5  # Misfit from which a minimum is poor
ROUNDS = 100
WORSE = 2.0  # Of log-likelihood: what a parameter that says nothing may explain by chance
STEP = 0.01  # Of the variables, in the differences of gradients by which the curvature is measured


def identify(
    bodies: Sequence[Moving], pulls: Sequence[Sequence[Pull]], noise: Noise, device: str = "cpu"
) -> list[Dynamics]:
    """Return the dynamics of each body's joint that explain its recordings best. `device`: cpu or cuda:0."""
    worlds = JointWorlds(bodies, pulls, same_step([pull for own in pulls for pull in own]), noise, device)

    def evaluate(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        loss, gradient = worlds.loss(parameters(x))
        return loss, gradient * slopes(x)

    expected = np.array([sum(len(pull.opening) - 1 for pull in own) for own in pulls]) / 2.0
    points, values = np.zeros((len(bodies), len(PARAMETERS))), np.full(len(bodies), np.inf)
    for start in (_first(bodies, pulls), *STARTS):
        poor = values > POOR * expected
        begin = np.where(poor[:, None], variables(np.broadcast_to(start, points.shape)), points)
        minima = minimize_together(evaluate, begin, variables(LOWER), variables(UPPER), ROUNDS, poor)
        better = minima.values < values
        points[better], values[better] = minima.points[better], minima.values[better]
        if (values <= POOR * expected).all():
            break
    return _without_idle(evaluate, points, values, expected)


def _without_idle(evaluate: Evaluate, points: np.ndarray, values: np.ndarray, expected: np.ndarray) -> list[Dynamics]:
    """Return minima as dynamics, fitted again without what is OPTIONAL and undetermined, where that explains them as well.

    Where it does not, and the curvature told nothing, the deviation is that of the likelihoods with it and without.

    Args:
        evaluate: the loss of all joints.
        points: shape [joint variable].
        values: their losses, shape [joint].
        expected: these where all is right, shape [joint].
    """
    first = _dynamics(evaluate, points, values / expected)
    spread, determined = (np.array([getattr(each, name) for each in first]) for name in ("deviations", "determined"))
    upper = np.broadcast_to(variables(UPPER), points.shape).copy()
    points, values = points.copy(), values.copy()
    for k in np.flatnonzero(OPTIONAL):
        idle = ~determined[:, k]
        bound = upper.copy()
        bound[idle, k] = 0.0
        fewer = minimize_together(evaluate, np.minimum(points, bound), variables(LOWER), bound, ROUNDS, idle)
        dropped = fewer.values < values + WORSE
        needed = idle & ~dropped
        lost = 2.0 * (fewer.values[needed] - values[needed])
        spread[needed, k] = np.minimum(spread[needed, k], parameters(points)[needed, k] / np.sqrt(lost))
        points[dropped], values[dropped], upper[dropped] = fewer.points[dropped], fewer.values[dropped], bound[dropped]
    again = _dynamics(evaluate, points, values / expected)
    undetermined = OPTIONAL & ~determined
    return [
        replace(each, deviations=np.where(none, old, each.deviations))
        for each, none, old in zip(again, undetermined, spread, strict=True)
    ]


def _first(bodies: Sequence[Moving], pulls: Sequence[Sequence[Pull]]) -> np.ndarray:
    """Return what least squares of the force tell, a start for samples so noisy, shape [joint parameter]."""
    first = np.tile(STARTS[0], (len(bodies), 1))
    for i, (body, own) in enumerate(zip(bodies, pulls, strict=True)):
        try:
            first[i] = fit(body, own, 1.0).values
        except InputError:  # they hardly move
            continue
    return first


def _dynamics(evaluate: Evaluate, points: np.ndarray, misfits: np.ndarray) -> list[Dynamics]:
    rows = zip(points, curvature(evaluate, points), parameters(points), slopes(points), misfits, strict=True)
    return [Dynamics(x, deviations(point, hessian) * slope, misfit) for point, hessian, x, slope, misfit in rows]


def variables(values: np.ndarray) -> np.ndarray:
    """Return what is searched for PARAMETERS, shape [.. parameter]: the mass's logarithm, the others in TYPICAL."""
    x = values / TYPICAL
    x[..., 0] = np.log(values[..., 0])
    return x


def parameters(x: np.ndarray) -> np.ndarray:
    """Return PARAMETERS of what is searched, shape [.. parameter]."""
    values = x * TYPICAL
    values[..., 0] = np.exp(x[..., 0])
    return values


def slopes(x: np.ndarray) -> np.ndarray:
    """Return the derivative of each parameter by its variable, shape [.. parameter]."""
    slope = np.broadcast_to(TYPICAL, x.shape).copy()
    slope[..., 0] = np.exp(x[..., 0])
    return slope


def curvature(evaluate: Evaluate, x: np.ndarray) -> np.ndarray:
    """Return the second derivatives of each problem at its point, shape [problem variable variable]."""
    columns = []
    for k in range(x.shape[1]):
        ahead, behind = x.copy(), x.copy()
        ahead[:, k] += STEP
        behind[:, k] = np.maximum(behind[:, k] - STEP, variables(LOWER)[k])
        columns.append((evaluate(ahead)[1] - evaluate(behind)[1]) / (ahead - behind)[:, k, None])
    hessian = np.stack(columns, axis=1)
    return (hessian + hessian.transpose(0, 2, 1)) / 2


def deviations(x: np.ndarray, hessian: np.ndarray) -> np.ndarray:
    """Return standard deviations of a minimum's variables from its curvature; infinite where that is none.

    What lies at a bound does not move with the others; its deviation is that of its own curvature. Nor do those that curve it
    downwards, what is OPTIONAL before the others: dry friction has kinks.
    """
    free = (x > variables(LOWER) + 1e-6) & (x < variables(UPPER) - 1e-6)
    own = np.diagonal(hessian)
    spread = np.where(own > 0.0, 1.0 / np.sqrt(np.maximum(own, 1e-12)), np.inf)
    index = np.flatnonzero(free)
    while len(index):
        values, vectors = np.linalg.eigh(hessian[np.ix_(index, index)])
        if values[0] > 0.0:
            spread[index] = np.sqrt((vectors**2 / values).sum(axis=1))
            break
        flat = (np.abs(vectors[:, 0]) * np.where(OPTIONAL[index], 10.0, 1.0)).argmax()
        spread[index[flat]], index = np.inf, np.delete(index, flat)
    return spread
