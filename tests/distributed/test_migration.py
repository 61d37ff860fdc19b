"""Exchanges between islands and their joint result, on made-up states."""

import numpy as np
import pytest

from mjxgait.config.evolution import IslandsConfig
from mjxgait.distributed.islands import exchanged, gathered, together
from mjxgait.training.checkpoint import Packed


def island(*fitness: float) -> Packed:
    """A population with genomes that identify the individual: [fitness, fitness + 100]."""
    values = np.array(fitness, np.float32)
    return Packed(
        {
            "genomes.poses": np.stack([values, values + 100], axis=1),
            "terms": values[:, None, None],
            "outcome": values[:, None, None],
            "fitness": values,
            "born": np.arange(len(fitness), dtype=np.int32),
            "origin": np.zeros(len(fitness), np.int32),
            "key": np.array([len(fitness), 7], np.uint32),
            "generation": np.int32(5),
        },
        "fry",
    )


THREE = [island(9, 5, 1, 0), island(8, 4, 3, 2), island(7, 6, 5, 4)]


def fitness(states: list[Packed]) -> list[list[float]]:
    return [state.arrays["fitness"].tolist() for state in states]


def test_in_a_ring_the_best_replace_the_worst_of_the_next_island():
    went = exchanged(THREE, IslandsConfig(count=3, migrants=2))
    assert fitness(went) == [[9, 7, 6, 5], [9, 8, 5, 4], [8, 7, 6, 4]]


def test_migrants_bring_all_their_data_and_nothing_else_changes():
    for before, after in zip(THREE, exchanged(THREE, IslandsConfig(count=3)), strict=True):
        assert (
            after.arrays["genomes.poses"][:, 1].tolist() == (after.arrays["fitness"] + 100).tolist()
        )
        assert after.arrays["terms"][:, 0, 0].tolist() == after.arrays["fitness"].tolist()
        for name in ("key", "generation"):
            assert (after.arrays[name] == before.arrays[name]).all()


def test_topology_all_brings_the_best_of_every_island_but_half_stays():
    went = exchanged(THREE, IslandsConfig(count=3, migrants=2, topology="all"))
    assert fitness(went) == [[9, 8, 7, 5], [9, 8, 7, 4], [9, 8, 7, 6]]


def test_a_nonfinite_individual_is_the_worst():
    went = exchanged([island(1, np.nan), island(3, 2)], IslandsConfig(count=2, migrants=1))
    assert fitness(went) == [[3, 1], [3, 1]]


def at(level: int, state: Packed) -> Packed:
    return state.with_arrays({"level": np.int32(level)})


def test_no_migrants_from_islands_with_milder_trials():
    ahead, behind = at(3, island(2, 1)), at(2, island(9, 8))
    went = exchanged([ahead, behind], IslandsConfig(count=2, migrants=1))
    assert fitness(went) == [[2, 1], [9, 2]]
    same = exchanged([ahead, at(3, island(9, 8))], IslandsConfig(count=2, migrants=1))
    assert fitness(same) == [[9, 2], [9, 2]]


def test_only_islands_with_the_hardest_trials_are_gathered():
    best = gathered([at(3, island(2, 1)), at(2, island(9, 8))])
    assert best.arrays["fitness"].tolist() == [2, 1]
    assert best.arrays["level"] == 3


def test_islands_are_gathered_into_one_population_of_the_best():
    best = gathered(THREE)
    assert best.arrays["fitness"].tolist() == [9, 8, 7, 6]
    assert best.arrays["genomes.poses"][:, 0].tolist() == [9, 8, 7, 6]


def test_other_data_come_from_the_island_with_the_best():
    lowly = island(1, 0)
    assert (gathered([lowly, THREE[0]]).arrays["key"] == THREE[0].arrays["key"]).all()


LINE = dict.fromkeys(("failures", "episodes", "evaluations", "sim_steps", "computed_steps"), 10)
LINE |= dict.fromkeys(("median", "lower_quartile", "upper_quartile", "spread"), 1.0)
LINE |= {"generation": 3, "unique": 4, "forced": False, "wall_s": 2.0, "worst": -1.0}


def test_the_joint_line_counts_all_and_has_the_terms_of_the_best():
    one = LINE | {"best": 1.0, "mean": 0.0, "term_slip": 0.1}
    other = LINE | {"best": 2.0, "mean": 1.0, "term_slip": 0.2, "forced": True, "wall_s": 4.0}
    line = together([one, other | {"worst": -7.0}], 4.0)
    assert line["worst"] == -7.0
    assert (line["best"], line["term_slip"], line["island"]) == (2.0, 0.2, 1)
    assert (line["mean"], line["sim_steps"], line["forced"]) == (0.5, 20, True)
    assert (line["wall_s"], line["steps_per_second"]) == (4.0, 5)


def test_the_time_of_islands_in_turn_is_their_sum_without_compilation():
    one, other = LINE | {"best": 1.0, "mean": 0.0}, LINE | {"best": 2.0, "mean": 1.0}
    assert together([one, other], 30.0)["wall_s"] == 4.0


def test_an_island_without_finite_fitness_does_not_lead():
    nobody = LINE | {"best": None, "mean": None, "worst": None}
    line = together([nobody, LINE | {"best": -3.0, "mean": -4.0}], 4.0)
    assert (line["best"], line["mean"], line["worst"], line["island"]) == (-3.0, -4.0, -1.0, 1)


@pytest.mark.parametrize(
    ("count", "topology", "sources"),
    [(1, "ring", []), (1, "all", []), (3, "ring", [[2], [0], [1]]), (2, "all", [[1], [0]])],
)
def test_sources_of_each_topology(count: int, topology: str, sources: list):
    config = IslandsConfig(count=count, topology=topology)
    assert [config.sources(i) for i in range(count)] == (sources or [[]])
