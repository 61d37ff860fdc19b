"""Newton's method for MuJoCo's contact problem.

The acceleration a minimises
`(a - a_smooth)^T M (a - a_smooth) / 2 + sum over rows of D min(J a - reference, 0)^2 / 2`
(Todorov 2014; MuJoCo documentation, "Computation", "Optimization algorithms"). This is piecewise
quadratic and convex: Newton with an exact line search ends after a few steps. The Hessian
`M + J^T D J` has the tree's sparsity, see `treematrix`.
"""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from mjxgait.physics.lane_major.constraints import Constraints
from mjxgait.physics.lane_major.lanes import Pin, dot, minus
from mjxgait.physics.lane_major.treematrix import (
    Rows,
    factor,
    multiply,
    on_pivot,
    solve,
)

Lanes = jax.Array
Search = tuple[Lanes, Lanes, Lanes, Lanes, jax.Array]
"""Bracket, length, whether the lane goes on, and the number of evaluations."""
MANY = 32
"""Number of constraint rows above which sums over them are folded."""
FLAT = 1e-5
"""Share of the initial slope below which a line search ends."""
Edges = list[jax.Array]
"""One value per constraint row: four [C, L] (edges of contacts) and one [M, L] (limits)."""


@dataclasses.dataclass(frozen=True)
class Problem:
    """Contact problem. mass: rows of M. force: [nv] list of [L], all but the constraints'."""

    mass: Rows
    force: list[Lanes]
    constraints: Constraints
    pin: Pin


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Iterate:
    """Point of the iteration.

    acceleration: a, and inertial: M a, lists of nv [L]. residuals: J a - reference of the contacts'
    three directions [C, L] and of the limits [M, L].
    """

    acceleration: list[Lanes]
    inertial: list[Lanes]
    residuals: tuple[jax.Array, ...]


def constrained_acceleration(
    problem: Problem, guess: Sequence[Lanes]
) -> tuple[list[Lanes], list[Lanes]]:
    """Acceleration and generalised constraint force, lists of nv [L].

    guess: the previous step's acceleration. MuJoCo also tries the smooth acceleration and takes the
    better. Where no row is active, Newton's first step leads there from anywhere; elsewhere the
    guess is better but for a few steps in a thousand.
    """
    inertial = problem.pin(multiply(problem.constraints.structure.pattern, problem.mass, guess))
    start = Iterate(list(guess), inertial, _residuals(problem, guess))
    iterate = _minimised(problem, start)
    return iterate.acceleration, _constraint_force(problem, iterate)


def _minimised(problem: Problem, start: Iterate) -> Iterate:
    """Iterate until no lane's active rows change (the step before was then exact).

    The model's number of iterations is the maximum.
    """
    limit = problem.constraints.structure.iterations
    if limit == 1:
        return _improved(problem, start)

    def unfinished(carry: tuple[Iterate, Lanes, jax.Array]) -> jax.Array:
        return (carry[2] < limit) & jnp.any(carry[1] > 0)

    def body(carry: tuple[Iterate, Lanes, jax.Array]) -> tuple[Iterate, Lanes, jax.Array]:
        at, going, count = carry
        new = _improved(problem, at)
        # A finished lane stays fixed, so that its result does not depend on its neighbours.
        kept = jax.tree.map(lambda b, a: jnp.where(going > 0, b, a), new, at)
        return kept, _switched(problem, at, kept), count + 1

    return jax.lax.while_loop(
        unfinished, body, (start, jnp.ones_like(start.acceleration[0]), jnp.int32(0))
    )[0]


def _switched(problem: Problem, before: Iterate, after: Iterate) -> Lanes:
    """Count per lane the rows that became active or inactive."""
    c = problem.constraints
    pairs = zip(_edges(c, before.residuals), _edges(c, after.residuals), _weights(c), strict=True)
    return _total([jnp.where(((a < 0) != (b < 0)) & (w > 0), 1.0, 0.0) for a, b, w in pairs])


def _residuals(problem: Problem, acceleration: Sequence[Lanes]) -> tuple[jax.Array, ...]:
    c = problem.constraints
    references = (*c.reference, c.limit_reference)
    found = zip(c.along(acceleration), references, strict=True)
    return problem.pin(tuple(a - r for a, r in found))


def _edges(c: Constraints, values: Sequence[jax.Array]) -> Edges:
    """Convert the contacts' three directions to the pyramid's four edges."""
    normal, first, second, limit = values
    return [
        normal + c.friction * first,
        normal - c.friction * first,
        normal + c.friction * second,
        normal - c.friction * second,
        limit,
    ]


def _weights(c: Constraints) -> Edges:
    return [c.weight] * 4 + [c.limit_weight]


def _total(parts: Sequence[jax.Array]) -> Lanes:
    """Sum all rows of all arrays [n, L]."""
    if max(part.shape[0] for part in parts) > MANY:
        return _folded(parts)
    rows = [part[n] for part in parts for n in range(part.shape[0])]
    return sum(rows[1:], rows[0])


