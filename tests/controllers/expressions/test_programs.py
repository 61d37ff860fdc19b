"""Programs as arrays: text, initial programs, crossover, mutation and values, against a plain
parser and against DEAP.
"""

import operator
import random
from functools import partial
from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from deap import gp

from mjxgait.controllers.expressions.config import FUNCTIONS, ProgramConfig
from mjxgait.controllers.expressions.controller import evaluator, listed
from mjxgait.controllers.expressions.operators import (
    PrimitiveSet,
    Trees,
    crossed,
    depths,
    half_and_half,
    mutated,
    program_variation,
    spliced,
    subtree_sizes,
)
from mjxgait.controllers.expressions.parse import to_arrays
from mjxgait.controllers.expressions.reference import read, value_of
from mjxgait.controllers.expressions.text import (
    ARITY,
    CONSTANT,
    EMPTY,
    FIRST_ADDED,
    FUNCTION_CODES,
    Terminal,
    in_text,
    nested,
    simplified,
    to_text,
)
from mjxgait.errors import UserError
from mjxgait.evolution.chance import key_of

MANY = 10_000
NODES = 64
KNOWN = tuple(Terminal(f"a{i}", 64 + i, "joint_pos", i) for i in range(5))
SETTINGS = ProgramConfig(functions=tuple(FUNCTIONS), nodes=NODES, depth=12)
PRIMITIVES = PrimitiveSet(
    tuple(FUNCTION_CODES[name] for name in SETTINGS.functions),
    tuple(terminal.code for terminal in KNOWN),
    NODES,
)
evaluate = evaluator(PRIMITIVES.functions)


def first_programs(
    count: int, primitives: PrimitiveSet = PRIMITIVES, seed: int = 0
) -> tuple[jax.Array, jax.Array]:
    make = partial(half_and_half, primitives=primitives, depth=(2, 5), constants=(-1.0, 1.0))
    return jax.jit(jax.vmap(lambda key: make(key)))(jax.random.split(key_of(seed), count))


@pytest.fixture(scope="module")
def programs(as_shipped: None) -> tuple[np.ndarray, np.ndarray]:
    """Random programs [MANY, NODES] after crossover and mutation."""
    tree = first_programs(MANY)
    keys = jax.random.split(key_of(1), (2, MANY))
    other = jax.tree.map(lambda leaf: leaf[::-1], tree)
    cross = jax.jit(jax.vmap(lambda k, a, b: crossed(k, a, b, SETTINGS)))
    mutate = jax.jit(jax.vmap(lambda k, a: mutated(k, a, PRIMITIVES, SETTINGS)))
    code, value = mutate(keys[1], cross(keys[0], tree, other))
    return np.asarray(code), np.asarray(value)


KINDS = ("subtree", "point", "hoist", "constant", "nudge")


@jax.jit
def _mutants(keys: jax.Array, code: jax.Array, value: jax.Array, shares: jax.Array) -> Any:
    settings = SimpleNamespace(**vars(SETTINGS) | dict(zip(KINDS, shares, strict=True)))
    return jax.vmap(lambda key: mutated(key, (code, value), PRIMITIVES, settings))(keys)


def mutants(tree: Any, shares: jax.Array, count: int = 1000) -> tuple[np.ndarray, np.ndarray]:
    """Mutants [N, C] of one tree [C]; `shares`: the share of each kind of mutation."""
    code, value = _mutants(jax.random.split(key_of(0), 1000), *map(jnp.asarray, tree), shares)
    return np.asarray(code)[:count], np.asarray(value)[:count]


TAKEN = np.asarray(ARITY).tolist()


def taken(code: int) -> int:
    return TAKEN[code] if code < FIRST_ADDED else 0


def plain_end(code: np.ndarray, start: int) -> int:
    """End of the subtree that begins at `start`, read node by node."""
    wanted, i, code = 1, start, code.tolist()
    while wanted:
        wanted += taken(code[i]) - 1
        i += 1
    return i


def plain_depth(code: np.ndarray) -> int:
    """Depth of a whole tree, by recursion."""
    nodes = iter(code.tolist())

    def below() -> int:
        node = next(nodes)
        return 1 + max((below() for _ in range(taken(node))), default=-1)

    return below()


