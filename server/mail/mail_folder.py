"""The folder of a server's mail: its lock, its settings and its outbox, each used in a thread of their own."""

from __future__ import annotations

import asyncio
import fcntl
import logging
import os
import shutil
import sqlite3
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeVar

from server.mail.outbox import Outbox
from server.mail.settings import MailSettings, MailSettingsFile

log = logging.getLogger("catgraph.mail")
T = TypeVar("T")


class MailRefused(Exception):
    """An order that is not taken; `str()` is one sentence, `field` what is at fault, `status` as HTTP has it."""

    def __init__(self, sentence: str, *, field: str = "", status: int = 422) -> None:
        super().__init__(sentence)
        self.field = field
        self.status = status


class MailFolder:
    """One server's mail on the disk; one server at a time has it."""

    def __init__(self, folder: Path) -> None:
        self.work = folder / "work"  # working files while mails are prepared
        self.complaints: list[str] = []  # what was found wrong at the start
        self.trouble: str | None = None  # why nothing can be kept or sent now
        self._folder = folder
        self._thread = ThreadPoolExecutor(1, "catgraph-outbox")
        self._lock: int | None = None
        self._outbox: Outbox | None = None

    @property
    def files(self) -> Path:
        """The folder of the composed mails."""
        assert self._outbox is not None
        return self._outbox.files

    async def open(self) -> MailSettings | None:
        """The stored settings; None: the folder cannot be opened, and `trouble` has the reason."""
        try:
            return await self._in_thread(self._open)
        except (OSError, sqlite3.Error) as why:
            self.trouble = f"Mail is off: {reason(why)}."
            log.error("%s", self.trouble)
            return None

    async def close(self) -> None:
        await self._in_thread(self._close)
        self._thread.shutdown(wait=True)

    async def ask(self, work: Callable[[Outbox], T]) -> T:
        """Does `work` with the outbox in its thread. Raises MailRefused where the disk does not do it."""
        outbox = self._opened()
        try:
            found = await self._in_thread(lambda: work(outbox))
        except (OSError, sqlite3.Error) as why:
            self.trouble = f"The outbox is not kept: {reason(why)}."
            raise MailRefused(self.trouble, status=507) from None
        self.trouble = None
        return found

    async def keep(self, settings: MailSettings) -> None:
        """Writes the settings. Raises MailRefused."""
        self._opened()
        try:
            await self._in_thread(lambda: MailSettingsFile(self._folder / "settings.toml").write(settings))
        except OSError as why:
            raise MailRefused(f"The mail settings are not kept: {reason(why)}.", status=507) from None

    def _opened(self) -> Outbox:
        if self._outbox is None:
            raise MailRefused(self.trouble or "Mail is not ready yet.", status=503)
        return self._outbox

    async def _in_thread(self, work: Callable[[], T]) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._thread, work)

    def _open(self) -> MailSettings:
        folder = self._folder
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        self._lock = _locked(folder / "lock")
        file = MailSettingsFile(folder / "settings.toml")
        settings = file.read()
        shutil.rmtree(self.work, ignore_errors=True)
        outbox = Outbox(folder)
        outbox.recover()
        self.complaints = [one for one in (file.complaint, outbox.complaint) if one]
        for one in self.complaints:
            log.error("%s", one)
        self._outbox = outbox
        return settings

    def _close(self) -> None:
        if self._outbox is not None:
            self._outbox.close()
        if self._lock is not None:
            os.close(self._lock)


def _locked(path: Path) -> int:
    """One server sends from a folder, or each mail would go out twice. Raises OSError."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        raise OSError(0, "another catgraph sends from the same folder") from None
    return descriptor


def reason(why: BaseException) -> str:
    """A short reason of a failure."""
    if isinstance(why, OSError) and why.strerror:
        return why.strerror[:1].lower() + why.strerror[1:]
    return str(why)[:120] or type(why).__name__
