"""How frames, events and requests travel through a NATS broker: subjects `veh.<vehicle>.…`, bodies of JSON.

| subject | direction | body |
|---|---|---|
| `pull.<kind>` | node requests, agent answers | `Pull`; a frame's head as a line of JSON, then the frame |
| `ask` | node requests, agent answers | a command, or a request for events or the clock |
| `http.…` | node requests, agent answers | requests for what the agent keeps: `nats_http.py` |
| `events` | agent publishes | events in order, once pages may have them |
| `here` | agent publishes every second | its run and the number of its newest event; behind a gap a state |

A request about a command has its id in the header `Catgraph-Trace`, for the logs.

A frame is pulled, never pushed: one is under way to a node at a time, over a slow radio a few (`nats_pulls.py`), so
that a stalled hop finds nothing old. Where the pull allows it, the answer is compressed by zlib, and by the frame that
the node has as the preset dictionary. Behind a gap a few states come unasked with the announcements of the agent, by
two of its connections: it may publish no other subject. All times are of the agent's monotonic clock, in seconds.
"""

from __future__ import annotations

import logging
import zlib
from typing import Annotated, Any, Literal, TypeVar

import orjson
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from server.bus.bus import SUMMARY
from server.system import log_context

HERE_EVERY_S = 1.0
PULL_WAITS_S = 1.0  # an agent without a newer frame answers after so long that there is none
PORTION = 100  # events of one message: far below the broker's largest
TRACE = "Catgraph-Trace"
LARGEST = 900_000  # bytes of a body; a broker as it is takes 1 MiB
HEADERS = 200  # bytes that the broker counts beside a body, at most
SMALLEST = 140_000  # bytes that a broker must take: chunks of downloads are smaller
HEAD = 10_000  # bytes of a body besides its events
ZLIB_BEGIN = b"\x78"  # RFC 1950; a frame that is not compressed begins with a brace
ZLIB_LEVEL = 3  # 17 kB become 4.8 kB, or 0.6 to 0.9 by an earlier frame (1.3 to 1.6 by level 1), in 0.15 ms
MOST_BASES = 32  # frames that an agent sent of late, 3 s of them; a node needs one for each pull that is under way
KINDS = frozenset({"state", "scan", SUMMARY})


log = logging.getLogger("catgraph.bus")


class Malformed(ValueError):
    """What came is not what this subject carries."""


class Body(BaseModel):
    """One body; what it does not declare is ignored, so that neighbouring versions understand each other."""

    model_config = ConfigDict(frozen=True, strict=True)


B = TypeVar("B", bound=Body)
Number = Annotated[int, Field(ge=0, lt=1 << 53)]
Seconds = Annotated[float, Field(allow_inf_nan=False, ge=-1e12, le=1e12)]
Duration = Annotated[float, Field(allow_inf_nan=False, ge=-3600.0, le=3600.0)]
Run = Annotated[str, Field(max_length=40)]


class Pull(Body):
    """A node requests a frame newer than number `have` of the agent's run `run`."""

    have: Number
    run: Run
    inflates: bool = False  # the answer may be compressed
    is_base: bool = False  # by frame `have`, which the node still has


class FrameHead(Body):
    """The first line of a frame; `number` 0: there is no newer one, and no frame follows."""

    run: Run
    number: Number
    now_s: Seconds
    waited_s: Duration = 0.0  # from the pull to this answer
    age_s: Duration = 0.0  # of the frame when it was sent
    is_text: bool = True
    refused: Annotated[str, Field(max_length=300)] = ""  # why the newer one is not sent, as a sentence


class Here(Body):
    run: Run
    last: Number
    resumes: bool = False  # the agent answers `resume`
    connection: Number = 0  # of this run to the broker; what still comes from an earlier one is old
    is_copy: bool = False  # by an idle connection: only its state counts, no request finds the agent by it
    state: str = ""  # base64 of a frame, compressed by frame `base`
    base: Number = 0


class Events(Body):
    run: Run
    events: Annotated[list[dict[str, Any]], Field(max_length=PORTION)]


class Ask(Body):
    """`command`: only where it comes until `not_after_s` of the agent's run `run`, answered until `answered_by_s`;
    `after` and `find`: events; `clock`: only that; `resume`: where to go on after number `n` of `run`."""

    do: Literal["command", "after", "find", "clock", "resume"]
    command: dict[str, Any] = {}
    not_after_s: float = 0.0
    answered_by_s: float | None = None  # None: `not_after_s`
    run: Run = ""
    n: Number = 0
    limit: Annotated[int, Field(ge=1, le=PORTION)] = PORTION
    filters: dict[str, Any] = {}


