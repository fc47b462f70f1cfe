"""Makes the mails of the letters that were ordered, one letter at a time: exported, packed, cut or linked, written.

The work is done off the event loop.
"""

from __future__ import annotations

import asyncio
import logging
import re
import shutil
import threading
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TypeVar
from urllib.parse import quote

from server.mail import address, compose, mail_text
from server.mail.mail_folder import MailFolder, MailRefused, reason
from server.mail.order import Composed, Letter, Prepared, Way
from server.mail.outbox import Outbox
from server.mail.pack import NoRoom, Pack, cut, need_room, pack
from server.mail.settings import MailSettings
from server.mail.source import Source
from server.mail.under_way import Underway, joined
from server.recording.catalog.discovery import why_not_one_file
from server.recording.export.formats import FORMATS
from server.recording.mcap.chain import read_head
from server.storage.durable_file import sync_folder

log = logging.getLogger("catgraph.mail")
T = TypeVar("T")
MAX_PARTS = 60
_EXPORTED, _PACKED = 0.6, 0.9  # of the progress: where exporting ends, where packing does


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


class CannotPrepare(Exception):
    """It cannot be made; `str()` is one sentence for the operator."""


async def prepare(
    letter: Letter, settings: MailSettings, source: Source, folder: Path, files: Path, progress: Callable[[float], None]
) -> Prepared:
    """Write the mails of a letter into `files`, with working files in `folder`. Raises CannotPrepare, OSError."""
    if not settings.is_complete:
        raise CannotPrepare("Mail is not set up: enter SMTP host and sender in Settings, E-mail.")
    work = folder / letter.key
    stop = threading.Event()
    try:
        await asyncio.to_thread(_begin, work)
        paths, missing = await _exported(letter, source, work, lambda share: progress(share * _EXPORTED))
        packing = partial(
            pack,
            paths,
            work / "pack.zip",
            _pack_name(letter),
            letter.ordered_ms,
            lambda share: progress(_EXPORTED + share * (_PACKED - _EXPORTED)),
            stop,
        )
        packed = await _in_thread(packing, stop)
        heads = await asyncio.to_thread(_heads, letter, source)
        made = await _in_thread(partial(_write, letter, settings, packed, (missing, heads), files, stop), stop)
        progress(1.0)
        return made
    except (NoRoom, ValueError) as why:
        raise CannotPrepare(str(why)) from None
    finally:
        await asyncio.shield(asyncio.to_thread(shutil.rmtree, work, True))


def _begin(work: Path) -> None:
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)


async def _in_thread(work: Callable[[], T], stop: threading.Event) -> T:
    """Run work in a thread; a cancelled task stops the thread and waits for it."""
    running = asyncio.ensure_future(asyncio.to_thread(work))
    try:
        return await asyncio.shield(running)
    except asyncio.CancelledError:
        stop.set()
        await asyncio.wait([running])
        if not running.cancelled():
            running.exception()
        raise


async def _exported(
    letter: Letter, source: Source, work: Path, progress: Callable[[float], None]
) -> tuple[list[Path], list[str]]:
    """The files, and what of the recordings is not in them, in sentences."""
    found: list[Path] = []
    missing: list[str] = []
    order = letter.order
    covered: set[str] = set()
    for i, recording in enumerate(order.recordings):
        if recording in covered:
            continue  # another part of a drive that is there
        drive = await asyncio.to_thread(_drive_of, letter, source, recording)
        covered.update(drive)
        path = await asyncio.to_thread(source.path_of, recording)
        if path is None:
            raise CannotPrepare(f"The recording {recording} no longer exists.")
        what = await asyncio.to_thread(why_not_one_file, path)
        if order.format == "mcap" and what is not None:
            raise CannotPrepare(f"{recording} is {what}: send it in another format.")
        if order.format != "mcap":
            into = work / f"{i}"
            await asyncio.to_thread(into.mkdir)
            on_progress = partial(_part_of, progress, i, len(order.recordings))
            paths = [path] if len(drive) == 1 else await asyncio.to_thread(_paths, drive, source, recording, path)
            try:
                made = await source.export(paths, order.format, into, on_progress, required=path)
            except (OSError, ValueError, RuntimeError) as why:
                raise CannotPrepare(f"{recording} cannot be written as {order.format}: {why}") from None
            path = made.path
            if not made.is_whole:
                missing += [f"{recording}: {note}" for note in made.notes] or [
                    f"{recording}: the export is incomplete."
                ]
        found.append(path)
        progress((i + 1) / len(order.recordings))
    return found, missing


