"""Compression of the messages to pages: each is compressed once for all pages that got the same before it.

A message may refer to what the page got before (RFC 7692). A state of 16 kB differs from the previous one by a few
hundred bytes: with the previous one as its dictionary it has 0.5 kB after 90 µs. No page has a compressor of its own,
which would be 256 kB, and the result is the same for every page that got the same. Short messages are sent as they are,
so that they part no two pages.
"""

from __future__ import annotations

import itertools
import weakref
import zlib
from collections.abc import Sequence
from typing import Any

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.extensions.permessage_deflate import PerMessageDeflate, ServerPerMessageDeflateFactory
from websockets.frames import CTRL_OPCODES, Frame, Opcode
from websockets.typing import ExtensionParameter

SETTINGS: dict[str, Any] = {"level": 6, "memLevel": 6}
FROM_PAGES_BITS = 12  # of the window for what a page sends: little
SHORTEST = 128  # bytes; an offer or an answer gains nothing
KIND = 14  # bytes with which messages of one kind begin: {"kind":"state
ENDS = 200  # bytes at both ends, where the time is and so two messages differ: all of a state take 20 µs to hash
EMPTY_BLOCK = b"\x00\x00\xff\xff"  # the end of a message in zlib's output, which is not sent (RFC 7692, 7.2.1)


class Message:
    """What at least one page got and may still be referred to."""

    __slots__ = ("__weakref__", "compressed", "data", "number")

    def __init__(self, data: bytes, number: int) -> None:
        self.data = data
        self.number = number
        self.compressed: dict[tuple[int, ...], bytes] = {}  # by the page's window and the messages it refers to


class Messages:
    """Of all pages. One that is in no page's window any more is gone."""

    def __init__(self) -> None:
        self._messages: weakref.WeakValueDictionary[tuple[int, bytes, bytes], Message] = weakref.WeakValueDictionary()
        self._numbers = itertools.count()

    def __len__(self) -> int:
        return len(self._messages)

    def get(self, data: bytes) -> Message:
        key = (len(data), data[:ENDS], data[-ENDS:])
        found = self._messages.get(key)
        if found is None or found.data != data:
            found = self._messages[key] = Message(data, next(self._numbers))
        return found


class SharedDeflate(PerMessageDeflate):
    """What one page and the server agreed on; it compresses by `messages`, and decompresses as its base class does."""

    def __init__(self, agreed: PerMessageDeflate, messages: Messages) -> None:
        super().__init__(
            agreed.remote_no_context_takeover,
            True,  # the base class makes no compressor
            agreed.remote_max_window_bits,
            agreed.local_max_window_bits,
        )
        self._window = 0 if agreed.local_no_context_takeover else 1 << agreed.local_max_window_bits
        self._messages = messages
        self._before: list[Message] = []  # what begins in the page's window, and the newest; the newest last
        self._size = 0  # bytes of them

    def encode(self, frame: Frame) -> Frame:
        """The frame as it is sent: compressed where it is a whole message that is long enough."""
        if frame.opcode in CTRL_OPCODES or frame.opcode is Opcode.CONT or not frame.fin or len(frame.data) < SHORTEST:
            return frame
        message = self._messages.get(bytes(frame.data))
        base = self._base(message.data[:KIND])
        key = (self.local_max_window_bits, *(one.number for one in base))
        compressed = message.compressed.get(key)
        if compressed is None:
            compressed = message.compressed[key] = self._compressed(message, b"".join(one.data for one in base))
        self._remember(message)
        return Frame(frame.opcode, compressed, rsv1=True)

    def _base(self, kind: bytes) -> list[Message]:
        """What the page got from the last message of this kind on; nothing where that is out of its window."""
        for k in range(len(self._before) - 1, -1, -1):
            if self._before[k].data[:KIND] == kind:
                return self._before[k:] if self._window else []
        return []

    def _remember(self, message: Message) -> None:
        self._before.append(message)
        self._size += len(message.data)
        while len(self._before) > 1 and self._size - len(self._before[0].data) >= self._window:
            self._size -= len(self._before.pop(0).data)

    def _compressed(self, message: Message, before: bytes) -> bytes:
        dictionary: dict[str, Any] = {"zdict": before} if before else {}  # zlib takes as much of its end as it can use
        compressor = zlib.compressobj(wbits=-self.local_max_window_bits, **SETTINGS, **dictionary)
        return (compressor.compress(message.data) + compressor.flush(zlib.Z_SYNC_FLUSH)).removesuffix(EMPTY_BLOCK)


class SharedDeflateFactory(ServerPerMessageDeflateFactory):
    """The extension as it is offered to a page."""

    def __init__(self, messages: Messages) -> None:
        super().__init__(client_max_window_bits=FROM_PAGES_BITS)
        self._messages = messages

    def process_request_params(
        self, params: Sequence[ExtensionParameter], accepted_extensions: Any
    ) -> tuple[list[ExtensionParameter], PerMessageDeflate]:
        answer, agreed = super().process_request_params(params, accepted_extensions)
        return answer, SharedDeflate(agreed, self._messages)


class PageSocket(WebSocketsSansIOProtocol):
    """uvicorn's WebSocket, compressing as we want it. Written against uvicorn 0.54 and websockets 17."""

    messages = Messages()  # of all servers of the process: it has results of a function, and nothing else

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.conn.available_extensions = [SharedDeflateFactory(self.messages)]
