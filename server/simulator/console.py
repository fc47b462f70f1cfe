"""Scenarios by typing: one line on the terminal starts, stops or lists them."""

from __future__ import annotations

import asyncio
import contextlib
import os
import stat
from collections.abc import Callable

from server.simulator.scenarios import UnknownScenario
from server.simulator.service import CarService

HELP = "Type a scenario's name to start it (“speeding”, or “speeding 20” for 20 s), “stop”, “stop NAME” or “list”."
LONGEST_LINE = 4096
AGAIN_S = 1.0


def run_line(service: CarService, line: str) -> str:
    """Run one typed line and return the answer as text; empty for an empty line."""
    parts = line.split()
    match [part.lower() for part in parts]:
        case []:
            return ""
        case ["list" | "help" | "?"]:
            return listing(service)
        case ["stop"]:
            service.stop_scenario()
            return "All scenarios stopped."
        case ["stop", name]:
            return _tried(lambda: service.stop_scenario(name), f"{name} stopped.")
        case [name]:
            return _tried(lambda: service.start_scenario(name), f"{name} started.")
        case [name, seconds]:
            try:
                duration_s = float(seconds)
            except ValueError:
                return f"“{parts[1][:40]}” is not a number of seconds. {HELP}"
            return _tried(lambda: service.start_scenario(name, duration_s), f"{name} started for {duration_s:g} s.")
        case _:
            return HELP


def listing(service: CarService) -> str:
    """Every scenario with its sentence, and how long those under way still last."""
    lines = []
    for row in service.state()["scenarios"]:
        match row["state"]:
            case "running":
                state = f"  [{row['left_s']:.0f} s left]"
            case "ending":
                state = "  [ending]"
            case _:
                state = ""
        lines.append(f"  {row['name']:<18} {row['sentence']}{state}")
    return "\n".join([*lines, HELP])


def _tried(act: Callable[[], None], done: str) -> str:
    try:
        act()
    except UnknownScenario as error:
        return str(error)
    return done


class Console:
    """Reads lines from a file descriptor as they come, without ever waiting for one."""

    def __init__(self, service: CarService, file: int, say: Callable[[str], None]) -> None:
        self._service, self._file, self._say = service, file, say
        self._loop = asyncio.get_running_loop()
        self._rest = b""
        self._again: asyncio.TimerHandle | None = None

    @classmethod
    def of_stdin(cls, service: CarService) -> Console:
        """On this terminal. Needs the running loop."""
        return cls(service, 0, say)

    def open(self) -> None:
        """Start to read the input; without an input, do nothing."""
        with contextlib.suppress(OSError, ValueError):  # closed, or of a kind that cannot be waited for
            if stat.S_ISREG(os.fstat(self._file).st_mode):
                self._read()
            else:
                self._loop.add_reader(self._file, self._read)

    def close(self) -> None:
        if self._again is not None:
            self._again.cancel()
        with contextlib.suppress(OSError, ValueError):
            self._loop.remove_reader(self._file)

    def _read(self) -> None:
        if self._is_in_background():  # reading would stop the whole process
            self.close()
            self._again = self._loop.call_later(AGAIN_S, self.open)
            return
        try:
            data = os.read(self._file, LONGEST_LINE)
        except OSError:
            data = b""
        if not data:
            self.close()
        *lines, self._rest = (self._rest + data).split(b"\n")
        if not data or len(self._rest) > LONGEST_LINE:
            lines, self._rest = [*lines, self._rest], b""
        for line in lines:
            answer = run_line(self._service, line.decode("utf-8", "replace")[:LONGEST_LINE])
            if answer:
                self._say(answer)

    def _is_in_background(self) -> bool:
        try:
            return os.isatty(self._file) and os.getpgrp() != os.tcgetpgrp(self._file)
        except OSError:
            return False


def say(text: str) -> None:
    """Prints at once."""
    with contextlib.suppress(BrokenPipeError):  # the reader of our output is gone; the car continues
        print(text, flush=True)


def need_stdin() -> None:
    """Gives the process an empty stdin where it was started without one: uvloop would use the number 0 and fail."""
    try:
        os.fstat(0)
    except OSError:
        os.open(os.devnull, os.O_RDONLY)
