"""The inputs of reported situations, made by their generators: the folder `reports` beside the real drives."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from server.analysis.rehearse import rehearse
from server.analysis.report import Report
from server.recording.read.read import open_recording
from tests.tree import RECORDINGS

GENERATORS = RECORDINGS / "reports"


def made(case: str, folder: Path) -> Path:
    """Runs the generator `case_…py` of a case, which writes below `folder`; skips the test where there is none."""
    script = GENERATORS / f"{case}.py"
    if not script.is_file():
        pytest.skip(f"no {script.name} in {GENERATORS}: name the folder above it in CATGRAPH_DATA")
    env = {**os.environ, "REPORTS_OUT": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    subprocess.run([sys.executable, script], env=env, cwd=GENERATORS, check=True, capture_output=True, timeout=100)
    return folder


def judged(*files: Path) -> Report:
    """What `catgraph check` finds in a recording."""
    with open_recording(list(files)) as recording:
        run = rehearse(recording)
        return Report(files=[str(path) for path in files], recording=recording, run=run)


def raised(report: Report) -> dict[str, float]:
    """The alarms that were raised, each with its first moment [s]."""
    return {one.alarm_id: one.raised_s for one in reversed(report.run.episodes)}
