"""A skeleton at rest, whatever its format. Letters: `B` bones, `V` vertices, `n` ends."""

import dataclasses

import numpy as np


@dataclasses.dataclass(frozen=True, eq=False)
class Rig:
    """Bones, parents first, in the file's axes.

    names: [B]. parents: [B] place of the parent, -1 for none. places: [B, 3] where each begins.
    ends: of each [n, 3] where it ends without a bone that goes on. skins: of each [V, 3] the
    vertices that follow it more than any other. metres: per unit of length, None where the format
    does not say.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    places: np.ndarray
    ends: tuple[np.ndarray, ...]
    skins: tuple[np.ndarray, ...]
    metres: float | None = None

    def children(self, bone: int) -> list[int]:
        """The bones that hang on one."""
        return [i for i, parent in enumerate(self.parents) if parent == bone]

    def taken(self, bones: list[int]) -> "Rig":
        """Some of the bones, in their order; each hangs on the next that was taken above it."""

        def above(bone: int) -> int:
            parent = self.parents[bone]
            while parent >= 0 and parent not in bones:
                parent = self.parents[parent]
            return bones.index(parent) if parent >= 0 else -1

        return dataclasses.replace(
            self,
            names=tuple(self.names[b] for b in bones),
            parents=tuple(above(b) for b in bones),
            places=self.places[bones],
            ends=tuple(self.ends[b] for b in bones),
            skins=tuple(self.skins[b] for b in bones),
        )

    def scaled(self, factor: float) -> "Rig":
        """The same in other units."""
        return dataclasses.replace(
            self,
            places=factor * self.places,
            ends=tuple(factor * ends for ends in self.ends),
            skins=tuple(factor * skin for skin in self.skins),
        )
