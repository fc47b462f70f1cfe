"""Makes the mails of the letters that were ordered, one letter at a time."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable

from server.mail.mail_folder import MailFolder, MailRefused, reason
from server.mail.order import Letter
from server.mail.outbox import Outbox
from server.mail.prepare import CannotPrepare, prepare
from server.mail.settings import MailSettings
from server.mail.source import Source
from server.mail.under_way import Underway, joined

log = logging.getLogger("catgraph.mail")


class Preparer:
    """Takes letters from the outbox and puts their mails into it."""

    def __init__(
        self, folder: MailFolder, source: Source, settings: Callable[[], MailSettings], is_made: Callable[[], None]
    ) -> None:
        self.under_way: Underway | None = None
        self._folder = folder
        self._source = source
        self._settings = settings
        self._is_made = is_made  # called when mails are ready to be sent
        self._due = asyncio.Event()

    def look(self) -> None:
        """A letter may have been ordered."""
        self._due.set()

    async def run(self) -> None:
        """Makes one letter after the other, until it is cancelled. Raises MailRefused for what the disk does."""
        while True:
            self._due.clear()
            letter = await self._folder.ask(Outbox.to_prepare)
            if letter is None:
                await self._due.wait()
                continue
            await self._make(letter)

    async def _make(self, letter: Letter) -> None:
        folder = self._folder
        under_way = Underway(
            letter=letter.n,
            task=asyncio.ensure_future(
                prepare(letter, self._settings(), self._source, folder.work, folder.files, self._made_so_far)
            ),
        )
        self.under_way = under_way
        try:
            await joined(under_way.task)
            if under_way.task.cancelled():
                await self._folder.ask(lambda outbox: outbox.discard(letter.key))
                return  # somebody cancelled the letter
            made = under_way.task.result()
            await self._folder.ask(lambda outbox: outbox.prepared(letter.n, made))
            await self._folder.ask(lambda outbox: outbox.discard(letter.key))
            self._is_made()
        except (CannotPrepare, OSError) as why:
            text = str(why) if isinstance(why, CannotPrepare) else f"It could not be prepared: {reason(why)}."
            log.warning("mail %d: %s", letter.n, text)
            await self._folder.ask(lambda outbox: outbox.prepare_failed(letter.n, text))
        except MailRefused:
            raise  # the disk; it is made again
        except Exception:
            log.exception("mail not prepared: mail=%d", letter.n)
            text = "It could not be prepared: internal server error; the server's log has the details."
            await self._folder.ask(lambda outbox: outbox.prepare_failed(letter.n, text))
        finally:
            self.under_way = None
            under_way.over.set()

    def _made_so_far(self, share: float) -> None:  # also called from the thread that packs
        under_way = self.under_way
        if under_way is not None:
            under_way.share = min(1.0, max(under_way.share, share))
