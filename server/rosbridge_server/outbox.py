"""The send queue of one client: bounded, newest kept, drops counted; a slow client delays no other."""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Callable
from typing import Protocol


class Counters:
    """What a bridge has sent since it was made. `dropped` are messages lost because a client did not keep up."""

    __slots__ = ("bytes_sent", "dropped", "sent", "throttled")

    def __init__(self) -> None:
        self.sent = 0
        self.dropped = 0
        self.throttled = 0  # left out by the client's throttle: no loss
        self.bytes_sent = 0


class Wire(Protocol):
    """The socket as the outbox needs it."""

    @property
    def is_ready(self) -> bool:
        """Open, and with room for more."""
        ...

    def write(self, frame: bytes) -> None: ...


class Lane:
    """The frames of one subscription that wait, oldest first. `limit` 0: only the client's byte limit holds."""

    __slots__ = ("frames", "limit")

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self.frames: deque[tuple[int, bytes]] = deque()  # (order of arrival, frame)


class Outbox:
    """Frames on their way to one client. `flush()` is to be called whenever the wire becomes ready again."""

    def __init__(self, wire: Wire, counters: Counters, *, limit_bytes: int) -> None:
        self._wire = wire
        self._counters = counters
        self._limit_bytes = limit_bytes
        self._order = 0
        self._backlog: set[Lane] = set()  # lanes with frames in them
        self._backlog_bytes = 0
        self._replies: deque[bytes] = deque()
        self._is_closed = False
        self.reply_bytes = 0
        self.on_replies_gone: Callable[[], None] | None = None

    def send(self, lane: Lane, frame: bytes) -> None:
        """Sends a message at once where it can, else queues it and drops the oldest that has no room."""
        if self._is_closed:
            return
        if not self._backlog and not self._replies and self._wire.is_ready:
            self._write_message(frame)
            return
        self._order += 1
        lane.frames.append((self._order, frame))
        self._backlog.add(lane)
        self._backlog_bytes += len(frame)
        if lane.limit and len(lane.frames) > lane.limit:
            self._drop_oldest(lane)
        while self._backlog_bytes > self._limit_bytes:
            self._drop_oldest(min(self._backlog, key=_oldest))

    def reply(self, frame: bytes) -> None:
        """Sends an answer ahead of waiting messages. Answers are never dropped: see `reply_bytes`."""
        if self._is_closed:
            return
        if not self._replies and self._wire.is_ready:
            self._write(frame)
            return
        self._replies.append(frame)
        self.reply_bytes += len(frame)

    @property
    def is_empty(self) -> bool:
        """Nothing waits here; the socket's own buffer is the wire's affair."""
        return not self._backlog and not self._replies

    def forget(self, lane: Lane) -> None:
        """The subscription ended: what waits for it is not wanted any more."""
        self._backlog_bytes -= sum(len(frame) for _, frame in lane.frames)
        lane.frames.clear()
        self._backlog.discard(lane)

    def flush(self) -> None:
        """Writes what waits, in the order in which it came, for as long as the wire takes it."""
        while self._replies and self._wire.is_ready:
            frame = self._replies.popleft()
            self.reply_bytes -= len(frame)
            self._write(frame)
        if not self._replies and self.on_replies_gone is not None:
            self.on_replies_gone()
        if not self._backlog or not self._wire.is_ready:
            return
        heads = [(*_head(lane), lane) for lane in self._backlog]
        heapq.heapify(heads)
        while heads and self._wire.is_ready:
            _, _, lane = heads[0]
            _, frame = lane.frames.popleft()
            self._backlog_bytes -= len(frame)
            if lane.frames:
                heapq.heapreplace(heads, (*_head(lane), lane))
            else:
                self._backlog.discard(lane)
                heapq.heappop(heads)
            self._write_message(frame)

    def close(self) -> None:
        """The client is gone: messages that still waited are lost, and counted; nothing more is taken."""
        self._is_closed = True
        self._counters.dropped += sum(len(lane.frames) for lane in self._backlog)
        for lane in list(self._backlog):
            self.forget(lane)
        self._replies.clear()
        self.reply_bytes = 0
        if self.on_replies_gone is not None:
            self.on_replies_gone()

    def _drop_oldest(self, lane: Lane) -> None:
        _, frame = lane.frames.popleft()
        self._backlog_bytes -= len(frame)
        self._counters.dropped += 1
        if not lane.frames:
            self._backlog.discard(lane)

    def _write_message(self, frame: bytes) -> None:
        self._counters.sent += 1
        self._write(frame)

    def _write(self, frame: bytes) -> None:
        self._counters.bytes_sent += len(frame)
        self._wire.write(frame)


def _oldest(lane: Lane) -> int:
    return lane.frames[0][0]


def _head(lane: Lane) -> tuple[int, int]:
    """Sorts lanes by their oldest frame; the id only keeps Python from comparing lanes."""
    return _oldest(lane), id(lane)
