"""The clock of tests marked `virtual_time`: it jumps to the next timer, but not past a job of a pool of threads."""

from __future__ import annotations

import asyncio
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

pytestmark = pytest.mark.virtual_time


async def test_an_hour_passes_at_once_for_every_clock() -> None:
    began_s, began_wall_s, began_really_s = time.monotonic(), time.time(), time.perf_counter()
    await asyncio.sleep(3600)
    assert time.monotonic() - began_s == pytest.approx(3600)
    assert time.time() - began_wall_s == pytest.approx(3600)
    assert time.perf_counter() - began_really_s < 60


async def test_time_does_not_jump_past_a_job_of_a_pool() -> None:
    """Else a disk that takes milliseconds would seem to take minutes."""
    ends = threading.Event()
    with ThreadPoolExecutor(1) as pool:
        job = asyncio.wrap_future(pool.submit(ends.wait))
        began_s, began_really_s = time.monotonic(), time.perf_counter()
        asyncio.get_running_loop().call_later(0.1, ends.set)
        await job
    assert time.perf_counter() - began_really_s > 0.05
    assert time.monotonic() - began_s == pytest.approx(0.1, abs=0.05)


async def test_a_job_that_fails_is_told_to_its_caller_alone() -> None:
    with ThreadPoolExecutor(1) as pool, pytest.raises(ZeroDivisionError):
        await asyncio.wrap_future(pool.submit(lambda: 1 / 0))
