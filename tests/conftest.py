"""What several folders of tests need: the recordings and a browser."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from tests.chromium import find_chromium
from tests.tree import RECORDINGS

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