def test_every_program_is_one_tree_within_its_limits(programs: Any):
    code, value = programs
    for row, constants in zip(code, value, strict=True):
        used = int((row != EMPTY).sum())
        assert plain_end(row, 0) == used > 0
        assert not row[used:].any()
        assert not constants[row != CONSTANT].any()
    assert max(map(plain_depth, code[::10])) <= SETTINGS.depth


def test_subtree_sizes_and_depths_match_a_plain_parser(programs: Any):
    code = programs[0][:500]
    sizes = np.asarray(jax.jit(jax.vmap(subtree_sizes))(code))
    deepest = np.asarray(jax.jit(jax.vmap(depths))(code)).max(1)
    for row, size, deep in zip(code, sizes, deepest, strict=True):
        assert deep == plain_depth(row)
        for i in range(int((row != EMPTY).sum())):
            assert size[i] == plain_end(row, i) - i


def test_splicing_matches_cutting_and_pasting(programs: Any):
    largest = np.argsort((programs[0] != EMPTY).sum(1))[-500:]
    code, rng = programs[0][largest], np.random.default_rng(0)
    splice = jax.jit(lambda *a: spliced((a[0], a[1]), a[2], (a[3], a[4]), a[5], 99))
    kept = 0
    for _ in range(200):
        host, donor = code[rng.integers(len(code), size=2)]
        here, there = (rng.integers((row != EMPTY).sum()) for row in (host, donor))
        graft = donor[there : plain_end(donor, there)]
        wanted = np.concatenate([host[:here], graft, host[plain_end(host, here) :]])
        none = np.zeros(NODES, np.float32)
        found = np.asarray(splice(host, none, here, donor, none, there)[0])
        if (wanted != EMPTY).sum() > NODES:
            assert np.array_equal(found, host)
            kept += 1
        else:
            assert np.array_equal(found, np.pad(wanted, (0, NODES))[:NODES])
    assert 0 < kept < 200


def test_programs_survive_a_round_trip_through_text(programs: Any):
    for code, value in zip(*(rows[:1000] for rows in programs), strict=True):
        again = to_arrays(to_text(code, value, KNOWN), KNOWN, NODES, "x")
        assert np.array_equal(again[0], code)
        assert np.array_equal(again[1], value)


def test_a_simplified_program_is_shorter_with_the_same_value(programs: Any):
    """Within 1e-4 of the larger of 1 and the value, for all but 1 in 500."""
    seen, apart, before, after = np.random.default_rng(3).normal(size=(3, len(KNOWN))), [], 0, 0
    for code, value in zip(*(rows[:2000] for rows in programs), strict=True):
        long = nested(code, value, KNOWN)
        short = simplified(long)
        texts = (to_text(code, value, KNOWN), in_text(short))
        was, now = (value_of(read(text), {"joint_pos": seen}) for text in texts)
        apart.append((abs(was - now) > 1e-4 * np.maximum(1.0, abs(was))).any())
        before, after = before + len(texts[0].split()), after + len(texts[1].split())
        assert len(texts[1].split()) <= len(texts[0].split())
    assert np.mean(apart) < 2e-3
    assert after < 0.95 * before


@pytest.mark.parametrize(
    ("long", "short"),
    [
        (("+", "a0", ("*", 0.0, "a1")), "a0"),
        (("-", "a0", "a0"), 0.0),
        (("/", "a0", 0.0), 1.0),
        (("/", 0.0, "a0"), ("/", 0.0, "a0")),
        (("ifltz", ("*", "a0", "a0"), "a1", "a2"), "a2"),
        (("ifltz", ("-", 1.0, 3.0), "a1", "a2"), "a1"),
        (("*", ("+", 1.0, 1.0), "a0"), ("*", 2.0, "a0")),
        (("min", "a1", "a1"), "a1"),
    ],
)
def test_simplification_removes_neutral_terms(long: Any, short: Any):
    assert simplified(long) == short


def deaps() -> gp.PrimitiveSet:
    """The same functions in DEAP, independent of the package."""
    known = gp.PrimitiveSet("MAIN", len(KNOWN), prefix="a")

    def over(a: float, b: float) -> float:
        return a / b if abs(b) >= 1e-6 else 1.0

    plain = {
        "+": operator.add,
        "-": operator.sub,
        "*": operator.mul,
        "/": over,
        "ifltz": lambda a, b, c: b if a < 0 else c,
        "min": min,
        "max": max,
        "abs": abs,
        "sin": np.sin,
        "cos": np.cos,
    }
    for name, function in plain.items():

        def within(*values: float, function: Any = function) -> float:
            return min(max(function(*values), -1e9), 1e9)

        known.addPrimitive(within, FUNCTIONS[name], f"f{FUNCTION_CODES[name]}")
    return known


