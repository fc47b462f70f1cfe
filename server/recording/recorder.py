"""Writes what one vehicle says while it is monitored: on a thread of its own, behind a queue that never waits.

The loop hands over and goes on; whoever judges never waits for a disk. What the queue cannot take is dropped and
counted. A second thread has the disk keep what was written, for that may take seconds and writing must not wait for it.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import orjson

from server.bridge.encoding import Unencodable, json_bytes
from server.frames import TooManyParts, Unreadable
from server.raw_frame import RawFrame
from server.recording import recover, space
from server.recording.encode import Misfit
from server.recording.folder import FINISHED, RecordingsFolder, id_of, writing_path
from server.recording.own import PREFIX, Own, own_schema
from server.recording.schemas import Schema, TypeBook, standard
from server.recording.space import Allowance, Space
from server.recording.write import PartFile
from server.source import RosVersion

log = logging.getLogger("catgraph.recorder")

MAX_QUEUED = 20_000  # messages: a minute of a talkative car
MAX_QUEUED_BYTES = 64 * 1024 * 1024  # of their frames; in memory they take some five times as much
KEPT_FOR_OWN = 5_000  # places behind the car's: a disk that hangs must not cost the alarms of that time
DRAIN_S = 0.05  # the thread works in small portions: a long one would keep the loop waiting for the interpreter
PORTION = 64  # messages between two chances for others to run
FLUSH_S = 0.2  # and with the portion before it a message is at most 0.25 s old when the system has it
SYNC_S = 1.0
LOOK_S = 1.0  # how often the disk is asked for its room
COUNT_S = 15.0  # how often the folder's files are counted up
TRY_AGAIN_S = 10.0  # what could not be completed on a full disk is tried again so often

Writing = Literal["off", "recording", "saving", "stopped"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """One file to write: what it is called and what it says of itself."""

    path: Path
    version: RosVersion
    metadata: Mapping[str, str]

    @property
    def id(self) -> str:
        return id_of(self.path)


@dataclass(frozen=True, slots=True, kw_only=True)
class Status:
    """What the thread last said of itself; replaced as a whole."""

    state: Writing = "off"
    part: Part | None = None  # the one being written, or the last one
    path: Path | None = None  # what it is called: another name than was asked for, where that was taken
    size: int = 0
    messages: int = 0  # of the car, in this part
    misfits: int = 0  # of them, kept as JSON: not of their type, or of a type that nobody knows
    space: Space | None = None
    trouble: str | None = None  # why it stopped by itself, as a sentence


class Recorder:
    """One vehicle's. All methods are called on one thread, that of the loop, and return at once.

    `call(function, *arguments)` runs something on that thread soon; `on_finished(path)` is called so for each part that
    is closed or recovered, after it has its name and the disk has it.
    """

    def __init__(
        self,
        folder: RecordingsFolder,
        *,
        call: Callable[..., Any],
        on_finished: Callable[[Path], None],
        allowance: Allowance,
        on_unreadable: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._folder = folder
        self._call = call
        self._on_finished = on_finished
        self._on_unreadable = on_unreadable
        self.allowance = allowance
        self.status = Status()
        self.is_ready = False  # the types are
        self.dropped = 0  # since the session began
        self.dropped_at_s: float | None = None  # by the clock that `take` is given
        self._queue: deque[tuple[Any, ...]] = deque()
        self._put_bytes = 0
        self._taken_bytes = 0
        self._wake = threading.Event()
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None
        self._syncer: threading.Thread | None = None
        # the thread's own from here on
        self._file: PartFile | None = None
        self._book: TypeBook | None = None
        self._roads: dict[tuple[str, str | None], tuple[int, Schema, int | None]] = {}
        self._owns: dict[Own, int] = {}
        self._messages = self._misfits = 0
        self._stumbled = False
        self._flushed_s = self._looked_s = self._counted_s = 0.0
        self._used_elsewhere = self._free = 0
        self._left: dict[Path, float] = {}  # what is to be completed when there is room, and when it is tried next

    # -- of the loop -------------------------------------------------------------------------------------------------

    @property
    def queued(self) -> int:
        return len(self._queue)

    def behind_s(self, now_s: float) -> float:
        """How long the oldest message of the car waits already."""
        try:
            item = self._queue[0]
        except IndexError:  # the thread has just taken it
            return 0.0
        return max(0.0, now_s - float(item[6])) if item[0] == "message" else 0.0

    def prepare(self) -> None:
        """Gets the types ready: what comes before they are waits, and would be lost by a kill."""
        self._start()
        self._put(("prepare",))

    def begin(self, part: Part) -> None:
        """From here on what is taken belongs to this part."""
        self._start()
        self._put(("begin", part))

    def learn(self, definitions: Mapping[str, str]) -> None:
        """Definitions of types as the bridge has them, in .msg text."""
        self._put(("learn", dict(definitions)))

    def take(self, topic: str, type: str | None, message: Any, at_ns: int, size: int, now_s: float) -> None:
        """A message of the car, or the RawFrame that holds it; it must not be changed afterwards. `size`: bytes of the
        frame it came in."""
        if len(self._queue) >= MAX_QUEUED or self._put_bytes - self._taken_bytes > MAX_QUEUED_BYTES:
            self.dropped += 1
            self.dropped_at_s = now_s
            return
        self._put_bytes += size
        self._queue.append(("message", topic, type, at_ns, message, size, now_s))

    def own(self, channel: Own, said: Mapping[str, Any], at_ns: int) -> None:
        """Something of ours: there is little of it, and room is kept for it."""
        if len(self._queue) >= MAX_QUEUED + KEPT_FOR_OWN:
            self.dropped += 1
            return
        self._queue.append(("own", channel, at_ns, {"time_ms": at_ns // 1_000_000, **said}))

    def note(self, **more: str) -> None:
        """What is known of the part by now; a part that is recovered after a kill says it too."""
        self._put(("note", more))

    def end(self, *, then: Callable[[], None] | None = None, **ended: str) -> None:
        """The part is complete with what was taken so far; `then` is called on the loop when the disk has it all, or
        has refused."""
        self._put(("end", ended, then))

    def stop(self, *, then: Callable[[], None]) -> None:
        """Ends the part and the thread; `then` is called on the loop afterwards."""
        if self._thread is None:
            then()
            return
        self._put(("end", {"ended": "closed", "why": "The server was stopped."}, None))
        self._put(("stop", then))

    def _put(self, item: tuple[Any, ...]) -> None:
        self._queue.append(item)
        self._wake.set()

    def _start(self) -> None:
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
            self._syncer = threading.Thread(target=self._sync_forever, name="recorder sync", daemon=True)
            self._thread.start()
            self._syncer.start()

    # -- of the thread -----------------------------------------------------------------------------------------------

    def _run(self) -> None:
        while True:
            self._wake.wait(DRAIN_S if self._file is not None else TRY_AGAIN_S if self._left else None)
            self._wake.clear()
            try:
                if self._drain():
                    return
                self._keep_house(time.monotonic())
            except OSError as error:
                self._give_up(f"Recording stopped: {space.why(error)}.")
            except Exception:  # the one net: a fault of ours must not end the recording of whatever comes next
                log.exception("the recorder stumbled")
                self._give_up("Recording stopped: catgraph itself stumbled; its log says how.")

    def _drain(self) -> bool:
        """Writes what waits; True when it is to stop."""
        done = 0
        while self._queue:
            item = self._queue.popleft()
            match item[0]:
                case "message":
                    self._taken_bytes += item[5]
                    if self._file is not None:
                        self._try(self._file, item)
                case "own":
                    if self._file is not None:
                        self._own(self._file, *item[1:])
                case "note":
                    if self._file is not None:
                        self._file.note(**item[1])
                case "begin":
                    self._open(item[1])
                case "prepare":
                    standard(1)
                    standard(2)
                    self.is_ready = True
                case "learn":
                    if self._book is not None:
                        self._book.learn(item[1])
                        self._roads.clear()
                case "end":
                    self._close(item[1])
                    if item[2] is not None:
                        self._call(item[2])
                case "stop":
                    self._ended.set()
                    self._call(item[1])
                    return True
            done += 1
            if done % PORTION == 0:
                time.sleep(0)  # the loop may have waited for the interpreter meanwhile
                self._flush_if_due(time.monotonic())
        return False

    def _try(self, file: PartFile, item: tuple[Any, ...]) -> None:
        try:
            self._message(file, *item[1:5])
        except Exception:  # nothing is known that does it; it may cost its message and not the recording
            self.dropped, self.dropped_at_s = self.dropped + 1, item[6]
            if not self._stumbled:
                self._stumbled = True
                log.exception("a message of %s could not be written, told once", item[1])

    def _message(self, file: PartFile, topic: str, type: str | None, at_ns: int, message: Any) -> None:
        text: bytes | None = None  # of a message that is kept as JSON as it came
        if isinstance(message, RawFrame):
            try:
                message, text = _parsed(message)
            except Unreadable as why:
                self._call(self._on_unreadable, str(why))
                return
        road = self._roads.get((topic, type)) or self._road(file, topic, type)
        channel, schema, loose = road
        if schema.encode is not None:
            try:
                if text is not None:
                    raise Misfit("it is too large to be parsed")
                file.add(channel, at_ns, schema.encode(message))
            except Misfit:
                if loose is None:
                    assert self._book is not None
                    loose = file.channel(topic, self._book.loose(type))
                    self._roads[topic, type] = (channel, schema, loose)
                self._misfits += 1
                file.add(loose, at_ns, text or _json(message))
        else:
            self._misfits += 1
            file.add(channel, at_ns, text or _json(message))
        self._messages += 1

    def _road(self, file: PartFile, topic: str, type: str | None) -> tuple[int, Schema, int | None]:
        assert self._book is not None
        schema = self._book.schema(type) or self._book.loose(type)
        road = self._roads[topic, type] = (file.channel(topic, schema), schema, None)
        return road

    def _own(self, file: PartFile, channel: Own, at_ns: int, said: Mapping[str, Any]) -> None:
        number = self._owns.get(channel)
        if number is None:
            number = self._owns[channel] = file.channel(PREFIX + channel, own_schema(channel))
        file.add(number, at_ns, _json(said))

    def _open(self, part: Part) -> None:
        if self._file is not None:
            self._close({"ended": "closed"})
        self._roads, self._owns = {}, {}
        self._messages = self._misfits = 0
        if self._book is None or self._book.version != part.version:
            self._book = TypeBook(part.version)
        now_s = time.monotonic()
        try:
            self._count_up()
            found = self._look(now_s)
            path = part.path.with_name(self._folder.free_id(part.id) + FINISHED)
            if (exhausted := found.exhausted(self.allowance)) is None:
                self._file = PartFile(path, profile=f"ros{part.version}", metadata=part.metadata)
        except OSError as error:
            log.error("a recording cannot begin: %s", error)
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
        file, self._file = self._file, None
        if file is None:
            if self.status.state != "stopped":
                self.status = replace(self.status, state=state)
            return
        self.status = replace(self.status, state="saving", messages=self._messages, misfits=self._misfits)
        try:
            path = file.close(**ended)
        except Exception as error:  # one of the library too: what the disk has is of use in any case
            said = space.why(error) if isinstance(error, OSError) else type(error).__name__
            log.error("a recording could not be completed: %s", said)
            self._left[writing_path(file.path)] = time.monotonic() + TRY_AGAIN_S
            failed = f"The recording could not be completed: {said}. What the disk took is kept."
            self.status = replace(self.status, state="stopped", trouble=trouble or failed)
            return
        self.status = replace(
            self.status,
            state=state,
            size=file.size,
            messages=self._messages,
            misfits=self._misfits,
            trouble=trouble,
        )
        self._call(self._on_finished, path)

    def _give_up(self, sentence: str) -> None:
        """The disk refused. What it took is completed if it can be, and nothing more is written until it is begun."""
        log.error("%s", sentence)
        if self._file is None:
            self.status = replace(self.status, state="stopped", trouble=sentence)
        else:
            self._close({"ended": "closed", "why": sentence}, state="stopped", trouble=sentence)

    def _keep_house(self, now_s: float) -> None:
        file = self._file
        if file is None:
            self._complete(now_s)
            return
        self._flush_if_due(now_s)
        if now_s - self._looked_s >= LOOK_S:
            found = self._look(now_s)
            file.demand_place()
            exhausted = found.exhausted(self.allowance)
            if exhausted is not None:
                self._give_up(f"{exhausted} What was recorded is saved.")

    def _flush_if_due(self, now_s: float) -> None:
        file = self._file
        if file is not None and now_s - self._flushed_s >= FLUSH_S:
            self._flushed_s = now_s
            file.flush()
            self.status = replace(
                self.status, size=file.size, messages=self._messages, misfits=self._misfits, space=self._space(file)
            )

    def _complete(self, now_s: float) -> None:
        """What a full disk left cut is made whole when there is room again."""
        for path, due_s in list(self._left.items()):
            if now_s >= due_s:
                done = recover.recover(path)
                if done.is_settled:
                    del self._left[path]
                    if done.path is not None:
                        self._call(self._on_finished, done.path)
                else:
                    self._left[path] = now_s + TRY_AGAIN_S

    def _count_up(self) -> None:
        self._counted_s = time.monotonic()
        self._used_elsewhere = space.used_by(self._folder.root)

    def _look(self, now_s: float) -> Space:
        self._looked_s = now_s
        if now_s - self._counted_s >= COUNT_S:
            self._count_up()
            self._used_elsewhere -= self._file.size if self._file is not None else 0
        self._free = space.free_at(self._folder.root)
        return self._space(self._file)

    def _space(self, file: PartFile | None) -> Space:
        return Space(free=self._free, used=self._used_elsewhere + (file.size if file is not None else 0))

    def _sync_forever(self) -> None:
        while not self._ended.wait(SYNC_S):
            file = self._file
            if file is not None:
                try:
                    file.sync()
                except OSError as error:
                    log.error("the disk does not keep what is recorded: %s", error)
                    file.failed = error


def _parsed(frame: RawFrame) -> tuple[Any, bytes | None]:
    """The message in a frame, or the text of one that holds too much to be parsed. Raises Unreadable."""
    try:
        return frame.message(), None
    except TooManyParts:
        if (text := frame.json()) is None:
            raise
        return None, text


def _json(message: Any) -> bytes:
    try:
        return json_bytes(message)
    except Unencodable:  # nothing that came through JSON or CBOR is so; its words are kept all the same
        return orjson.dumps({"unencodable": repr(message)[:100_000].encode("utf-8", "replace").decode()})
