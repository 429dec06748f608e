"""The convex separable subproblem of the method of moving asymptotes, and its solution by the dual.

    minimise f~_0(r) + sum_i c y_i + y_i^2 / 2  subject to  f~_i(r) <= y_i, y_i >= 0, r_min <= r <= r_max,
    f~_i(r) = f_i + sum_j p_ij (r_j - 1) + q_ij (1 / r_j - 1)

See `mma` for what p, q and r are. One constraint: the dual has one variable, found by safeguarded Newton. More: a
primal-dual interior point method.

Of k > 1 objectives f~_0l the largest is minimised: z subject to f~_0l(r) <= z. The dual then has a multiplier for each
of them, of sum one, and z is that sum's own multiplier.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from mpmtop.arrays import Array, Mask
from mpmtop.errors import NotConverged

PENALTY = 1000.0  # c of the artificial variables
VIOLATION_TOL = 1e-9  # the largest violation that may be bought: ten times what the dual leaves of a constraint
SMALLEST = np.finfo(float).tiny
AT_ONCE = 16_384
"""Variables taken at a time, so that what is computed of them stays in the processor's cache."""


@dataclass(frozen=True, eq=False)
class Subproblem:
    """f~ around x_k: values f (k+m,), p and q (k+m, n), sigma (n,); r (n,) between `r_min` and `r_max`.

    The first k = `objectives` functions are objectives, the other m constraints.
    """

    f: Array
    p: Array
    q: Array
    sigma: Array
    r_min: Array
    r_max: Array
    objectives: int = 1

    @property
    def priced(self) -> int:
        """How many of the functions, from the first on, have a multiplier in the dual that stands for an objective."""
        return self.objectives if self.objectives > 1 else 0


def approximation(sub: Subproblem, r: Array) -> Array:
    """f~ (k+m,) at r (n,)."""
    return sub.f + sub.p @ (r - 1) + sub.q @ (1 / r - 1)


def dual(sub: Subproblem, lam: Array) -> tuple[Array, Array, Array]:
    """r (n,) that minimises f~_0 + lam . f~_1..m, f~ (1+m,) there, and d f~_i / d lam_j (m, m), for lam (m,) >= 0; of
    k > 1 objectives lam . f~, with f~ and lam (k+m,), and derivatives (k+m, k+m).

    r = sqrt(q / p), p and q summed with their multipliers, clipped to its limits; only variables between them move with
    lam, by dr / dlam_i = -(df~_i / dr) r / (2 p).
    """
    first_row = len(sub.f) - len(lam)
    weights = np.concatenate((np.ones(first_row), lam))
    r, value, slopes = np.empty_like(sub.r_min), sub.f, np.zeros((len(lam), len(lam)))
    for first in range(0, len(r), AT_ONCE):
        part = slice(first, first + AT_ONCE)
        p_i, q_i, r_min, r_max = sub.p[:, part], sub.q[:, part], sub.r_min[part], sub.r_max[part]
        p, q = weights @ p_i, weights @ q_i
        r[part] = ratio = np.minimum(np.maximum(np.sqrt(q / p), r_min), r_max)
        inverse = 1 / ratio
        value = value + p_i @ (ratio - 1) + q_i @ (inverse - 1)
        slope = p_i[first_row:] - q_i[first_row:] * (inverse * inverse)
        free = (ratio > r_min) & (ratio < r_max)
        slopes -= (slope * (free * ratio / (2 * p))) @ slope.T
    return r, value, slopes


def solve_subproblem(sub: Subproblem) -> Array:
    """r (n,) of the subproblem's minimum; NotConverged if its dual defies solution (badly scaled constraints).

    A violation must not be cheaper than the objective it buys, whatever the objective's unit. So while a multiplier
    stands above the price, the objective counts a thousandth of what it did, until all constraints are met or the whole
    objective buys no violation that counts: then no step within these limits meets them.
    """
    solve, k = solve_single if len(sub.f) == 2 else solve_multiple, sub.objectives
    r, lam = solve(sub)
    if np.all(lam[sub.priced :] <= PENALTY):
        return r
    weight = np.ones((len(sub.f), 1))
    # what the objective can change by within the limits
    worth = np.max(sub.p[:k] @ (sub.r_max - sub.r_min) + sub.q[:k] @ (1 / sub.r_min - 1 / sub.r_max))
    while np.any(lam[sub.priced :] > PENALTY) and weight[0] * worth > PENALTY * VIOLATION_TOL:
        weight[:k] /= PENALTY
        r, lam = solve(replace(sub, f=weight[:, 0] * sub.f, p=weight * sub.p, q=weight * sub.q))
    return r


CRAWLS = 40
"""Steps after which the bracket is halved, whatever Newton's method says: 60 halvings find any root to 1e-13."""


