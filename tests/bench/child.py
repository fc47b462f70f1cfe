"""The bench's side of one of its processes: start it, send it orders, measure it, end it whatever happens."""

from __future__ import annotations

import contextlib
import os
import select
import subprocess
import sys
import tempfile
import time
from collections.abc import Collection
from pathlib import Path
from typing import Any

import orjson
import psutil

PROJECT = Path(__file__).resolve().parents[2]
ANSWERS_WITHIN_S = 60.0
ENDS_WITHIN_S = 3.0


class Failed(RuntimeError):
    """A process of the bench failed or did not answer."""


class Child:
    """`python -m tests.bench.MODULE`, in a session of its own so that Ctrl-C reaches only the bench."""

    def __init__(self, module: str, **options: Any) -> None:
        self._module = module
        self._errors = tempfile.TemporaryFile()
        self._process = subprocess.Popen(
            [sys.executable, "-m", f"tests.bench.{module}", orjson.dumps(options).decode()],
            cwd=PROJECT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            start_new_session=True,
        )
        self._unread = b""
        try:
            self.hello: dict[str, Any] = self.answer()
        except BaseException:
            self.stop()
            raise

    def ask(self, do: str, **arguments: Any) -> Any:
        """Gives an order and waits for its answer. Raises Failed."""
        self.order(do, **arguments)
        return self.answer()

    def order(self, do: str, **arguments: Any) -> None:
        """Gives an order; `answer()` fetches what came of it. Raises Failed."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(orjson.dumps({"do": do} | arguments) + b"\n")
            self._process.stdin.flush()
        except OSError:
            raise Failed(f"{self._module} has ended: {self._last_output()}") from None

    def answer(self, within_s: float = ANSWERS_WITHIN_S) -> Any:
        """The next answer. Raises Failed."""
        assert self._process.stdout is not None
        ends_s = time.monotonic() + within_s
        while b"\n" not in self._unread:
            if not select.select([self._process.stdout], [], [], max(0.0, ends_s - time.monotonic()))[0]:
                raise Failed(f"{self._module} did not answer within {within_s:g} s: {self._last_output()}")
            read = os.read(self._process.stdout.fileno(), 2**20)
            if not read:
                raise Failed(f"{self._module} has ended: {self._last_output()}")
            self._unread += read
        line, _, self._unread = self._unread.partition(b"\n")
        reply = orjson.loads(line)
        if "error" in reply:
            raise Failed(f"{self._module}: {reply['error']}")
        return reply["answer"]

    def share_of_core(self, for_s: float) -> float:
        """Watches for so long how much processor time it uses; in per cent of one core."""
        cpu_ns, began_ns = self.ask("cpu"), time.monotonic_ns()
        time.sleep(for_s)
        return 100.0 * (self.ask("cpu") - cpu_ns) / (time.monotonic_ns() - began_ns)

    def memory_mb(self) -> float:
        """The memory that only it uses (USS)."""
        return float(psutil.Process(self._process.pid).memory_full_info().uss) / 1e6

    def keep_to(self, cores: Collection[int]) -> None:
        """All of its threads on these processors from now on."""
        for thread in os.listdir(f"/proc/{self._process.pid}/task"):
            os.sched_setaffinity(int(thread), cores)

    def stop(self) -> None:
        """Ends it, by force where it does not end by itself."""
        process = self._process
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()
        try:
            process.wait(ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        self._errors.close()

    def _last_output(self) -> str:
        self._errors.seek(0)
        return self._errors.read().decode(errors="replace")[-2000:].strip() or "without output"
