"""At the start of a server: what its last run left cut off becomes whole recordings, while monitoring goes on."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Sequence
from pathlib import Path

from server.recording import recover
from server.recording.recover import Recovered

log = logging.getLogger("catgraph.recording")


async def recover_left(left: Sequence[Path], *, told: Callable[[Path, Recovered], None]) -> None:
    """Recovers each of the files, off the loop; `told(path, what became of it)` is called on the loop."""
    for path in left:
        found = await asyncio.to_thread(recover.recover, path)
        log.warning("%s", found.sentence)
        told(path, found)
