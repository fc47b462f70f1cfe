"""The thread that writes one vehicle's parts, and a second one that has the disk keep what was written."""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections.abc import Callable, Mapping
from contextvars import copy_context
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from server.recording import chain_neighbours, space
from server.recording.folder import FINISHED, RecordingsFolder, id_of, writing_path
from server.recording.mcap.chain import Head
from server.recording.mcap.write import PartFile
from server.recording.part_writer import PartWriter
from server.recording.read.schemas import TypeBook, standard
from server.recording.recorder_queue import (
    Attachment,
    Begin,
    CarMessage,
    End,
    Item,
    Learn,
    Note,
    OwnEntry,
    Part,
    Prepare,
    RecorderQueue,
    Stop,
)
from server.recording.recover import UnfinishedParts
from server.recording.space import Allowance, Space, SpaceWatch
from server.rosbridge.codec import Unreadable

log = logging.getLogger("catgraph.recorder")

DRAIN_S = 0.05  # the thread works in small portions: a long one would keep the loop waiting for the interpreter
PORTION = 64  # messages between two chances for others to run
FLUSH_S = 0.2  # and with the portion before it a message is at most 0.25 s old when the system has it
SYNC_S = 1.0

Writing = Literal["off", "recording", "saving", "stopped"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Status:
    """The newest status of the thread; replaced as a whole."""

    state: Writing = "off"
    part: Part | None = None  # the one being written, or the last one
    path: Path | None = None  # the actual name, different if the requested one was in use
    size: int = 0
    messages: int = 0  # of the car, in this part
    misfits: int = 0  # of them, stored as JSON: not matching their type, or of an unknown type
    space: Space | None = None
    trouble: str | None = None  # why it stopped by itself, as a sentence


class RecorderThread:
    """Empties the queue into files. `call(function, *arguments)` runs something on the loop soon.

    `status` and `is_ready` are read, and `allowance` is set, by the loop; everything else is the threads' own.
    """

    def __init__(
        self,
        folder: RecordingsFolder,
        queue: RecorderQueue,
        *,
        call: Callable[..., Any],
        on_finished: Callable[[Path], None],
        on_unreadable: Callable[[str, str], None],
        allowance: Allowance,
    ) -> None:
        self.allowance = allowance
        self.status = Status()
        self.is_ready = False  # the types are
        self._folder = folder
        self._queue = queue
        self._call = call
        self._on_finished = on_finished
        self._on_unreadable = on_unreadable
        self._ended = threading.Event()
        self._writer: PartWriter | None = None
        self._book: TypeBook | None = None
        self._space = SpaceWatch(folder.root)
        self._unfinished = UnfinishedParts()
        self._newest_head: Head | None = None  # of the part that was closed last
        self._stumbled = False
        self._flushed_s = 0.0

    def start(self) -> None:
        for name, work in (("recorder", self._run), ("recorder sync", self._sync_forever)):
            # With the context of the caller: a line of the log names its car.
            threading.Thread(target=copy_context().run, args=(work,), name=name, daemon=True).start()

    def _run(self) -> None:
        while True:
            self._queue.wake.wait(self._wait_s())
            self._queue.wake.clear()
            try:
                if self._drain():
                    return
                self._housekeeping(time.monotonic())
            except OSError as error:
                self._give_up(f"Recording stopped: {space.why(error)}.")
            except Exception:  # the one net: a fault of ours must not end the recording of whatever comes next
                log.exception("recorder failed")
                self._give_up("Recording stopped: internal error; the server's log has the details.")

    def _wait_s(self) -> float | None:
        """Until the queue is looked at again; None: until something wakes the thread."""
        if self._writer is not None or self.status.state == "stopped":  # one that stopped is handed messages still
            return DRAIN_S
        return self._unfinished.wait_s

    # -- what waits --------------------------------------------------------------------------------------------------

    def _drain(self) -> bool:
        """Writes what waits; True when it is to stop."""
        done = 0
        while (item := self._queue.next()) is not None:
            if isinstance(item, Stop):
                self._ended.set()
                self._call(item.then)
                return True
            self._do(item)
            done += 1
            if done % PORTION == 0:
                time.sleep(0)  # the loop may have waited for the interpreter meanwhile
                self._flush_if_due(time.monotonic())
        return False

    def _do(self, item: Item) -> None:
        match item:
            case CarMessage():
                if self._writer is not None:
                    self._write(self._writer, item)
            case OwnEntry():
                if self._writer is not None:
                    self._writer.own(item.channel, item.at_ns, item.fields)
            case Attachment():
                if self._writer is not None:
                    self._attach(self._writer, item)
            case Begin():
                self._open(item.part)
            case Prepare():
                standard(1)
                standard(2)
                self.is_ready = True
            case Learn():
                self._learn(item.definitions)
            case Note():
                if self._writer is not None:
                    self._writer.file.note(**item.more)
            case End():
                self._close(item.ended)
                if item.then is not None:
                    self._call(item.then)

    def _write(self, writer: PartWriter, item: CarMessage) -> None:
        try:
            writer.message(item.topic, item.type, item.at_ns, item.message)
        except Unreadable as why:
            self._call(self._on_unreadable, item.topic, str(why))
        except Exception:  # nothing is known that does it; it may cost its message and not the recording
            self._queue.drop(item.now_s)
            if not self._stumbled:
                self._stumbled = True
                log.exception("message not written (logged once): topic=%s", item.topic)

    def _attach(self, writer: PartWriter, item: Attachment) -> None:
        """One that cannot be read stays where it is, and is kept beside the recording later."""
        try:
            data = item.path.read_bytes()
        except OSError as error:
            log.error("attachment not read: name=%s error=%s", item.name, error)
            return
        writer.file.attach(item.name, item.media_type, item.at_ns, data)

    def _learn(self, definitions: Mapping[str, str]) -> None:
        if self._book is not None:
            self._book.learn(definitions)
            if self._writer is not None:
                self._writer.types_changed()

    # -- one part after the other ------------------------------------------------------------------------------------

    def _open(self, part: Part) -> None:
        if self._writer is not None:
            self._close({"ended": "closed"})
        if self._book is None or self._book.version != part.version:
            self._book = TypeBook(part.version)
        now_s = time.monotonic()
        try:
            self._space.count_up()
            found = self._space.look(now_s, 0)
            path = part.path.with_name(self._folder.free_id(part.id) + FINISHED)
            if (exhausted := found.exhausted(self.allowance)) is None:
                before = self._newest_head
                if before is None:
                    with contextlib.suppress(Exception):  # recording never fails for what other files are
                        before = chain_neighbours.newest_head(path)
                metadata = {**part.metadata, **chain_neighbours.as_metadata(before)}
                file = PartFile(path, profile=f"ros{part.version}", metadata=metadata)
                self._writer = PartWriter(file, self._book)
        except OSError as error:
            log.error("recording not started: %s", error)
            trouble = f"Recording cannot begin: {space.why(error)}."
            self.status = Status(state="stopped", part=part, trouble=trouble)
            return
        if exhausted is not None:
            log.warning("%s", exhausted)
            self.status = Status(state="stopped", part=part, space=found, trouble=exhausted)
            return
        self._flushed_s = now_s
        self.status = Status(state="recording", part=part, path=path, space=found)

    def _close(self, ended: Mapping[str, str], *, state: Writing = "off", trouble: str | None = None) -> None:
        writer, self._writer = self._writer, None
        if writer is None:
            if self.status.state != "stopped":
                self.status = replace(self.status, state=state)
            return
        self.status = replace(self.status, state="saving", messages=writer.messages, misfits=writer.misfits)
        try:
            path = writer.file.close(**ended)
        except Exception as error:  # one of the library too: what the disk has is of use in any case
            reason = space.why(error) if isinstance(error, OSError) else type(error).__name__
            log.error("recording not completed: %s", reason)
            self._newest_head = None  # it is in the file, as far as the disk took it
            self._unfinished.add(writing_path(writer.file.path), time.monotonic())
            failed = f"The recording could not be completed: {reason}. What was written is kept."
            self.status = replace(self.status, state="stopped", trouble=trouble or failed)
            return
        self._newest_head = writer.file.head(id_of(path))
        self.status = replace(self.status, state=state, size=writer.file.size, trouble=trouble)
        self._call(self._on_finished, path)

    def _give_up(self, sentence: str) -> None:
        """A disk error: complete the part if possible, and write nothing until the next part."""
        log.error("%s", sentence)
        if self._writer is None:
            self.status = replace(self.status, state="stopped", trouble=sentence)
        else:
            self._close({"ended": "closed", "why": sentence}, state="stopped", trouble=sentence)

    # -- between the portions ----------------------------------------------------------------------------------------

    def _housekeeping(self, now_s: float) -> None:
        writer = self._writer
        if writer is None:
            for path in self._unfinished.complete(now_s):
                self._call(self._on_finished, path)
            return
        self._flush_if_due(now_s)
        if self._space.is_due(now_s):
            found = self._space.look(now_s, writer.file.size)
            writer.file.demand_place()
            exhausted = found.exhausted(self.allowance)
            if exhausted is not None:
                self._give_up(f"{exhausted} What was recorded is saved.")

    def _flush_if_due(self, now_s: float) -> None:
        writer = self._writer
        if writer is not None and now_s - self._flushed_s >= FLUSH_S:
            self._flushed_s = now_s
            writer.file.flush()
            size = writer.file.size
            self.status = replace(
                self.status,
                size=size,
                messages=writer.messages,
                misfits=writer.misfits,
                space=self._space.now(size),
            )

    def _sync_forever(self) -> None:
        while not self._ended.wait(SYNC_S):
            writer = self._writer
            if writer is not None:
                try:
                    writer.file.sync()
                except OSError as error:
                    log.error("recording not synced to disk: %s", error)
                    writer.file.failed = error
