"""Recovers truncated recordings of the last run at the start of a server, while monitoring runs."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Sequence
from pathlib import Path

from server.recording import recover
from server.recording.recover import Recovered

log = logging.getLogger("catgraph.recording")


async def recover_left(left: Sequence[Path], *, on_recovered: Callable[[Path, Recovered], None]) -> None:
    """Recovers each of the files, off the loop; `on_recovered(path, what became of it)` is called on the loop."""
    for path in left:
        found = await asyncio.to_thread(recover.recover, path)
        log.warning("%s", found.sentence)
        on_recovered(path, found)
