"""A disk that hangs does not hold the end of a server; what was not written is in its log."""

from __future__ import annotations

import asyncio
import logging
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from server.app.app import create_app
from server.app.build import build
from server.app.config import Config
from server.app.lifespan import lifespan
from tests.tree import PROJECT


@pytest.mark.field
async def test_a_disk_that_hangs_is_not_waited_for_and_the_log_tells_what_is_not_written(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    config = Config(data=tmp_path)
    running, journal, storage = build(config, now=time.monotonic, wall_ms=lambda: 0, checks=None)
    disk_answers = threading.Event()
    caplog.set_level(logging.ERROR, logger="catgraph.app")
    began_s = time.monotonic()
    async with lifespan(running, journal, storage, stops_within_s=3.0):
        storage.submit(lambda: disk_answers.wait(60) and None)
        running.bus.append("car", [{"at_ms": 0, "change": "note"}, {"at_ms": 0, "change": "note"}])
    try:
        assert time.monotonic() - began_s < 20
        assert [record.getMessage() for record in caplog.records] == [
            "shutdown_incomplete part=storage unwritten_jobs=3 unwritten_events=2"
        ]
    finally:
        disk_answers.set()
    await asyncio.get_running_loop().shutdown_default_executor()  # the disk answers after all, and nothing is lost
    again = create_app(config)
    found = await again.state.services.bus.find_events("car")
    assert [event["n"] for event in found] == [2, 1]


def test_a_thread_that_never_ends_does_not_keep_the_process() -> None:
    program = (
        "import asyncio, threading; from server.app import process; process.EXITS_WITHIN_S = 0.3\n"
        "async def work(): asyncio.get_running_loop().run_in_executor(None, threading.Event().wait); return 7\n"
        "process.run(work())"
    )
    ended = subprocess.run(
        [sys.executable, "-c", program], cwd=PROJECT, capture_output=True, text=True, timeout=60, check=False
    )
    assert ended.returncode == 7, ended.stderr
    assert "exit_forced" in ended.stderr
