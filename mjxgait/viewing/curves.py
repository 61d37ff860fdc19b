"""Plots of a run's metrics."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np


def plot_fitness(lines: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Best, mean and quartiles over generations, spells of forced evolution shaded. lines: of `metrics.jsonl`."""
    columns = {key: np.array([np.nan if line[key] is None else line[key] for line in lines], float) for key in lines[0]}
    generation = columns["generation"]
    figure, axes = plt.subplots(figsize=(8, 4.5), layout="constrained")
    axes.fill_between(generation, columns["lower_quartile"], columns["upper_quartile"], color="0.8", label="middle half")
    axes.plot(generation, columns["best"], "k-", linewidth=2, label="best")
    axes.plot(generation, columns["mean"], "k--", linewidth=1, label="mean")
    for i, at in enumerate(generation[columns["forced"] == 1]):
        axes.axvspan(at - 0.5, at + 0.5, color="tab:orange", alpha=0.25, linewidth=0, label=None if i else "forced evolution")
    axes.set(xlabel="generation", ylabel="fitness")
    axes.legend(frameon=False)
    axes.grid(alpha=0.3)
    figure.savefig(path, dpi=120)
    plt.close(figure)
