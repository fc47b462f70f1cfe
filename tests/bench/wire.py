"""When commands arrive at the bridge's port, by the kernel's clock: what the bridge itself does then counts for nobody.

The bench's bridge shares its processor with all that loads it, and reads a command some milliseconds after it came.
"""

from __future__ import annotations

import contextlib
import ctypes
import socket
import struct
import threading
from collections.abc import Iterator

import orjson

_SO_TIMESTAMPNS = 35  # linux/socket.h; Python has no names for these two
_SO_ATTACH_FILTER = 26
_ETH_P_IP = 0x0800
_ARRIVED = 0  # PACKET_HOST: on the loopback each packet is seen twice, as it goes and as it comes
_ROOM = 4 << 20
_SHORT_FRAME = 126  # a WebSocket frame at least so long spells its length in two more bytes
_LONG_FRAME = 127


class Wire:
    """Publications to a bridge's port on this machine. Needs the right to look at packets: `PermissionError`."""

    def __init__(self, port: int) -> None:
        self._arrived: list[tuple[int, bytes]] = []  # ns since 1970, what the packet carries
        self._socket = socket.socket(socket.AF_PACKET, socket.SOCK_DGRAM, socket.htons(_ETH_P_IP))
        self._socket.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _ROOM)
        program = _to_port(port)  # a filter in the kernel: the other direction has a thousand times as much
        code = ctypes.create_string_buffer(program)
        self._socket.setsockopt(
            socket.SOL_SOCKET, _SO_ATTACH_FILTER, struct.pack("HL", len(program) // 8, ctypes.addressof(code))
        )
        self._socket.bind(("lo", _ETH_P_IP))
        self._socket.settimeout(0.2)
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._listen, name="wire", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        self._ends.set()
        self._thread.join()
        self._socket.close()

    def published(self, topic: str) -> list[int]:
        """When each publication on a topic arrived [ns]; call it after `stop`."""
        found = []
        for at_ns, packet in self._arrived:
            for text in texts_of(packet):
                message = orjson.loads(text)
                if message.get("op") == "publish" and message.get("topic") == topic:
                    found.append(at_ns)
        return found

    def _listen(self) -> None:
        while not self._ends.is_set():
            with contextlib.suppress(TimeoutError):
                packet, ancillary, _, address = self._socket.recvmsg(65_536, 256)
                if address[2] == _ARRIVED:
                    seconds, nanoseconds = struct.unpack("qq", ancillary[0][2][:16])
                    self._arrived.append((seconds * 1_000_000_000 + nanoseconds, packet))


def texts_of(packet: bytes) -> Iterator[bytes]:
    """The texts of the WebSocket frames in a client's IPv4 packet; short ones, so each is whole within it."""
    after_ip = (packet[0] & 15) * 4
    data = packet[after_ip + (packet[after_ip + 12] >> 4) * 4 :]
    while len(data) >= 6 and data[0] == 0x81 and data[1] & 0x80:
        length, at = data[1] & 0x7F, 2
        if length == _LONG_FRAME:
            return
        if length == _SHORT_FRAME:
            length, at = int.from_bytes(data[2:4], "big"), 4
        mask, masked = data[at : at + 4], data[at + 4 : at + 4 + length]
        if len(masked) < length:
            return
        yield bytes(byte ^ mask[i % 4] for i, byte in enumerate(masked))
        data = data[at + 4 + length :]


def _to_port(port: int) -> bytes:
    """Berkeley packet filter over an IPv4 packet: TCP, to this port, and carrying anything or not."""
    load_byte, load_header, load_half, is_equal, give = 0x30, 0xB1, 0x48, 0x15, 0x06
    steps = (
        (load_byte, 0, 0, 9),  # the protocol
        (is_equal, 0, 4, socket.IPPROTO_TCP),
        (load_header, 0, 0, 0),  # the length of IP's own header
        (load_half, 0, 0, 2),  # after it the port it came from, and the one it goes to
        (is_equal, 0, 1, port),
        (give, 0, 0, 0x40000),
        (give, 0, 0, 0),
    )
    return b"".join(struct.pack("HBBI", *step) for step in steps)
