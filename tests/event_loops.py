"""The event loops on which tests run, by their marks. A folder's conftest.py takes both of these in.

Not for tests that share a loop: whatever lives on it, as a browser, would be made anew for each of them.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Mapping

import pytest
import uvloop

from tests.virtual_time import VirtualClock


def pytest_asyncio_loop_factories(item: pytest.Item) -> Mapping[str, Callable[[], asyncio.AbstractEventLoop]]:
    """The event loops on which a test runs, by its marks: asyncio's own, unless they name more."""
    if item.get_closest_marker("virtual_time"):
        return {"virtual time": _virtual_loop}
    if item.get_closest_marker("both_loops"):
        return {"asyncio": asyncio.new_event_loop, "uvloop": uvloop.new_event_loop}
    return {"asyncio": asyncio.new_event_loop}


_clocks: list[VirtualClock] = []  # of the test that runs


def _virtual_loop() -> asyncio.AbstractEventLoop:
    return _clocks[-1].new_event_loop()


@pytest.fixture(autouse=True)
def virtual_clock(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """For a test marked `virtual_time`, and before its loop is made: the time of the whole process is the loop's."""
    if request.node.get_closest_marker("virtual_time") is None:
        yield
        return
    _clocks.append(VirtualClock())
    _clocks[-1].install(monkeypatch)
    yield
    _clocks.pop()