class Answer(Body):
    run: Run
    now_s: Seconds
    last: Number
    answer: dict[str, Any] = {}
    events: Annotated[list[dict[str, Any]], Field(max_length=PORTION)] = []
    is_cut: bool = False  # there are more events than fit into one answer
    resumed: Annotated[list[Number], Field(min_length=3, max_length=3)] | None = None  # as `Resumed` has them
    refused: str = ""  # not served; why, as a sentence
    is_unknown: bool = False  # a command that was not served may have been carried out


def headers() -> dict[str, str] | None:
    """Of a request: the id of the command that it is about, for the logs of both sides."""
    return {TRACE: trace} if (trace := log_context.trace()) else None


def largest(broker_takes: int) -> int:
    """Bytes of the largest body for a broker that takes so many bytes."""
    return min(LARGEST, broker_takes - HEADERS)


def subject(vehicle: str, what: str) -> str:
    return f"veh.{vehicle}.{what}"


def vehicle_of(topic: str) -> str:
    """The vehicle of a subject; only its agent may publish there."""
    return topic.split(".")[1]


def encode(body: Body) -> bytes:
    return orjson.dumps(body.model_dump())


def decode(kind: type[B], data: bytes) -> B:
    """Raises Malformed."""
    if len(data) > LARGEST:
        raise Malformed(f"{len(data)} bytes")
    try:
        return kind.model_validate(orjson.loads(data))
    except (orjson.JSONDecodeError, ValidationError) as error:
        raise Malformed(str(error)[:200]) from None


def fitting(events: list[dict[str, Any]], largest: int = LARGEST) -> list[dict[str, Any]]:
    """As many of the first events as fit into one body. One that alone does not fit is cut to its number and time, so
    that those behind it arrive."""
    size, found = HEAD, []
    for event in events:
        length = len(orjson.dumps(event)) + 1
        if HEAD + length > largest:
            log.error("event_too_large_for_the_broker n=%s bytes=%d", event.get("n"), length)
            event = {name: event[name] for name in ("n", "at_ms", "alarm", "change") if name in event}
            length = len(orjson.dumps(event)) + 1
        if (size := size + length) > largest:
            break
        found.append(event)
    return found


def encode_frame(head: FrameHead, payload: str | bytes = b"") -> bytes:
    return encode(head) + b"\n" + (payload.encode() if isinstance(payload, str) else payload)


class Bases:
    """Texts of the newest frames of a kind, by which others are compressed, by their numbers."""

    def __init__(self, most: int = MOST_BASES) -> None:
        self._most = most
        self._texts: dict[int, bytes] = {}

    def add(self, number: int, text: str) -> None:
        if number not in self._texts:
            self._texts[number] = text.encode()
        while len(self._texts) > self._most:
            del self._texts[next(iter(self._texts))]

    def get(self, number: int) -> bytes:
        """Empty where it is not there."""
        return self._texts.get(number, b"")


def compressed(frame: bytes, base: bytes = b"", level: int = ZLIB_LEVEL) -> bytes:
    """An encoded frame for a node that inflates it, and has `base`: a state has 14 packets, compressed 4, and one where
    it is compressed by another state. Over a radio that loses one in ten, one of 14 is nearly always lost."""
    deflater = zlib.compressobj(level, zdict=base) if base else zlib.compressobj(level)
    return deflater.compress(frame) + deflater.flush()


def decode_frame(data: bytes, base: bytes = b"") -> tuple[FrameHead, str | bytes]:
    """Takes also a compressed one; `base`: the frame that its pull named. Raises Malformed."""
    if data.startswith(ZLIB_BEGIN):
        data = _inflated(data, base)
    line, _, payload = data.partition(b"\n")
    head = decode(FrameHead, line)
    try:
        return head, payload.decode() if head.is_text else payload
    except UnicodeDecodeError as error:
        raise Malformed(str(error)) from None


def _inflated(data: bytes, base: bytes) -> bytes:
    """Raises Malformed, also where it would be larger than a body may be."""
    inflater = zlib.decompressobj(zdict=base) if base else zlib.decompressobj()
    try:
        found = inflater.decompress(data, LARGEST)
    except zlib.error as error:
        raise Malformed(str(error)) from None
    if not inflater.eof:
        raise Malformed(f"compressed, {len(data)} bytes, and not whole within {LARGEST}")
    return found
