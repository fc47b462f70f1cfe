"""What several folders of tests need: the recordings and a browser."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import pytest
import uvloop

from tests.chromium import find_chromium
from tests.tree import RECORDINGS
from tests.virtual_time import VirtualClock

# What takes about 0.3 s or more: `python -m tests.summary --slow` prints it from the logs of a run.
SLOW_TESTS = frozenset(Path(__file__).with_name("slow_tests.txt").read_text(encoding="utf-8").split())


def pytest_configure() -> None:
    """What is started in the background ignores Ctrl-C, and so would what a test starts and interrupts."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.nodeid.partition("[")[0] in SLOW_TESTS:
            item.add_marker(pytest.mark.slow)


def pytest_asyncio_loop_factories(item: pytest.Item) -> Mapping[str, Callable[[], asyncio.AbstractEventLoop]]:
    """The event loops on which a test runs, by its marks: asyncio's own, unless it says more."""
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


@pytest.fixture(scope="session")
def recordings() -> Path:
    """The folder of real drives: $CATGRAPH_DATA, else ../shared/data. Tests that need it are skipped without it."""
    if not RECORDINGS.is_dir():
        pytest.skip(f"no recordings in {RECORDINGS}: name their folder in CATGRAPH_DATA")
    return RECORDINGS


@pytest.fixture(scope="session")
def chromium() -> str:
    """The path of a Chromium that starts."""
    return find_chromium()
