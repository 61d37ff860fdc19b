"""What was made before and is asked for again."""

import collections
from collections.abc import Callable, Hashable
from typing import TypeVar

T = TypeVar("T")


class Latest(collections.OrderedDict[Hashable, T]):
    """Those that were used last, at most `count`."""

    def __init__(self, count: int) -> None:
        super().__init__()
        self._count = count

    def find(self, key: Hashable, make: Callable[[], T]) -> T:
        """What is known by this key, made now if it is not."""
        if key not in self:
            self[key] = make()
            while len(self) > self._count:
                self.popitem(last=False)
        self.move_to_end(key)
        return self[key]
