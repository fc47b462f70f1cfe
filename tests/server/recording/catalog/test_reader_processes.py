"""The processes that read recordings for the list find the file, wherever this server was started."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from server.recording.catalog.catalog_db import Entry
from server.recording.catalog.survey_task import Surveyor
from server.recording.catalog.verifications import Verifications
from tests.server.recording.chained import closed


async def test_a_folder_that_is_given_relative_to_the_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    closed(tmp_path / "data" / "car_1.mcap", [[30], [31]])
    monkeypatch.chdir(tmp_path)
    entry = Entry(path="car_1.mcap", id="car_1", trashed_ms=None, vehicle="car", started_ms=0, size=1, changed_ns=0)
    assert Verifications(Path("data")).verify(entry, 0)["state"] == "intact"
    surveyor = Surveyor()
    try:
        found = await surveyor.ask(Path("data") / entry.path)
    finally:
        await surveyor.rest()
    assert "problem" not in found, found["problem"]


def test_a_reader_whose_server_was_killed_ends_without_output(tmp_path: Path) -> None:
    """Nobody reads its answer: the pipe is broken before it is written."""
    path = tmp_path / "car_1.mcap"
    closed(path, [[30], [31]])
    reading, writing = os.pipe()
    os.close(reading)
    try:
        ended = subprocess.run(
            [sys.executable, "-m", "server.recording.catalog.survey"],
            input=os.fsencode(path).hex().encode() + b"\n",
            stdout=writing, stderr=subprocess.PIPE, timeout=60, check=False,
        )  # fmt: skip
    finally:
        os.close(writing)
    assert (ended.returncode, ended.stderr) == (1, b"")
