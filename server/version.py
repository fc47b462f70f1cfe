"""Which catgraph this is."""

from __future__ import annotations

from functools import cache
from importlib.metadata import PackageNotFoundError, version


@cache  # each page and each recording needs it, and it would be read from the disk
def catgraph_version() -> str:
    """The installed version; "0" for a checkout that was never installed."""
    try:
        return version("catgraph")
    except PackageNotFoundError:
        return "0"
