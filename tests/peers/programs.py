"""Runs a program of others and takes what it printed."""

from __future__ import annotations

import asyncio
from pathlib import Path

from tests.tree import PROJECT


async def output_of(*command: str | Path, within_s: float, given: bytes = b"", cwd: Path = PROJECT) -> tuple[int, str]:
    """The exit code and all that it printed. Raises TimeoutError; the program is then ended."""
    process = await asyncio.create_subprocess_exec(
        *map(str, command),
        cwd=cwd,
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
    )
    try:
        printed, _ = await asyncio.wait_for(process.communicate(given), within_s)
    except TimeoutError:
        process.kill()
        await process.wait()
        raise
    return process.returncode or 0, printed.decode(errors="replace")
