"""Report on networks: their layers instead of thousands of weights."""

import numpy as np
from rich.console import Console
from typing_extensions import override

from mjxgait.inspect.sections import Facts, PlainView, print_pairs, title, titled_table
from mjxgait.inspect.snapshot import Snapshot


class NetworkView(PlainView):
    """Size of each array, and the root mean square of its numbers; see `GenomeView`."""

    @override
    def facts(self, snapshot: Snapshot, i: int) -> dict[str, object]:
        return {
            "layers": {
                name: {"shape": list(array.shape[1:]), "size": _size(array[i])}
                for name, array in snapshot.genomes.items()
            }
        }

    @override
    def spread(self, snapshot: Snapshot) -> dict[str, object]:
        found = {name: _size(array.std(axis=0)) for name, array in snapshot.genomes.items()}
        return {"genome_spread": found}

    @override
    def show(self, individual: Facts, spread: Facts | None, console: Console) -> None:
        table = titled_table(f"{title(individual)}: network", console)
        for name in ("", "shape", "root mean square"):
            table.add_column(name)
        for name, layer in individual["layers"].items():
            table.add_row(name, " x ".join(map(str, layer["shape"])), f"{layer['size']:.3f}")
        console.print(table)
        if spread:
            console.print("\nspread over the population", style="bold")
            rows = {name: f"{value:.3f}" for name, value in spread["genome_spread"].items()}
            print_pairs(rows, console)


def _size(array: np.ndarray) -> float:
    return float(np.sqrt(np.square(array).mean()))
