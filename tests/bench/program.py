"""A program of the product as it runs in the field, and what processes use of the machine."""

from __future__ import annotations

import contextlib
import re
import select
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import psutil

from tests.bench.child import ENDS_WITHIN_S, PROJECT, Failed

LISTENS_WITHIN_S = 30.0


class Program:
    """`python -m server ARGUMENTS` on a data folder of its own; `url` is where it listens, `ws://…`."""

    def __init__(self, *arguments: str) -> None:
        self._arguments = arguments
        self._data = tempfile.TemporaryDirectory(prefix="catgraph-bench-")
        self._errors = tempfile.TemporaryFile()
        self._process = subprocess.Popen(
            [sys.executable, "-m", "server", *arguments, "--port", "0", "--data", self._data.name],
            cwd=PROJECT,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            start_new_session=True,
        )
        self.pid = self._process.pid
        try:
            self.url = self._address()
        except BaseException:
            self.stop()
            raise

    def stop(self) -> None:
        """Ends it, by force where it does not end by itself."""
        self._process.terminate()
        try:
            self._process.wait(2 * ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        assert self._process.stdout is not None
        self._process.stdout.close()
        self._errors.close()
        with contextlib.suppress(OSError):
            self._data.cleanup()

    def _address(self) -> str:
        """Raises Failed."""
        assert self._process.stdout is not None
        ends_s = time.monotonic() + LISTENS_WITHIN_S
        while select.select([self._process.stdout], [], [], max(0.0, ends_s - time.monotonic()))[0]:
            line = self._process.stdout.readline().decode()
            if found := re.search(r"http(://[^\s/]+:\d+)", line):
                return f"ws{found[1]}"
            if not line:
                break
        self._errors.seek(0)
        output = self._errors.read().decode(errors="replace")[-2000:].strip() or "without output"
        raise Failed(f"{' '.join(self._arguments)} does not listen: {output}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Use:
    """What one process used: processor in per cent of a core, memory as its share of what is in use (PSS) in MB."""

    share: float
    memory_mb: float


def used(pids: Mapping[str, int], for_s: float) -> dict[str, Use]:
    """Watches processes for so long, all at the same time. Raises Failed where one ended."""
    try:
        watched = {name: psutil.Process(pid) for name, pid in pids.items()}
        before, began_s = {name: _cpu_s(one) for name, one in watched.items()}, time.monotonic()
        time.sleep(for_s)
        after, took_s = {name: _cpu_s(one) for name, one in watched.items()}, time.monotonic() - began_s
        return {
            name: Use(
                share=100.0 * (after[name] - before[name]) / took_s,
                memory_mb=float(one.memory_full_info().pss) / 1e6,
            )
            for name, one in watched.items()
        }
    except psutil.Error as why:
        raise Failed(f"a process cannot be measured: {why}") from None


def _cpu_s(process: psutil.Process) -> float:
    """By the kernel's scheduler: psutil's times have steps of 10 ms. Threads that have ended do not count."""
    spent_ns = 0
    for thread in process.threads():
        with contextlib.suppress(FileNotFoundError):  # it has just ended
            spent_ns += int(Path(f"/proc/{process.pid}/task/{thread.id}/schedstat").read_text().split()[0])
    return spent_ns / 1e9
