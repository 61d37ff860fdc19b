"""The browser of the pages."""

from viewing.conftest import browser

__all__ = ["browser"]
