"""The random number generator: its draws are uniform and independent."""

import itertools
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from mjxgait.errors import UserError
from mjxgait.evolution.chance import NAME, key_from, key_of

MANY = 1 << 18
UNLIKELY = 1e-6
"""Probability that a correct generator fails a test."""


def bits_of(key: jax.Array, count: int = MANY) -> np.ndarray:
    return np.asarray(jax.random.bits(key, (count,), jnp.uint32))


def shares(bits: np.ndarray) -> np.ndarray:
    """The bits as numbers from 0 to 1."""
    return (bits.astype(np.float64) + 0.5) / 2**32


STREAMS = {
    "one key": lambda: bits_of(key_of(0)),
    "the first of many children": lambda: bits_of_each(jax.random.split(key_of(1), MANY)),
    "the first of many numbers folded in": lambda: bits_of_each(
        jax.vmap(jax.random.fold_in, (None, 0))(key_of(2), jnp.arange(MANY))
    ),
    "the first of many seeds": lambda: bits_of_each(jax.vmap(key_of)(jnp.arange(MANY))),
    "the first of children's only children": lambda: bits_of_each(
        jax.vmap(lambda key: jax.random.split(key, 1)[0])(jax.random.split(key_of(3), MANY))
    ),
}
"""Ways in which evolution draws numbers that must be independent."""


def bits_of_each(keys: jax.Array) -> np.ndarray:
    return np.asarray(jax.vmap(lambda key: jax.random.bits(key, (), jnp.uint32))(keys))


@pytest.fixture(scope="module", params=STREAMS)
def stream(request: pytest.FixtureRequest) -> np.ndarray:
    return STREAMS[request.param]()


@pytest.mark.parametrize("shift", [0, 8, 16, 24])
def test_every_byte_is_uniform(stream: np.ndarray, shift: int):
    assert stats.chisquare(np.bincount((stream >> shift) & 255, minlength=256)).pvalue > UNLIKELY


def test_the_shares_are_uniform(stream: np.ndarray):
    assert stats.kstest(shares(stream), "uniform").pvalue > UNLIKELY


@pytest.mark.parametrize("apart", [1, 2, 3, 64, 256])
def test_neighbours_are_uncorrelated(stream: np.ndarray, apart: int):
    assert stats.pearsonr(shares(stream)[:-apart], shares(stream)[apart:]).pvalue > UNLIKELY


def test_pairs_of_neighbours_fill_the_square(stream: np.ndarray):
    cells = (stream[::2] >> 27) * 32 + (stream[1::2] >> 27)
    assert stats.chisquare(np.bincount(cells, minlength=1024)).pvalue > UNLIKELY


def test_values_repeat_as_often_as_by_chance():
    firsts = STREAMS["the first of many children"]() >> 4
    twice, expected = MANY - len(np.unique(firsts)), MANY**2 / 2 / 2**28
    assert abs(twice - expected) < 6 * np.sqrt(expected)


@pytest.mark.parametrize("place", range(0, 64, 7))
def test_flipping_a_key_bit_flips_half_of_the_drawn_bits(place: int):
    key = jax.random.key_data(key_of(5))
    other = key.at[place // 32].set(key[place // 32] ^ jnp.uint32(1 << place % 32))
    a, b = (bits_of(key_from(data, NAME, "here"), 4096) for data in (key, other))
    flipped = np.unpackbits((a ^ b).view(np.uint8)).reshape(4096, 32).mean(0)
    assert np.all(np.abs(flipped - 0.5) < 6 * 0.5 / 64)


def test_different_uses_of_a_key_draw_different_numbers():
    key = key_of(6)
    draws = [
        bits_of(key, 64),
        bits_of(jax.random.split(key, 2)[0], 64),
        bits_of(jax.random.split(key, 2)[1], 64),
        bits_of(jax.random.fold_in(key, 0), 64),
        bits_of(jax.random.fold_in(key, 1), 64),
        np.asarray(jax.random.key_data(jax.random.split(key, 32))).ravel(),
    ]
    for a, b in itertools.combinations(draws, 2):
        assert not np.intersect1d(a, b).size


@pytest.mark.parametrize("seed", [0, 5])
def test_every_bit_of_a_seed_and_of_a_folded_number_counts(seed: int):
    others = [seed ^ np.uint32(1 << bit) for bit in range(32)]
    numbers = jnp.asarray([seed, *others], jnp.uint32).astype(jnp.int32)
    for keys in (
        jax.vmap(key_of)(numbers),
        jax.vmap(partial(jax.random.fold_in, key_of(8)))(numbers),
    ):
        assert len(np.unique(jax.random.key_data(keys), axis=0)) == 33


def test_a_lane_draws_the_same_alone_and_in_a_batch():
    keys = jax.random.split(key_of(7), 5)
    together = jax.vmap(lambda key: jax.random.normal(key, (3,)))(keys)
    alone = jnp.stack([jax.random.normal(key, (3,)) for key in keys])
    assert np.array_equal(together, alone)


def test_a_checkpoint_of_another_generator_is_refused():
    data = jax.random.key_data(key_of(0))
    with pytest.raises(UserError, match=r"checkpoint 3: begun with .* threefry2x32"):
        key_from(data, "threefry2x32", "checkpoint 3")
