"""What several folders of tests need: the recordings and a browser."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from tests.chromium import find_chromium
from tests.tree import RECORDINGS


def pytest_configure() -> None:
    """What is started in the background ignores Ctrl-C, and so would what a test starts and interrupts."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


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
