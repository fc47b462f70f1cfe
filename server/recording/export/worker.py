"""Runs an export as a process of its own: its computing never blocks the event loop, and it can be ended at once."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import orjson

from server.recording.export.export_format import ExportRefused, NothingRecorded, Progress

log = logging.getLogger("catgraph.export")

_ROOT = Path(__file__).resolve().parents[3]  # of the packages: the process must find the same code
_LINE = 1 << 20  # bytes of an answer at most
_PATIENCE_S = 5.0  # to remove its files, before it is killed


@dataclass(frozen=True, slots=True, kw_only=True)
class Made:
    """What the process wrote."""

    path: Path
    entries: int
    notes: list[str]  # what is not in it, and why, and what else is to be known of it
    is_whole: bool = True  # False: something of the recording is not in it


async def run_worker(arguments: Sequence[str], progress: Progress) -> Made:
    """Runs `catgraph export` with these arguments. Raises ExportRefused (NothingRecorded) with its sentence, OSError;
    ends the process where this is cancelled."""
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "server", "export", "--background", *arguments),
        stdin=asyncio.subprocess.PIPE,  # never written to: its end signals the end of the server
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        cwd=_ROOT,
        limit=_LINE,
    )
    complaints = asyncio.create_task(_last_output(process))
    try:
        answer = await _listen(process, progress)
        await process.wait()
    finally:
        await asyncio.shield(_end(process))
        errors = await complaints
    if answer is None:
        log.error("export process ended: status=%s error=%s", process.returncode, errors)
        raise ExportRefused("The export failed: it ran out of memory or was killed.")
    if "refused" in answer:
        if errors:
            log.error("export failed: %s", errors)
        raise (NothingRecorded if answer.get("is_nothing") is True else ExportRefused)(str(answer["refused"]))
    return Made(
        path=Path(answer["done"]),
        entries=int(answer["entries"]),
        notes=[str(note) for note in answer["notes"]],
        is_whole=bool(answer["is_whole"]),
    )


async def _listen(process: asyncio.subprocess.Process, progress: Progress) -> dict[str, Any] | None:
    """The last message of the process; None: it ended without one."""
    assert process.stdout is not None
    last: dict[str, Any] | None = None
    async for line in process.stdout:
        with contextlib.suppress(orjson.JSONDecodeError, KeyError, TypeError):
            message = orjson.loads(line)
            if "progress" in message:
                progress(float(message["progress"]))
            elif "done" in message or "refused" in message:
                last = message
    return last


async def _last_output(process: asyncio.subprocess.Process) -> str:
    """The end of its error output."""
    assert process.stderr is not None
    last = b""
    while portion := await process.stderr.read(1 << 16):
        last = (last + portion)[-4000:]
    return last.decode("utf-8", "replace")


async def _end(process: asyncio.subprocess.Process) -> None:
    if process.stdin is not None:
        process.stdin.close()
    if process.returncode is not None:
        return
    with contextlib.suppress(ProcessLookupError):
        process.terminate()
    try:
        async with asyncio.timeout(_PATIENCE_S):
            await process.wait()
    except TimeoutError:
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        await process.wait()
