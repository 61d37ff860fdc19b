"""Orbax checkpoints of the whole evolution state; `stored` tells which are whole and reads them.

They are written in the background, where a disk may fill. Who saves or closes is told so by the
error that Orbax hands on; what its threads would say on the screen besides is kept off it.
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax
import numpy as np
import orbax.checkpoint as ocp

from mjxgait.errors import UserError
from mjxgait.runs.disk import disk_errors
from mjxgait.runs.stored import (
    FOLDER,
    MANIFEST,
    SCHEMA,
    STATE,
    Manifest,
    array_hash,
    read_stored,
    stored_generations,
)
from mjxgait.search.evolution import EvolutionState


class Checkpoints:
    """The checkpoints of one run, written in the background, each complete or absent."""

    def __init__(self, run: Path, keep_every: int = 1) -> None:
        """Besides the latest three, each generation that is a multiple of `keep_every` stays."""
        self._run, self._folder = run, (run / FOLDER).resolve()
        options = ocp.CheckpointManagerOptions(
            max_to_keep=3, keep_period=keep_every, cleanup_tmp_directories=True
        )
        handlers = {
            STATE: ocp.StandardCheckpointHandler(),
            MANIFEST: ocp.JsonCheckpointHandler(),
        }
        with disk_errors(self._folder):
            self._manager = ocp.CheckpointManager(
                self._folder, options=options, item_handlers=handlers
            )

    def generations(self) -> list[int]:
        """The generations there are checkpoints of, oldest first."""
        return stored_generations(self._run)

    def drop_after(self, generation: int) -> list[int]:
        """Deletes the checkpoints of later generations; returns which, oldest first."""
        later = [known for known in self.generations() if known > generation]
        with disk_errors(self._folder):
            for known in reversed(later):
                self._manager.delete(known)
        return later

    def save(self, state: EvolutionState, creature: str, digest: str) -> None:
        """Starts to write the state, of one run or of several side by side.

        Raises:
          UserError: the disk is full or cannot be written, now or in an earlier write.
        """
        arrays = _by_name(state)
        manifest = Manifest(
            SCHEMA,
            creature,
            digest,
            int(np.max(state.generation)),
            array_hash(arrays),
            str(jax.random.key_impl(state.key)),
        )
        args = ocp.args.Composite(
            state=ocp.args.StandardSave(arrays),
            manifest=ocp.args.JsonSave(dataclasses.asdict(manifest)),
        )
        with disk_errors(self._folder):
            self._manager.save(manifest.generation, args=args, force=True)

    def close(self) -> None:
        """Waits until everything is on disk."""
        with disk_errors(self._folder):
            self._manager.wait_until_finished()
            self._manager.close()

    def restore(
        self, abstract: EvolutionState, digest: str, generation: int | None = None
    ) -> EvolutionState:
        """The state of a generation, the latest by default.

        Args:
          abstract: a state of the shapes that the run's settings ask for.
          digest: hash of the creature's files as they are now.

        Raises:
          UserError: no checkpoint, a damaged or foreign one, or one of other settings.
        """
        stored = read_stored(self._run, digest, generation)
        wanted = _by_name(abstract)
        _check_shapes(stored.arrays, wanted, self._folder / str(stored.manifest.generation))
        place = jax.local_devices()[0]
        arrays = [jax.device_put(stored.arrays[name], place) for name in wanted]
        state = jax.tree.unflatten(jax.tree.structure(abstract), arrays)
        return dataclasses.replace(
            state, key=jax.random.wrap_key_data(state.key, impl=stored.manifest.key_impl)
        )


def _by_name(state: EvolutionState) -> dict[str, Any]:
    """The arrays of a state by dotted name; its typed key as numbers, as files can hold them."""
    key = state.key
    plain = (
        jax.eval_shape(jax.random.key_data, key)
        if isinstance(key, jax.ShapeDtypeStruct)
        else jax.random.key_data(key)
    )
    leaves, _ = jax.tree_util.tree_flatten_with_path(dataclasses.replace(state, key=plain))
    return {jax.tree_util.keystr(path, simple=True, separator="."): leaf for path, leaf in leaves}


def _check_shapes(found: Mapping[str, Any], wanted: Mapping[str, Any], where: Path) -> None:
    """Refuses a checkpoint whose arrays are not those that the settings ask for.

    Raises:
      UserError: names the first array of another name, shape or type.
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
