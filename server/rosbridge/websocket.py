"""One WebSocket to a rosbridge, on roslibpy's and autobahn's protocol: watched for silence, and read in whole messages.

autobahn does not detect a half-open connection: its pings come by the thousand or give up after 0.1 s, because its
timers round to whole seconds. It closes the connection for a message above the limit; here the message is skipped.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
import socket as sockets
import struct
from collections import deque
from typing import Protocol

from roslibpy.comm.comm_asyncio import AsyncioRosBridgeProtocol

from server.rosbridge.raw_frame import ENDS_BYTES

for _name in ("autobahn", "txaio", "roslibpy"):  # they log each dropped connection; we report it to the operator
    logging.getLogger(_name).addHandler(logging.NullHandler())
    logging.getLogger(_name).propagate = False

PING_EVERY_S = 0.1  # each answer bounds how old what comes after it can be
SILENT_AFTER_S = 1.6  # the answer to a ping may take 1.3 s; a dead link is dropped, and named, within 2 s
LATE_S = 0.1  # a later check means that our own process stalled
GOODBYE_S = 0.5
MAX_HANDSHAKE_BYTES = 64 * 1024
# A 100 000-beam cloud fits; reading a message of 40 MB would stop the loop for a second.
MAX_MESSAGE_BYTES = 16 * 1024 * 1024
MAX_SKIPPED_BYTES = 256 * 1024 * 1024  # a frame that claims more is no message, and would swallow all that follows
MARK = b"t"  # how the payload of a ping begins by which the delay of the link is measured
MAX_MARKS = 600


class SocketOwner(Protocol):
    """Who acts on what happens to a socket; every method returns at once."""

    def received(self, socket: BridgeProtocol, size: int) -> None: ...
    def opened(self, socket: BridgeProtocol) -> None: ...
    def closed(self, socket: BridgeProtocol) -> None: ...
    def send_mark(self, socket: BridgeProtocol) -> None: ...
    def mark_answered(self, socket: BridgeProtocol, payload: bytes) -> None: ...
    def skipped(self, socket: BridgeProtocol, head: bytes, tail: bytes, size: int) -> None: ...
    def frame(self, socket: BridgeProtocol, payload: bytes, is_binary: bool) -> None: ...


class BridgeProtocol(AsyncioRosBridgeProtocol):  # type: ignore[misc]
    """One WebSocket to the bridge: watched for silence, and handing whole messages to the link that owns it."""

    def connection_made(self, transport: asyncio.Transport) -> None:
        self.settled = asyncio.Event()  # opened, or closed without
        self.gone = asyncio.Event()
        self.was_accepted = False  # by the link, when it opened
        self.was_silent = False
        self.is_dismissed = False  # the bridge closed the connection without a code
        self.has_spoken = False  # a message came
        self.message_data: list[bytes] = []
        self.message_head = self.message_tail = b""  # of one that is skipped
        self.pings = self.pongs = 0  # of `RosLink.ping`: sent, and the newest that was answered
        self.marks_sent: deque[tuple[bytes, float]] = deque(maxlen=MAX_MARKS)  # payload of a ping, when it was sent
        self.mark_numbers = itertools.count(1)
        self.heard_s = self.factory.loop.time()
        self._timer: asyncio.TimerHandle | None = None
        super().connection_made(transport)

    def data_received(self, data: bytes) -> None:
        self.heard_s = self.factory.loop.time()
        self.factory.owner.received(self, len(data))
        super().data_received(data)

    def _dataReceived(self, data: bytes) -> None:
        super()._dataReceived(data)
        if self.state == self.STATE_CONNECTING and len(self.data) > MAX_HANDSHAKE_BYTES:
            self.failHandshake("it sends without end")

    def onOpen(self) -> None:
        super().onOpen()
        self._look(self.factory.loop.time())
        self.factory.owner.opened(self)
        self.settled.set()

    def onPong(self, payload: bytes) -> None:
        if payload.startswith(MARK):
            self.factory.owner.mark_answered(self, bytes(payload))
            return
        if payload.isdigit() and self.pongs < int(payload) <= self.pings:
            self.pongs = int(payload)

    def onClose(self, wasClean: bool, code: int | None, reason: str | None) -> None:
        if self._timer is not None:
            self._timer.cancel()
        super().onClose(wasClean, code, reason)
        self.factory.owner.closed(self)
        self.settled.set()
        self.gone.set()

    def onCloseFrame(self, code: int | None, reasonRaw: bytes | None) -> bool | None:
        """The bridge's close frame is answered without waiting."""
        self.is_dismissed = code in (None, 1005)
        done: bool | None = super().onCloseFrame(code, reasonRaw)
        if self._timer is not None and self.transport is not None:
            self._timer.cancel()
            self._timer = self.factory.loop.call_later(GOODBYE_S, self._closeConnection, True)
            self.transport.close()
        return done

    def _closeConnection(self, abort: bool = False) -> None:
        if self.transport is None:
            return
        if abort:  # else the system would go on delivering what it holds, long after it was true
            with contextlib.suppress(OSError, TypeError, AttributeError):
                self.transport.get_extra_info("socket").setsockopt(
                    sockets.SOL_SOCKET, sockets.SO_LINGER, struct.pack("ii", 1, 0)
                )
        super()._closeConnection(abort)

    def _look(self, due_s: float) -> None:
        """Is the other side still there, and how late is the link? Pings, and drops what does not answer."""
        loop = self.factory.loop
        now_s = loop.time()
        quiet_s = now_s - self.heard_s
        is_late = now_s - due_s > LATE_S  # received data may still be unread
        if quiet_s >= SILENT_AFTER_S and not is_late:
            self.was_silent = True
            self.dropConnection(abort=True)
            return
        self.factory.owner.send_mark(self)
        next_s = max(min(now_s + PING_EVERY_S, self.heard_s + SILENT_AFTER_S + 0.001), now_s + LATE_S)
        self._timer = loop.call_at(next_s, self._look, next_s)

    def send_mark(self, sent_s: float, *, is_followed: bool) -> None:
        """Pings with a payload of its own; `is_followed`: `take_mark` is called with its answer."""
        payload = MARK + b"%d" % next(self.mark_numbers)
        self.sendPing(payload)
        if is_followed:
            self.marks_sent.append((payload, sent_s))

    def take_mark(self, payload: bytes) -> float | None:
        """When the ping was sent that is answered so, and forgets those before it, which this answers too."""
        if all(sent != payload for sent, _ in self.marks_sent):
            return None
        while self.marks_sent:
            sent, sent_s = self.marks_sent.popleft()
            if sent == payload:
                return sent_s
        return None

    # A message is gathered here, so that one beyond the limit can be skipped where autobahn would hang up.

    def onMessageFrameBegin(self, length: int) -> None:
        super().onMessageFrameBegin(length)
        if self.message_data_total_length > MAX_SKIPPED_BYTES:
            self._fail_connection(1009, f"a message of {self.message_data_total_length // 2**20} MB")
        elif self._is_too_large:
            self._keep_ends(b"".join(self.message_data))
            self.message_data.clear()

    def onMessageFrameData(self, payload: bytes) -> None:
        if self._is_too_large:
            self._keep_ends(payload)
        else:
            super().onMessageFrameData(payload)

    def _keep_ends(self, payload: bytes) -> None:
        if len(self.message_head) < ENDS_BYTES:
            self.message_head += payload[: ENDS_BYTES - len(self.message_head)]
        self.message_tail = (self.message_tail + payload[-ENDS_BYTES:])[-ENDS_BYTES:]

    def onMessageEnd(self) -> None:
        data, self.message_data = self.message_data, []
        head, tail, self.message_head, self.message_tail = self.message_head, self.message_tail, b"", b""
        self.has_spoken = True
        if self.failedByMe:
            return
        if self._is_too_large:
            size = int(self.message_data_total_length)
            self.factory.owner.skipped(self, head, tail, size)
        else:
            self.factory.owner.frame(self, b"".join(data), self.message_is_binary)

    @property
    def is_in_message(self) -> bool:
        """Whether a part of a message came, and not yet its end: a ping may be answered in between."""
        return bool(self.message_data or self.message_head)

    @property
    def _is_too_large(self) -> bool:
        return bool(self.message_data_total_length > MAX_MESSAGE_BYTES)