def _drive_of(letter: Letter, source: Source, recording: str) -> Sequence[str]:
    """The recordings that are in one file: of a report all parts of the drive."""
    form = FORMATS.get(letter.order.format)
    return source.drive_of(recording) if form is not None and form.of_drive else [recording]


def _paths(recordings: Sequence[str], source: Source, requested: str, path: Path) -> list[Path]:
    found = (path if recording == requested else source.path_of(recording) for recording in recordings)
    return [path for path in found if path is not None]


def _part_of(progress: Callable[[float], None], i: int, of: int, share: float) -> None:
    progress((i + share) / of)


def _heads(letter: Letter, source: Source) -> list[str]:
    """Of a mail of reports: the head of each recording's hash chain, a line each."""
    if letter.order.format != "html":
        return []
    found = []
    parts = (part for recording in letter.order.recordings for part in _drive_of(letter, source, recording))
    for recording in dict.fromkeys(parts):
        path = source.path_of(recording)
        head = None if path is None else read_head(path, recording)
        found.append(f"{recording}: {'not known' if head is None else head.digest}")
    return found


def _write(
    letter: Letter,
    settings: MailSettings,
    packed: Pack,
    provenance: tuple[Sequence[str], Sequence[str]],
    files: Path,
    stop: threading.Event,
) -> Prepared:
    """`provenance`: what of the recordings is missing, and the heads of their hash chains, in lines."""
    order = letter.order
    parts = cut(packed, settings.limit_bytes)
    way: Way = "attached" if len(parts) == 1 else order.too_large
    if way == "split" and len(parts) > MAX_PARTS:
        raise CannotPrepare(
            f"{packed.size_bytes / 1e6:.0f} MB would be {len(parts)} mails, and {MAX_PARTS} are the most: "
            "send it as a link."
        )
    if way == "link":
        texts = [
            mail_text.linked(order.text, order.recordings, order.format, packed, _links(letter, settings), *provenance)
        ]
    else:
        texts = mail_text.attached(order.text, order.recordings, order.format, packed, parts, *provenance)
        need_room(files, packed.size_bytes * 3 // 2)
    sender = address.parse(settings.sender)
    made: list[Composed] = []
    for number, text in enumerate(texts, 1):
        # The id contains a hash of the content: the same mail composed again has the same id, other content another.
        message_id = f"<{letter.key}.{packed.sha256[:12]}.{number}of{len(texts)}@{sender.domain}>"
        stretch = parts[number - 1]
        draft = compose.Draft(
            sender=sender,
            sender_name=settings.sender_name,
            to=[address.parse(one) for one in order.to],
            subject=mail_text.subject_of(order.subject, number, len(texts)),
            at_ms=letter.ordered_ms,
            message_id=message_id,
            text=text,
            attachment=None
            if way == "link"
            else compose.Attachment(path=packed.path, start=stretch.start, length=stretch.length, name=stretch.name),
        )
        name = f"{letter.key}-{number}.eml"
        half = files / f"{name}.new"
        half.unlink(missing_ok=True)
        size = compose.write(draft, half, stop)
        half.replace(files / name)
        sync_folder(files)
        made.append(Composed(part=number, parts=len(texts), message_id=message_id, file=name, size_bytes=size))
    return Prepared(mails=tuple(made), sender=sender.text, way=way, size_bytes=packed.size_bytes, sha256=packed.sha256)


def _links(letter: Letter, settings: MailSettings) -> list[str]:
    base = settings.link_base or letter.order.base
    if not base:
        raise CannotPrepare("No address for links is known: set it in Settings, E-mail.")
    ending = "file.mcap" if letter.order.format == "mcap" else f"export/{letter.order.format}"
    return [f"{base}/api/recordings/{quote(recording, safe='')}/{ending}" for recording in letter.order.recordings]


def _pack_name(letter: Letter) -> str:
    """The name of what is attached: the recording's, or the first one's and how many more."""
    first, *more = letter.order.recordings
    plain = re.sub(r"[^A-Za-z0-9_-]", "-", first)[:80]
    name = plain if plain[:1].isalnum() else f"recording{plain}"
    return f"{name}_and_{len(more)}_more" if more else name