def in_deap(code: np.ndarray, value: np.ndarray, known: gp.PrimitiveSet) -> gp.PrimitiveTree:
    names = {f"f{number}": number for number in FUNCTION_CODES.values()}
    functions = {names[p.name]: p for p in known.primitives[object]}
    arguments = [t for t in known.terminals[object] if t.name.startswith("a")]
    nodes: list[Any] = []
    for number, constant in zip(code, value, strict=True):
        if number == EMPTY:
            break
        if number == CONSTANT:
            # As in the text: the shortest number with this value in single precision.
            nodes.append(gp.Terminal(float(str(np.float32(constant))), False, object))
        else:
            nodes.append(functions[number] if number < FIRST_ADDED else arguments[number - 64])
    return gp.PrimitiveTree(nodes)


def test_ten_thousand_programs_match_a_plain_parser_and_deap(programs: Any):
    """Within 1e-4 of the larger of 1 and the value, for all but 1 in 1,000: there single precision
    ends on the other side of a zero.
    """
    code, value = programs
    seen = np.random.default_rng(0).normal(size=(MANY, len(KNOWN))).astype(np.float32)
    trees = Trees(jnp.asarray(code)[:, None], jnp.asarray(value)[:, None])
    listing = jax.jit(jax.vmap(lambda one: listed(one, PRIMITIVES)))(trees)
    ours = np.asarray(jax.jit(jax.vmap(evaluate))(listing, seen))[:, 0]
    known, plain, theirs = deaps(), np.empty(MANY), np.empty(MANY)
    for i in range(MANY):
        senses = {"joint_pos": seen[i : i + 1].astype(float)}
        plain[i] = np.ravel(value_of(read(to_text(code[i], value[i], KNOWN)), senses))[0]
        theirs[i] = gp.compile(in_deap(code[i], value[i], known), known)(*map(float, seen[i]))
    assert np.isfinite(ours).all()
    np.testing.assert_allclose(plain, theirs, rtol=1e-12, atol=1e-12)
    assert len(np.unique(plain)) > MANY / 4
    apart = abs(ours - plain) > 1e-4 * np.maximum(1.0, abs(plain))
    assert apart.mean() < 1e-3


def test_a_programs_value_does_not_depend_on_its_batch(programs: Any):
    """One program alone, as in the reference simulator, and in a batch with other lengths."""
    code, value = (jnp.asarray(rows[:16]) for rows in programs)
    seen = jnp.asarray(np.random.default_rng(1).normal(size=(16, len(KNOWN))), jnp.float32)
    plan = jax.jit(lambda *rows: listed(Trees(*rows), PRIMITIVES))
    plans = [plan(code[i : i + 1], value[i : i + 1]) for i in range(16)]
    together = jax.vmap(evaluate)(jax.tree.map(lambda *x: jnp.stack(x), *plans), seen)
    alone = list(map(jax.jit(evaluate), plans, seen))
    np.testing.assert_allclose(np.stack(alone), together, rtol=1e-6, atol=1e-6)


def test_initial_programs_have_the_shape_of_deaps(as_shipped: None):
    """Ramped half-and-half with depths 2 to 5: mean size and depth within 3 %, their spread
    within 5 %.
    """
    random.seed(0)  # DEAP draws from Python's global generator
    known = deaps()
    known.addEphemeralConstant("ball", partial(np.random.default_rng(0).uniform, -1, 1))
    theirs = [gp.PrimitiveTree(gp.genHalfAndHalf(known, 2, 5)) for _ in range(MANY)]
    primitives = PrimitiveSet(PRIMITIVES.functions, PRIMITIVES.senses, 512)
    code = np.asarray(first_programs(MANY, primitives)[0])
    ours = {"size": (code != EMPTY).sum(1), "depth": np.array([plain_depth(row) for row in code])}
    expected = {
        "size": np.array([len(tree) for tree in theirs]),
        "depth": np.array([tree.height for tree in theirs]),
    }
    for what, values in ours.items():
        assert values.mean() == pytest.approx(expected[what].mean(), rel=0.03), what
        assert values.std() == pytest.approx(expected[what].std(), rel=0.05), what
    ends = code[(code == CONSTANT) | (code >= FIRST_ADDED)]
    assert (ends == CONSTANT).mean() == pytest.approx(1 / (len(KNOWN) + 1), abs=0.01)


