"""Has files surveyed by a process of its own, one after the other; ends it when there is nothing to do."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import sys
from pathlib import Path
from typing import Any

import orjson

from server.recording.catalog.annotations import line

log = logging.getLogger("catgraph.catalog")

_ROOT = Path(__file__).resolve().parents[3]  # of the packages: the process must find the same code
_LINE = 4 << 20  # bytes of an answer at most
LONGEST_S = 1800.0  # of one file: at 300 times real time no drive takes so long


class Surveyor:
    """Ask for one file at a time. Never raises for what a file does to its reader."""

    def __init__(self) -> None:
        self._starting: asyncio.Task[asyncio.subprocess.Process] | None = None

    async def ask(self, path: Path) -> dict[str, Any]:
        """What survey.survey() finds in the file."""
        try:
            process = await self._running()
            assert process.stdin is not None
            assert process.stdout is not None
            process.stdin.write(_question(path))
            await process.stdin.drain()
            async with asyncio.timeout(LONGEST_S):
                answer = await process.stdout.readline()
            found = orjson.loads(answer)
        except TimeoutError:
            await self.rest()
            return {"problem": f"{line(path.name)} could not be read within {LONGEST_S / 60:.0f} minutes."}
        except (OSError, ValueError, orjson.JSONDecodeError) as why:  # it was killed, or ran out of memory
            log.warning("recording reader failed: recording=%s error=%r", path, why)
            await self.rest()
            return {"problem": f"{line(path.name)} could not be read: the reader failed."}
        return found if isinstance(found, dict) else {"problem": f"{line(path.name)} could not be read."}

    async def rest(self) -> None:
        """Ends the process; the next question starts another."""
        if self._starting is None:
            return
        process = await asyncio.shield(self._starting)
        if process.stdin is not None:
            process.stdin.close()
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        await process.communicate()  # to the end of its pipes: else they outlive the loop
        self._starting = None  # not before: a cancelled caller leaves it to the next call

    async def _running(self) -> asyncio.subprocess.Process:
        if self._starting is not None and (await asyncio.shield(self._starting)).returncode is not None:
            await self.rest()
        if self._starting is None:  # a task of its own: who gives up waiting leaves a process that `rest` finds
            self._starting = asyncio.create_task(
                asyncio.create_subprocess_exec(
                    *(sys.executable, "-m", "server.recording.catalog.survey"),
                    stdin=asyncio.subprocess.PIPE,
                    stdout=asyncio.subprocess.PIPE,
                    cwd=_ROOT,
                    limit=_LINE,
                )
            )
        return await asyncio.shield(self._starting)


def _question(path: Path) -> bytes:
    """In hex, as a name may hold anything; absolute, as the process has another working directory."""
    return os.fsencode(path.absolute()).hex().encode() + b"\n"
