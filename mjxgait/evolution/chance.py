"""The random numbers of a run, by a generator that costs the compiler little.

JAX's own, Threefry, has twenty rounds, which are written out wherever evolution draws: a tenth to
three fifths of the time to compile what proposes. What evolves needs no cipher. Here the 32 bits at a
place of a stream are its number, mixed with one half of the key and then with the other by an integer
hash of two rounds.
"""

import math

import jax
import jax.numpy as jnp
from jax.extend.random import define_prng_impl

from mjxgait.errors import UserError

NAME = "hashed"
"""As checkpoints tell which generator a key belongs to."""
STEP = 0x9E3779B9
"""From one place of a stream to the next; odd, so that no two places are the same."""
SPLIT, FOLD, DRAW = 0x243F6A88, 0x85A308D3, 0x13198A2E
"""What the same key is used for tells its streams apart; the first digits of pi."""


def key_of(seed: int) -> jax.Array:
    """The key [] that all draws of a run follow from, by `jax.random` as usual."""
    return jax.random.key(seed, impl=_HASHED)


def key_from(data: jax.Array, generator: str, where: str) -> jax.Array:
    """A key [...] from its numbers [..., 2].

    Raises:
      UserError: see `check_generator`.
    """
    check_generator(generator, where)
    return jax.random.wrap_key_data(data, impl=_HASHED)


def check_generator(generator: str, where: str) -> None:
    """Refuses a run of another generator, whose draws nobody could go on with.

    Raises:
      UserError: says so, and where it was found.
    """
    if generator != NAME:
        raise UserError(
            f"{where}: begun with the random numbers {generator}, this version draws {NAME} ones; "
            "train anew, or resume with the version that began it"
        )


def _mixed(x: jax.Array) -> jax.Array:
    """Another 32 bits for each 32 bits: every bit of one changes about half of the other's.

    Source: Wellons, hash-prospector, the two-round function with the least bias.
    """
    x = (x ^ (x >> 16)) * jnp.uint32(0x21F0AAAD)
    x = (x ^ (x >> 15)) * jnp.uint32(0x735A2D97)
    return x ^ (x >> 15)


def _bits(key: jax.Array, places: jax.Array, use: int) -> jax.Array:
    once = _mixed(places * jnp.uint32(STEP) + key[0])
    return _mixed((once ^ jnp.uint32(use)) + key[1])


def _places(shape: tuple[int, ...]) -> jax.Array:
    return jax.lax.iota(jnp.uint32, math.prod(shape)).reshape(shape)


def _seed(seed: jax.Array) -> jax.Array:
    return _fold_in(jnp.zeros(2, jnp.uint32), seed)


def _split(key: jax.Array, shape: tuple[int, ...]) -> jax.Array:
    return _bits(key, _places((*shape, 2)), SPLIT)


def _fold_in(key: jax.Array, data: jax.Array | int) -> jax.Array:
    number = jnp.uint32(data)
    # Two places for each number leave none for its highest bit, which goes into the key.
    return _bits(key + (number >> 31), 2 * number + _places((2,)), FOLD)


def _random_bits(key: jax.Array, width: int, shape: tuple[int, ...]) -> jax.Array:
    assert width <= 32, "wider numbers are switched off in JAX"
    return _bits(key, _places(shape), DRAW).astype(f"uint{width}")


_HASHED = define_prng_impl(
    key_shape=(2,),
    seed=_seed,
    split=_split,
    fold_in=_fold_in,
    random_bits=_random_bits,
    name=NAME,
    tag=NAME,
)