def test_crossover_prefers_functions():
    """Nine of ten crossover points are functions where there are any, as in DEAP and Koza."""
    from mjxgait.controllers.expressions.operators import chosen_node

    code = to_arrays("(+ (* a0 a1) a2)", KNOWN, NODES, "x")[0]
    keys = jax.random.split(key_of(0), 4000)
    chosen = np.asarray(jax.vmap(lambda key: chosen_node(key, jnp.asarray(code), 0.9))(keys))
    shares = np.bincount(chosen, minlength=5) / len(chosen)
    assert shares[[0, 1]].sum() == pytest.approx(0.9, abs=0.02)
    assert shares[0] == pytest.approx(shares[1], abs=0.03)
    assert shares[[2, 3, 4]] == pytest.approx([0.1 / 3] * 3, abs=0.015)


def test_each_mutation_changes_what_its_name_says():
    tree = to_arrays("(+ (* a0 0.5) (ifltz a1 a2 a3))", KNOWN, NODES, "x")

    def all_of(kind: str) -> set[str]:
        shares = jnp.array([one == kind for one in KINDS], jnp.float32)
        return {to_text(*row, KNOWN) for row in zip(*mutants(tree, shares, 256), strict=True)}

    assert all(text.startswith("(+ (* a0 ") for text in all_of("constant"))
    assert len(all_of("constant")) > 30
    assert {"a0", "(* a0 0.5)", "(ifltz a1 a2 a3)"} <= all_of("hoist")
    point = all_of("point")
    assert "(- (* a0 0.5) (ifltz a1 a2 a3))" in point
    assert all(text.count("(") == 3 for text in point)
    assert max(text.count("(") for text in all_of("subtree")) > 3
    assert all(text.count("(") == 4 for text in all_of("nudge"))


def test_a_nudge_changes_a_program_little():
    """Nudges of one observation: `a0` plus a small number, or times a number near 1."""
    tree = to_arrays("a0", KNOWN, NODES, "x")

    code, value = mutants(tree, jnp.array([0.0, 0.0, 0.0, 0.0, 1.0]))
    sums, products = (code[:, 0] == FUNCTION_CODES[name] for name in "+*")
    assert sums.sum() + products.sum() == len(code) == 1000
    assert 0.4 < sums.mean() < 0.6
    by = abs(np.where(sums, value[:, 2], value[:, 2] - 1.0))
    assert by.max() < 5 * 0.2
    # Half of all changes are below a tenth of the largest standard deviation.
    assert 0.005 < np.median(by) < 0.02


def test_each_node_costs_the_parsimony_setting():
    texts = [["a0", "(+ a0 0.5)"], ["(+ a0 (* a1 a2))", "0.5"]]
    arrays = [[to_arrays(text, KNOWN, NODES, "x") for text in joints] for joints in texts]
    code, value = (jnp.array([[pair[i] for pair in joints] for joints in arrays]) for i in (0, 1))
    dear = program_variation(PRIMITIVES, 2, ProgramConfig(nodes=NODES, parsimony=0.25))
    assert dear.price is not None
    assert np.asarray(dear.price(Trees(code, value))).tolist() == [1.0, 1.5]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("(+ a0 b7)", '"b7" is neither a sense nor a number'),
        ("(+ a0)", '"+" takes 2 arguments, not 1'),
        ("(ifltz a0 a1)", '"ifltz" takes 3 arguments, not 2'),
        ("(plus a0 a1)", 'there is no function "plus"'),
        ("(+ a0 a1", "ends too early"),
        ("", "ends too early"),
        ("a0 a1", "more after its end"),
        (")", "a closing parenthesis too many"),
        ("(+ a0 nan)", "a constant must be within"),
        ("(+ a0 1e300)", "a constant must be within"),
        ("((+ a0 a1))", 'there is no function "("'),
        ("(+ a0 " * 5000 + "a1" + ")" * 5000, "10,001 nodes; an expression may have 64"),
    ],
)
def test_a_mistake_in_an_expression_is_reported_in_one_sentence(text: str, words: str):
    with pytest.raises(UserError, match="expression of joint") as told:
        to_arrays(text, KNOWN, NODES, 'expression of joint "knee"')
    assert words in str(told.value)
