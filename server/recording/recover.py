"""Recovers recordings after a kill of the server or a full disk.

The new file begins with the bytes of the old one, up to the last record of its hash chain, and the chain continues in
it; whatever was changed before shows in the chain as it did. Where a chunk is damaged, or there is no chain, the chunks
that are whole are copied, and the new file has no chain. The new file gets its name only when the disk has it; only
then what was left is removed. Nothing that might still be of use is removed: what could not be read is kept aside under
another name, and reported.

What the last run left is recovered at the start of a server, while monitoring runs; what a full disk left, when there
is room again.
"""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import logging
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from server.recording import space
from server.recording.folder import DAMAGED, FINISHED, RECOVERING, id_of
from server.recording.mcap.chunks import MAGIC, Walk
from server.recording.mcap.recovered_file import Contents, write_recovered
from server.storage.durable_file import sync_folder

log = logging.getLogger("catgraph.recording")

_TORN = 1024 * 1024  # bytes at the end that a kill may have left half-written; more of them are kept aside

TRY_AGAIN_S = 10.0  # what could not be completed on a full disk is tried again so often


@dataclass(frozen=True, slots=True, kw_only=True)
class Recovered:
    """What became of one file that was left."""

    id: str
    sentence: str
    path: Path | None = None  # the finished recording, where there is one now
    aside: Path | None = None  # where the rest is kept
    messages: int = 0
    is_settled: bool = True  # False: it is still as it was, and may be tried again


def recover(left: Path) -> Recovered:
    """Recovers one file that is not being written any more. Raises nothing."""
    try:
        return _recover(left)
    except FileNotFoundError:
        return Recovered(id=id_of(left), sentence=f"{left.name} is gone.")
    except OSError as error:
        with contextlib.suppress(OSError):
            left.with_name(id_of(left) + RECOVERING).unlink()
        return Recovered(
            id=id_of(left),
            sentence=f"{id_of(left)} cannot be recovered now: {space.why(error)}. It is kept as it is.",
            is_settled=False,
        )


def _recover(left: Path) -> Recovered:
    id = id_of(left)
    finished = left.with_name(id + FINISHED)
    if finished.exists():  # it was recovered before, and the server was killed before the original was removed
        if _is_whole(finished):
            left.unlink()
            sync_folder(left.parent)
            return Recovered(id=id, path=finished, sentence=f"{id} had already been recovered.")
        return _aside(left, f"{id} exists beside a finished recording of the same name; both are kept")
    with left.open("rb") as file:
        try:
            fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return Recovered(id=id, sentence=f"{id} is being written by another server.", is_settled=False)
        walk, found = Walk(file, os.fstat(file.fileno()).st_size), Contents()
        for chunk in walk.chunks():
            found.take(chunk, walk.linked_to)
        unread = walk.size - walk.at
        if walk.is_whole and not found.bad:
            os.rename(left, finished)
            sync_folder(left.parent)
            return Recovered(id=id, path=finished, messages=found.messages, sentence=f"{id} was whole.")
        if not found.messages:
            if (walk.header is not None or not walk.size) and not unread and not found.bad:
                left.unlink()
                sync_folder(left.parent)
                return Recovered(id=id, sentence=f"{id} had only started and is empty.")
            return _aside(left, f"Nothing of {id} can be read")
        sentence = _words(id, found, unread)
        new = left.with_name(id + RECOVERING)
        write_recovered(new, file, walk, found, ended="recovered", why=sentence)
    os.rename(new, finished)
    sync_folder(left.parent)
    aside = None
    if found.bad or unread > _TORN:
        aside = left.with_name(id + DAMAGED)
        os.rename(left, aside)
        sentence = f"{sentence} The damaged file is kept as {aside.name}."
    else:
        left.unlink()
    sync_folder(left.parent)
    return Recovered(id=id, path=finished, aside=aside, messages=found.messages, sentence=sentence)


def _aside(left: Path, what: str) -> Recovered:
    aside = left.with_name(id_of(left) + DAMAGED)
    n = 2
    while aside.exists():
        aside = left.with_name(f"{id_of(left)}-{n}{DAMAGED}")
        n += 1
    os.rename(left, aside)
    sync_folder(left.parent)
    return Recovered(id=id_of(left), aside=aside, sentence=f"{what}; it is kept as {aside.name}.")


def _is_whole(path: Path) -> bool:
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(0, size - len(MAGIC)))
        return size > 2 * len(MAGIC) and file.read() == MAGIC


def _words(id: str, found: Contents, unread: int) -> str:
    span_s = (found.end_ns - found.start_ns) / 1e9
    bad = ""
    if found.bad:
        which = "1 part is" if found.bad == 1 else f"{found.bad} parts are"
        bad = f" {which} damaged and left out."
    return f"{id} is truncated: {span_s:.1f} s with {found.messages} messages are whole.{bad} " + (
        f"The last {space.amount(unread)} were only partly written." if unread else "Nothing was partly written."
    )


class UnfinishedParts:
    """Parts that a full disk left cut: they are made whole when there is room again.

    Those of one recorder. Times are of a monotonic clock in seconds.
    """

    def __init__(self) -> None:
        self._due_s: dict[Path, float] = {}  # when each is tried next

    @property
    def wait_s(self) -> float | None:
        """How long to wait before `complete` is called; None: there is nothing to complete."""
        return TRY_AGAIN_S if self._due_s else None

    def add(self, path: Path, now_s: float) -> None:
        self._due_s[path] = now_s + TRY_AGAIN_S

    def complete(self, now_s: float) -> list[Path]:
        """Tries those that are due; returns the parts that are finished now."""
        finished: list[Path] = []
        for path, due_s in list(self._due_s.items()):
            if now_s >= due_s:
                done = recover(path)
                if done.is_settled:
                    del self._due_s[path]
                    if done.path is not None:
                        finished.append(done.path)
                else:
                    self._due_s[path] = now_s + TRY_AGAIN_S
        return finished


async def recover_left(left: Sequence[Path], *, on_recovered: Callable[[Path, Recovered], None]) -> None:
    """Recovers each of the files, off the loop; `on_recovered(path, what became of it)` is called on the loop."""
    for path in left:
        found = await asyncio.to_thread(recover, path)
        log.warning("%s", found.sentence)
        on_recovered(path, found)
