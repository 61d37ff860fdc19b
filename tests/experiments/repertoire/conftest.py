"""The browser of the pages."""

from web.conftest import browser

__all__ = ["browser"]
