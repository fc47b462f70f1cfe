"""Makes the inputs of a reported situation by its generator, once for a run of the tests."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

import pytest

from server.analysis.rehearse import rehearse
from server.analysis.report import Report
from server.recording.read.read import open_recording
from tests.tree import RECORDINGS

GENERATORS = RECORDINGS / "reports"
MAKING_S = 120.0


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="catgraph-reports-")


@cache
def made(generator: str) -> Path:
    """The folder with what `case_….py` writes. Skips the test where there are no generators."""
    if not (GENERATORS / generator).is_file():
        pytest.skip(f"{GENERATORS / generator} is not there")
    into = Path(_folder().name) / generator.removesuffix(".py")
    into.mkdir()
    run(generator, into=into)
    return into


def run(generator: str, *arguments: str, into: Path) -> None:
    """Runs one of the generators; its output is written into a folder."""
    if not (GENERATORS / generator).is_file():
        pytest.skip(f"{GENERATORS / generator} is not there")
    environment = {**os.environ, "REPORTS_OUT": str(into), "PYTHONDONTWRITEBYTECODE": "1"}
    subprocess.run(
        [sys.executable, str(GENERATORS / generator), *arguments],
        cwd=into,
        env=environment,
        check=True,
        timeout=MAKING_S,
        stdout=subprocess.DEVNULL,
    )


def counted(*paths: Path) -> tuple[int, list[str]]:
    """Return the number of a recording's messages, all read in the order of time, and the notes on it."""
    with open_recording(list(paths)) as recording:
        times = [at_s for at_s, *_ in recording.rows()]
        assert times == sorted(times)
        assert recording.count == len(times)
        assert recording.rejected == {}
        return len(times), [*recording.notes, *recording.damage]


def judged(*files: Path) -> Report:
    """What `catgraph check` finds in a recording."""
    with open_recording(list(files)) as recording:
        run = rehearse(recording)
        return Report(files=[str(path) for path in files], recording=recording, run=run)


def raised(report: Report) -> dict[str, float]:
    """The alarms that were raised, each with its first moment [s]."""
    return {one.alarm_id: one.raised_s for one in reversed(report.run.episodes)}