def _folded(parts: Sequence[jax.Array]) -> Lanes:
    """Sum all rows by halves: from hundreds of separate terms XLA makes slow code."""
    sums: dict[int, jax.Array] = {}
    for part in parts:
        count = part.shape[0]
        sums[count] = sums[count] + part if count in sums else part
    ends = []
    for rows in sums.values():
        while rows.shape[0] > 1:
            half, odd = divmod(rows.shape[0], 2)
            whole = rows[:half] + rows[half : 2 * half]
            rows = jnp.concatenate([whole, rows[-1:]]) if odd else whole
        ends.append(rows[0])
    return sum(ends[1:], ends[0])


def _constraint_force(problem: Problem, at: Iterate) -> list[Lanes]:
    """J^T f with f = -D times the negative residuals."""
    c = problem.constraints
    f = [
        -w * jnp.minimum(r, 0.0) for w, r in zip(_weights(c), _edges(c, at.residuals), strict=True)
    ]
    normal, first, second, limit = problem.pin(
        (
            f[0] + f[1] + f[2] + f[3],
            c.friction * (f[0] - f[1]),
            c.friction * (f[2] - f[3]),
            c.sign * f[4],
        )
    )
    gathered = c.footing.gathered((normal, first, second)) if c.footing else {}
    none = jnp.zeros_like(problem.force[0])
    force = [gathered.get(k, none) for k in range(len(problem.force))]
    for n, bound in enumerate(c.structure.limits):
        force[bound.dof] = force[bound.dof] + limit[n]
    return problem.pin(force)


def _improved(problem: Problem, at: Iterate) -> Iterate:
    """Take one Newton step with exact line search."""
    c, pin = problem.constraints, problem.pin
    pattern = c.structure.pattern
    uphill = minus(minus(at.inertial, problem.force), _constraint_force(problem, at))
    step = solve(pattern, factor(pattern, _hessian(problem, at)), [-g for g in uphill])
    inertial = pin(multiply(pattern, problem.mass, step))
    change = c.along(step)
    length = _line_search(problem, at, step, inertial, change)

    def moved(values: Sequence[jax.Array], changes: Sequence[jax.Array]) -> list[jax.Array]:
        return pin([v + length * d for v, d in zip(values, changes, strict=True)])

    return Iterate(
        moved(at.acceleration, step),
        moved(at.inertial, inertial),
        tuple(moved(at.residuals, change)),
    )


def _hessian(problem: Problem, at: Iterate) -> Rows:
    """Rows of M + J^T D J over the active rows."""
    c, pin = problem.constraints, problem.pin
    d = [
        jnp.where(r < 0, w, 0.0) for w, r in zip(_weights(c), _edges(c, at.residuals), strict=True)
    ]
    mu = c.friction
    mixed, squares = (
        (mu * (d[0] - d[1]), mu * (d[2] - d[3])),
        (mu * mu * (d[0] + d[1]), mu * mu * (d[2] + d[3])),
    )
    *stiffness, limit = pin((d[0] + d[1] + d[2] + d[3], *mixed, *squares, d[4]))
    rows = list(c.footing.stiffened(problem.mass, stiffness) if c.footing else problem.mass)
    for n, bound in enumerate(c.structure.limits):
        rows[bound.dof] = on_pivot(rows[bound.dof], limit[n])
    return tuple(rows)


def _line_search(
    problem: Problem,
    at: Iterate,
    step: Sequence[Lanes],
    inertial: Sequence[Lanes],
    change: Sequence[jax.Array],
) -> Lanes:
    """Find the length [L] that minimises the cost along a step.

    Newton on its derivative, which grows piecewise linearly, kept in a bracket.
    """
    c, pin = problem.constraints, problem.pin
    slope = pin(dot(step, minus(at.inertial, problem.force)))
    curvature = pin(dot(step, inertial))
    residuals, changes, weights = _edges(c, at.residuals), _edges(c, change), _weights(c)

    def derivatives(length: Lanes) -> tuple[Lanes, Lanes]:
        pulls, stiffs = [], []
        for r, d, w in zip(residuals, changes, weights, strict=True):
            now = r + length * d
            pulls.append(w * d * jnp.minimum(now, 0.0))
            stiffs.append(jnp.where(now < 0, w * d * d, 0.0))
        return slope + length * curvature + _total(pulls), curvature + _total(stiffs)

    def unfinished(carry: Search) -> jax.Array:
        return (carry[-1] < c.structure.line_iterations) & jnp.any(carry[-2] > 0)

    def narrowed(carry: Search) -> Search:
        low, high, length, going, count = carry
        first, second = pin(derivatives(length))
        low, high = jnp.where(first < 0, length, low), jnp.where(first < 0, high, length)
        newton = length - first / jnp.maximum(second, np.finfo(slope.dtype).tiny)
        middle = jnp.where(high < jnp.inf, 0.5 * (low + high), 2.0 * length)
        found = jnp.where((newton >= low) & (newton <= high), newton, middle)
        # A finished lane stays fixed, so that its result does not depend on its neighbours.
        going = jnp.where(jnp.abs(first) > FLAT * jnp.abs(slope), going, 0.0)
        return low, high, pin(jnp.where(going > 0, found, length)), pin(going), count + 1

    one = jnp.ones_like(slope)
    start = (jnp.zeros_like(slope), jnp.full_like(slope, jnp.inf), one, one, jnp.int32(0))
    return jax.lax.while_loop(unfinished, narrowed, start)[2]
