"""A skeleton at rest, from any format. Letters: `B` bones, `V` vertices, `n` ends."""

import dataclasses

import numpy as np


@dataclasses.dataclass(frozen=True, eq=False)
class Rig:
    """Bones, parents first, in the file's axes.

    names: [B]. parents: [B] place of the parent, -1 for none. places: [B, 3] start of each bone.
    ends: per bone [n, 3] its ends without a further bone. skins: per bone [V, 3] the vertices that
    follow it most. metres: per unit of length, None where the format does not say.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    places: np.ndarray
    ends: tuple[np.ndarray, ...]
    skins: tuple[np.ndarray, ...]
    metres: float | None = None

    def children(self, bone: int) -> list[int]:
        """Children of a bone."""
        return [i for i, parent in enumerate(self.parents) if parent == bone]

    def taken(self, bones: list[int]) -> "Rig":
        """Return some of the bones, in this order; the nearest ancestor taken becomes parent."""

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
        """Return the skeleton in other units."""
        return dataclasses.replace(
            self,
            places=factor * self.places,
            ends=tuple(factor * ends for ends in self.ends),
            skins=tuple(factor * skin for skin in self.skins),
        )
