"""Evolution state as named NumPy arrays, for files and for transfer to other machines."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import numpy as np

from mjxgait.errors import UserError
from mjxgait.evolution.chance import key_from
from mjxgait.evolution.state import EvolutionState


@dataclasses.dataclass(frozen=True, eq=False)
class Packed:
    """State of one run or of a batch.

    arrays: by dotted name; the typed key as numbers. key_impl: the key's random generator.
    """

    arrays: Mapping[str, np.ndarray]
    key_impl: str

    @property
    def generation(self) -> int:
        """Generation of the state."""
        return int(np.max(self.arrays["generation"]))

    @property
    def size(self) -> int:
        """Size of the arrays in bytes."""
        return sum(array.nbytes for array in self.arrays.values())

    def with_arrays(self, arrays: Mapping[str, np.ndarray]) -> "Packed":
        """Return the state with these arrays replaced."""
        return Packed({**self.arrays, **arrays}, self.key_impl)

    def row(self, number: int) -> "Packed":
        """Return the state of one run of a batch."""
        return Packed({name: array[number] for name, array in self.arrays.items()}, self.key_impl)

    def rows(self, some: slice) -> "Packed":
        """Return the states of some runs of a batch."""
        return Packed({name: array[some] for name, array in self.arrays.items()}, self.key_impl)

    @property
    def count(self) -> int:
        """Number of runs in the batch."""
        return len(self.arrays["generation"])

    def state(self, abstract: EvolutionState, where: str) -> EvolutionState:
        """Return the state on the first of this machine's devices.

        Args:
          abstract: a state with the shapes that the run's settings require.
          where: origin of the state, for the error.

        Raises:
          UserError: the state has other settings or another random generator.
        """
        wanted = _by_name(abstract)
        _check_shapes(self.arrays, wanted, where)
        place = jax.local_devices()[0]
        arrays = [jax.device_put(self.arrays[name], place) for name in wanted]
        state = jax.tree.unflatten(jax.tree.structure(abstract), arrays)
        return dataclasses.replace(state, key=key_from(state.key, self.key_impl, where))


def side_by_side(rows: Sequence[Packed]) -> Packed:
    """Stack the states of several runs into a batch, the inverse of `Packed.row`."""
    first = rows[0]
    arrays = {name: np.stack([row.arrays[name] for row in rows]) for name in first.arrays}
    return Packed(arrays, first.key_impl)


def pack(state: EvolutionState) -> Packed:
    """Return the state in NumPy, transferred from the devices at once."""
    impl = str(jax.random.key_impl(state.key))
    return Packed(jax.device_get(_by_name(state)), impl)


def _by_name(state: EvolutionState) -> dict[str, Any]:
    """Return the arrays of a state by dotted name; its typed key as numbers."""
    key = state.key
    plain = (
        jax.eval_shape(jax.random.key_data, key)
        if isinstance(key, jax.ShapeDtypeStruct)
        else jax.random.key_data(key)
    )
    leaves, _ = jax.tree_util.tree_flatten_with_path(dataclasses.replace(state, key=plain))
    return {jax.tree_util.keystr(path, simple=True, separator="."): leaf for path, leaf in leaves}


def _check_shapes(found: Mapping[str, Any], wanted: Mapping[str, Any], where: str) -> None:
    """Refuse a state with other arrays than the settings require.

    Raises:
      UserError: names the first array with another name, shape or type.
    """
    there, here = (
        {name: (tuple(leaf.shape), str(np.dtype(leaf.dtype))) for name, leaf in tree.items()}
        for tree in (found, wanted)
    )
    for name in sorted(there.keys() | here.keys()):
        if there.get(name) != here.get(name):
            raise UserError(
                f"{where}: does not fit the settings of this run: {name} is "
                f"{there.get(name, 'missing')}, the settings ask for {here.get(name, 'nothing')}; "
                "resume with the settings it was written with"
            )