def solve_single(sub: Subproblem) -> tuple[Array, Array]:
    """r (n,) and lam (1,) for one constraint: the root lam of f~_1 - y, which falls with lam, by safeguarded Newton."""
    df0, dg = (sub.p - sub.q) * ((sub.r_min < 1) & (sub.r_max > 1))
    low, high = -1.0, np.inf  # low < 0: lam = 0, an inactive constraint, has not been tried
    lam = min(max(-(df0 @ dg) / max(dg @ dg, SMALLEST), 0.0), PENALTY)  # least squares of stationarity at x_k
    for step in range(100):
        r, f, slope = dual(sub, np.array([lam]))
        g = f[1] - max(lam - PENALTY, 0.0)
        if g > 0:
            low, high = lam, min(high, PENALTY + f[1])
        elif lam == 0:
            return r, np.zeros(1)
        else:
            high = lam
        g_slope = slope[0, 0] - (lam >= PENALTY)
        trial = lam - g / g_slope if g_slope < 0 else lam if g == 0 else np.copysign(np.inf, g)
        if abs(trial - lam) <= 1e-13 * lam or high - low <= 1e-13 * lam:
            return r, np.array([lam])
        if trial <= 0 and low < 0:
            trial = 0.0
        elif step >= CRAWLS or not low < trial <= high:
            # only an infeasible subproblem has its root above the penalty; else halve the decades, at most 8 at once
            trial = PENALTY if low < PENALTY < high else np.sqrt(max(low, 1e-8 * high) * high)
        lam = trial
    raise NotConverged("the subproblem's multiplier was not found in 100 steps: scale the constraint to order one")


def solve_multiple(sub: Subproblem) -> tuple[Array, Array]:
    """r (n,) and lam (m,), or (k+m,) of k > 1 objectives, for any number of constraints: primal-dual interior-point
    Newton on the dual.

    Solves f~_i - y_i + s_i = 0, lam_i s_i = mu for mu -> 0; for several objectives f~_i - z + s_i = 0 with
    sum lam_i = 1 over them. Without s the Newton system is symmetric positive definite, but for z, and its solution
    ascends the concave dual with a barrier, W(lam) + mu sum log lam; the step is halved while that function already
    falls steeply at its end (a test on slopes, as its values are lost in rounding long before).
    """
    k = sub.priced
    values = sub.f if k else sub.f[1:]
    lam, bounded = np.ones(len(values)), np.arange(len(values)) < k
    lam[bounded] = 1 / max(k, 1)
    cap = np.where(bounded, np.inf, PENALTY)
    tol = 1e-10 * (1 + np.abs(values))  # f~ is exact to about 1e-14 of its terms
    r, f, slope = dual(sub, lam)
    f = f[len(f) - len(lam) :]
    z = float(np.max(f[bounded], initial=-np.inf)) if k else 0.0
    g = f - z * bounded
    slack = np.maximum(np.abs(g), 1e-8)
    mu = np.mean(slack)
    for _ in range(200):
        ascent = g + mu / lam
        priced = (lam > cap) | ((lam == cap) & (ascent > 0))
        d_lam, d_z = _newton_step(np.diag(priced + slack / lam) - slope, ascent, bounded)
        d_slack = mu / lam - slack * (1 + d_lam / lam)
        t = _fraction_inside(lam, d_lam)
        for _ in range(40):
            # the Hessian jumps at the penalty: a multiplier that would cross it stops there
            lam_new = lam + t * d_lam
            lam_new = np.where((lam < cap) & (lam_new > cap), cap, lam_new)
            r, f, slope = dual(sub, lam_new)
            g = f[len(f) - len(lam) :] - np.maximum(lam_new - cap, 0) - (z + t * d_z) * bounded
            end = g + mu / lam_new
            if (end + 0.1 * ascent) @ (lam_new - lam) >= 0 or np.all(np.abs(end) <= tol):
                break
            t /= 2
        lam, z = lam_new, z + t * d_z
        # slacks drift from mu / lam where the Hessian jumps; bounded, they keep the direction sound
        slack = np.clip(slack + _fraction_inside(slack, d_slack) * d_slack, 1e-8 * mu / lam, 1e8 * mu / lam)
        if np.all(np.abs(g + slack) <= np.maximum(mu, tol)) and np.all(np.abs(lam * slack - mu) <= 0.9 * mu):
            if mu <= 1e-12:
                return r, lam
            mu *= 0.1
    raise NotConverged("the subproblem's multipliers were not found in 200 steps: scale the constraints to order one")


def _newton_step(matrix: Array, b: Array, bounded: Mask) -> tuple[Array, float]:
    """d_lam and d_z of matrix d_lam + bounded d_z = b with bounded . d_lam = 0; d_z = 0 if nothing is bounded."""
    if not np.any(bounded):
        return _solve_scaled(matrix, b), 0.0
    a = bounded.astype(float)
    free, along = _solve_scaled(matrix, b), _solve_scaled(matrix, a)
    d_z = float(a @ free / (a @ along))
    return free - d_z * along, d_z


def _solve_scaled(matrix: Array, b: Array) -> Array:
    """Solution of a positive definite system, its diagonal raised by 1e-14: constraints alike make it singular."""
    scale = 1 / np.sqrt(np.diag(matrix))
    return scale * cho_solve(cho_factor(matrix * np.outer(scale, scale) + 1e-14 * np.eye(len(b))), scale * b)


def _fraction_inside(value: Array, change: Array) -> float:
    """The largest step, at most 1, that keeps a hundredth of every positive `value`."""
    return min(1.0, 0.99 / max(np.max(-change / value), SMALLEST))
