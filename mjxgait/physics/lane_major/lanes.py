"""Arithmetic over lanes that folds the numbers of the model while tracing.

All arrays have the lanes last, so that every operation is a contiguous vector instruction. A
`Scalar` is an array ([L], or [n, L] for n bodies at once; L is 1 if all lanes share it), or a
Python number if it is a constant: the many zeros and ones of a model then cost nothing. Three
scalars make a `Vector`; `turn` and `plus` also serve vectors that are one array [3, L].
"""

import contextlib
import contextvars
import functools
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Protocol, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.experimental.xla_metadata import set_xla_metadata

from mjxgait.types import Number, Tree

Result = TypeVar("Result")


_APART = contextvars.ContextVar("apart", default=False)
"""Whether functions are traced now without the mark of `one_kernel`."""


@contextlib.contextmanager
def separate_kernels() -> Iterator[None]:
    """Leave `one_kernel` without effect on what is traced in this context.

    XLA's CPU compiler aborts on marked calls that JAX traces into a `custom_vmap`.
    """
    token = _APART.set(True)
    try:
        yield
    finally:
        _APART.reset(token)


def one_kernel(function: Callable[..., Result]) -> Callable[..., Result]:
    """Compile the function on CPU into a single kernel instead of one per fused operation.

    XLA's CPU runtime starts every kernel separately (70 ns or more each), and a physics step has
    hundreds on small arrays. XLA compiles calls that carry this mark whole, as it does by default
    with small loops. Elsewhere this changes nothing.

    The function must have at least two results that are used: XLA mishandles a marked call
    with a single result that it would split over threads.
    """

    @functools.wraps(function)
    def unmarked(*args: object) -> Result:
        with set_xla_metadata(xla_cpu_small_call=None, inlineable=None):
            return function(*args)

    compiled = jax.jit(unmarked)

    @functools.wraps(function)
    def marked(*args: object) -> Result:
        if jax.default_backend() != "cpu" or _APART.get():
            return function(*args)
        with set_xla_metadata(xla_cpu_small_call="true", inlineable="false"):
            return compiled(*args)

    return marked


Scalar = Any
"""float | jax.Array; the folding of constants decides which."""
Column = Any
"""Vector as one array [3, L], or [3] if constant; zero as the number 0.0."""
Vector = tuple[Scalar, Scalar, Scalar]
Constants = tuple[float, float, float]
Matrix = tuple[Constants, Constants, Constants]
"""Three columns."""


class Pin(Protocol):
    """Function that makes XLA compute the values of a pytree once; see `pinned_by`."""

    def __call__(self, tree: Tree, /) -> Tree:
        """Return the same values."""
        ...


def constant(value: float) -> float:
    """Return a model number as a Python float.

    Values within rounding of -1, 0 and 1 become exact, so that they fold.
    """
    nearest = float(round(float(value)))
    return nearest if abs(value - nearest) < 1e-12 and abs(nearest) <= 1 else float(value)


def constants(values: np.ndarray) -> Any:
    """Convert values to nested tuples of constants, the last axis innermost."""
    return tuple(constants(v) for v in values) if np.ndim(values) else constant(float(values))


def rotation(quat: Sequence[Scalar]) -> tuple[Vector, Vector, Vector]:
    """Columns of the rotation matrix of a unit quaternion (w, x, y, z)."""
    w, x, y, z = quat
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
        (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
        (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)),
    )


def columns(quat: np.ndarray) -> Matrix:
    """Columns of the rotation matrix of a constant unit quaternion."""
    return constants(np.array(rotation([float(q) for q in quat])))


def _is(number: Scalar, value: float) -> bool:
    return isinstance(number, float) and number == value


def mul(a: Scalar, b: Scalar) -> Scalar:
    """Multiply; constants 0, 1 and -1 cost nothing."""
    if _is(a, 0.0) or _is(b, 0.0):
        return 0.0
    if _is(a, 1.0) or _is(b, 1.0):
        return b if _is(a, 1.0) else a
    if _is(a, -1.0) or _is(b, -1.0):
        return -b if _is(a, -1.0) else -a
    return a * b


def add(*terms: Scalar) -> Scalar:
    """Add, leaving out constant zeros."""
    counted = [t for t in terms if not _is(t, 0.0)]
    return total(counted) if counted else 0.0


def total(terms: Sequence[Scalar]) -> Scalar:
    """Sum one or more terms in their order."""
    result = terms[0]
    for term in terms[1:]:
        result = result + term
    return result


def sub(a: Scalar, b: Scalar) -> Scalar:
    """Subtract."""
    return a if _is(b, 0.0) else -b if _is(a, 0.0) else a - b


def dot(a: Sequence[Scalar], b: Sequence[Scalar]) -> Scalar:
    """Inner product of two sequences of equal length."""
    return add(*(mul(x, y) for x, y in zip(a, b, strict=True)))


