"""Which catgraph this is."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version


def catgraph_version() -> str:
    """The installed version; "0" for a checkout that was never installed."""
    try:
        return version("catgraph")
    except PackageNotFoundError:
        return "0"
