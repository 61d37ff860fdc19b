"""A cache of the values used last."""

import collections
from collections.abc import Callable, Hashable
from typing import TypeVar

T = TypeVar("T")


class LruCache(collections.OrderedDict[Hashable, T]):
    """Cache of the `count` values used last."""

    def __init__(self, count: int) -> None:
        super().__init__()
        self._count = count

    def find(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return the value of a key; make it if it is missing."""
        if key not in self:
            self[key] = make()
            while len(self) > self._count:
                self.popitem(last=False)
        self.move_to_end(key)
        return self[key]
