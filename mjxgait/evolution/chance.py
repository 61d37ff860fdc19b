"""Random numbers of a run, from a generator that compiles quickly.

JAX's own, Threefry, has twenty rounds, which are written out wherever evolution draws. They take a
tenth to three fifths of the time to compile `propose`. Evolution needs no cipher. Here the 32 bits
at a place of a stream are the place's number, mixed with one half of the key and then with the
other by an integer hash of two rounds.
"""

import math
from functools import partial

import jax
import jax.numpy as jnp
from jax.extend.random import define_prng_impl

from mjxgait.errors import UserError

NAME = "hashed"
"""Name of the generator, stored in checkpoints beside a key."""
STEP = 0x9E3779B9
"""Distance between places of a stream; odd, so that no two places are the same."""
SPLIT, FOLD, DRAW = 0x243F6A88, 0x85A308D3, 0x13198A2E
"""Constants that separate the streams of one key by their use; the first digits of pi."""


def key_of(seed: int) -> jax.Array:
    """Return the key [] of all draws of a run, for use with `jax.random`."""
    return jax.random.key(seed, impl=_HASHED)


def key_from(data: jax.Array, generator: str, where: str) -> jax.Array:
    """Return a key [...] from its numbers [..., 2].

    Raises:
      UserError: see `check_generator`.
    """
    check_generator(generator, where)
    return jax.random.wrap_key_data(data, impl=_HASHED)


def check_generator(generator: str, where: str) -> None:
    """Refuse a run of another generator: its draws cannot be continued.

    Raises:
      UserError: the generator is another; the message names it and `where`.
    """
    if generator != NAME:
        raise UserError(
            f"{where}: begun with the random numbers {generator}, this version draws {NAME} ones; "
            "train anew, or resume with the version that began it"
        )


def _mixed(x: jax.Array) -> jax.Array:
    """Hash each 32 bits to another 32 bits: every input bit changes about half of the output bits.

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


_program = partial(jax.jit, inline=True)
"""Inlined in a program; outside of one, a single program instead of one per operation."""


@_program
def _seed(seed: jax.Array) -> jax.Array:
    return _fold_in(jnp.zeros(2, jnp.uint32), seed)


@partial(_program, static_argnums=1)
def _split(key: jax.Array, shape: tuple[int, ...]) -> jax.Array:
    return _bits(key, _places((*shape, 2)), SPLIT)


@_program
def _fold_in(key: jax.Array, data: jax.Array | int) -> jax.Array:
    number = jnp.uint32(data)
    # Two places per number leave none for its highest bit, so that bit goes into the key.
    return _bits(key + (number >> 31), 2 * number + _places((2,)), FOLD)


@partial(_program, static_argnums=(1, 2))
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