def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return (
        sub(mul(a[1], b[2]), mul(a[2], b[1])),
        sub(mul(a[2], b[0]), mul(a[0], b[2])),
        sub(mul(a[0], b[1]), mul(a[1], b[0])),
    )


def plus(a: Sequence[Scalar], b: Sequence[Scalar]) -> tuple[Scalar, ...]:
    """Sum of vectors."""
    return tuple(add(x, y) for x, y in zip(a, b, strict=True))


def minus(a: Sequence[Scalar], b: Sequence[Scalar]) -> tuple[Scalar, ...]:
    """Difference of vectors."""
    return tuple(sub(x, y) for x, y in zip(a, b, strict=True))


def scale(s: Scalar, a: Sequence[Scalar]) -> tuple[Scalar, ...]:
    """Vector times scalar."""
    return tuple(mul(s, x) for x in a)


def turn(matrix: Sequence[Column], vector: Sequence[Scalar]) -> Column:
    """Multiply a matrix and a vector; the matrix is three columns, each an array [3, L]."""
    return dot(matrix, vector)


def turn_each(matrices: Sequence[Number], vectors: Number) -> Vector:
    """Apply `turn` to n vectors [n, 3, L], each with its own three columns [n, 3, L].

    Components [n, L].
    """
    x, y, z = (total([vectors[:, j] * matrices[j][:, i] for j in range(3)]) for i in range(3))
    return x, y, z


def axes(array: jax.Array) -> Vector:
    """Split vectors stored together, [n, 3, L], into three components [n, L]."""
    return array[:, 0], array[:, 1], array[:, 2]


def parts(vector: Column) -> Vector:
    """Split an array [3, L], or zero, into components."""
    return (0.0, 0.0, 0.0) if isinstance(vector, float) else (vector[0], vector[1], vector[2])


def sin_cos(angle: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Sine and cosine of angles in rad, to float32's rounding up to some thousand turns.

    XLA's CPU compiler calls the C library once per lane for each of the two, which took more time
    than the rest of the kinematics. Here the angle is brought within an eighth of a turn of a
    multiple of a quarter (Cody & Waite 1980), where short polynomials suffice (coefficients of the
    Cephes library's sinf and cosf).
    """
    quarter = jnp.round(angle * (2 / np.pi))
    near = (
        (angle - quarter * 1.5703125) - quarter * 4.837512969970703e-4
    ) - quarter * 7.549789954891e-8
    square = near * near
    sine = near + near * square * (
        -1.6666654611e-1 + square * (8.3321608736e-3 + square * -1.9515295891e-4)
    )
    cosine = (
        1
        - 0.5 * square
        + square
        * square
        * (4.166664568298827e-2 + square * (-1.388731625493765e-3 + square * 2.443315711809948e-5))
    )
    # Without integers: quarter modulo 4 is 0, 1, 2 or 3.
    quadrant = quarter - 4 * jnp.floor(0.25 * quarter)
    odd = (quadrant == 1) | (quadrant == 3)
    sin = jnp.where(odd, cosine, sine)
    cos = jnp.where(odd, sine, cosine)
    return jnp.where(quadrant >= 2, -sin, sin), jnp.where(
        (quadrant == 1) | (quadrant == 2), -cos, cos
    )


def pinned_by(lanes: jax.Array) -> Pin:
    """Return a function that makes XLA compute a pytree's values once, instead of once per use.

    XLA's fusion copies cheap producers into each consumer; along a kinematic chain the copies
    multiply. It never copies a division, and a division by one that the compiler cannot prove to be
    one changes nothing else. (`optimization_barrier` is removed before fusion on CPU.)
    lanes: any finite [L] array.
    """
    one = lanes * 0.0 + 1.0
    return lambda tree: jax.tree.map(lambda x: x if isinstance(x, float) else x / one, tree)


def column(values: Sequence[Scalar], dtype: np.dtype) -> Number:
    """Stack scalars, constants among them: [n, 1], or [n, L] if one has lanes."""
    if all(isinstance(value, float) for value in values):
        return np.array(values, dtype)[:, None]
    wide = jnp.broadcast_shapes((1,), *(np.shape(value) for value in values))
    return jnp.stack([jnp.broadcast_to(jnp.asarray(v, dtype), wide) for v in values])


def table(vectors: Sequence[Column], like: jax.Array) -> Any:
    """Stack vectors [3, L], some of them constants ([3] or zero), as one array [n, 3, L].

    [n, 3, 1] in NumPy if all are constants.
    """
    if all(not isinstance(v, jax.Array) for v in vectors):
        return np.array([np.broadcast_to(v, 3) for v in vectors], like.dtype)[:, :, None]
    shape = (3, like.shape[-1])

    def full(vector: Column) -> jax.Array:
        if isinstance(vector, jax.Array):
            return jnp.broadcast_to(vector, shape)
        return jnp.broadcast_to(np.reshape(np.broadcast_to(vector, 3), (3, 1)), shape)

    return jnp.stack([full(v) for v in vectors])
