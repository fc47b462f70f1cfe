"""Links to a car, simulated: slow, jumpy or healthy, before a bridge with one queue or with one for each topic.

Time goes in steps of 2 ms. What the bridge writes waits in a buffer that the link empties at its own rate, arrives a
delay later, and never overtakes.
"""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from monitor.transport import TransportDelay
from server.vehicle.link_load import LinkLoad

STEP_S = 0.002
PING_EVERY_S = 0.1
PING_BYTES = 30
BUFFER_BYTES = 65_536  # the bridge writes no more while so much waits in its own buffer …
ANSWER_S = 0.003
CALL_EVERY_S, CALL_WITHIN_S, CALL_BYTES = 1.0, 1.5, 110  # of the car's time, once the one before is over


@dataclass(frozen=True, slots=True, kw_only=True)
class Stream:
    """One topic at its source."""

    topic: str
    hz: float
    size: int  # bytes of a message
    offset_s: float | None  # of the clock of its stamps; None: it carries none
    ppm: float = 0.0
    queue_length: int = 2
    signal: str | None = None  # None: it is only recorded
    stamp: Callable[[float], float] | None = None  # of the time, instead

    def stamp_s(self, at_s: float) -> float | None:
        if self.stamp is not None:
            return self.stamp(at_s)
        return None if self.offset_s is None else at_s * (1 + self.ppm * 1e-6) + self.offset_s


@dataclass(slots=True, kw_only=True)
class Link:
    """How a link behaves, by the time."""

    rate_Bps: Callable[[float], float]
    down_s: Callable[[float], float]
    up_s: Callable[[float], float]
    kernel_bytes: int = 100_000  # what the system takes beyond the bridge's own buffer
    is_fifo: bool = False  # the bridge keeps no queue for each topic, and its buffer has no end


@dataclass(slots=True)
class Arrival:
    """One message as it came."""

    topic: str
    at_s: float
    true_s: float  # how old it is
    delay_s: float  # how old the estimate has it
    late_s: float  # how late the estimate has the link


@dataclass(slots=True)
class _Call:
    """One call of the car's time."""

    requested_s: float
    car_s: float = 0.0


@dataclass(slots=True)
class _Queue:
    stream: Stream
    next_s: float
    waiting: deque[float] = field(default_factory=deque)
    held: float | None = None
    length: int = 1
    throttle_s: float = 0.0
    sends_s: float = 0.0  # not before
    is_wanted: bool = True

    def subscribe(self, transport: TransportDelay, load: LinkLoad) -> None:
        """As a session does at this step of its load: what is of no signal is only recorded."""
        stream = self.stream
        self.is_wanted = stream.signal is not None or load.level.records_others
        self.length = 1 if load.step else stream.queue_length
        self.throttle_s = load.throttle_ms(stream.signal) / 1000 if stream.signal is not None else 0.0
        transport.subscribe(stream.topic, self.length, self.throttle_s)

    def is_due(self, now_s: float) -> bool:
        return bool(self.waiting) and self.held is None and now_s >= self.sends_s


def run(
    link: Link,
    streams: list[Stream],
    *,
    lasts_s: float,
    seed: int,
    load: LinkLoad | None = None,
    ros_s: Callable[[float], float] | None = None,
) -> Iterator[Arrival]:
    """What arrives, judged by `TransportDelay`; `load` decides what is subscribed to. `ros_s`: the clock of ROS, by
    the time; None: the bridge has no rosapi."""
    rng = random.Random(seed)
    transport = TransportDelay()
    transport.is_fifo = link.is_fifo
    transport.open(0.0)
    begins_s = link.up_s(0.0)
    queues = [_Queue(stream, begins_s + rng.random() / stream.hz, length=stream.queue_length) for stream in streams]
    for stream in streams:
        transport.subscribe(stream.topic, stream.queue_length)
    buffer: deque[tuple[int, object]] = deque()
    buffered = 0  # bytes, the system's part included
    credit = 0.0
    is_shut = False
    under_way: deque[tuple[float, float | _Call]] = deque()  # (reaches the bridge, a ping's sending or a call)
    coming: deque[tuple[float, object]] = deque()
    next_ping_s = next_call_s = 0.0
    last_up_s = last_down_s = 0.0
    for step in range(int(lasts_s / STEP_S)):
        now_s = step * STEP_S
        if load is not None and step % 50 == 0 and load.look(transport.queued_s(now_s), now_s, transport.trip_s):
            for queue in queues:
                queue.subscribe(transport, load)
        if now_s >= next_ping_s:
            last_up_s = max(last_up_s, now_s + link.up_s(now_s))
            under_way.append((last_up_s + ANSWER_S, now_s))
            transport.sent(now_s)
            next_ping_s = now_s + PING_EVERY_S
        if ros_s is not None and now_s >= next_call_s:
            last_up_s = max(last_up_s, now_s + link.up_s(now_s))
            under_way.append((last_up_s + ANSWER_S, _Call(now_s)))
            next_call_s = now_s + CALL_WITHIN_S + CALL_EVERY_S
        while under_way and under_way[0][0] <= now_s:
            _, request = under_way.popleft()
            if isinstance(request, _Call) and ros_s is not None:
                request.car_s = ros_s(now_s)
            buffer.append((CALL_BYTES if isinstance(request, _Call) else PING_BYTES, request))
            buffered += buffer[-1][0]
        for queue in queues:
            if now_s >= queue.next_s:
                queue.next_s += 1 / queue.stream.hz
                if link.is_fifo:
                    buffer.append((queue.stream.size, (queue.stream, now_s)))
                    buffered += queue.stream.size
                elif queue.is_wanted:
                    queue.waiting.append(now_s)
                    while len(queue.waiting) > queue.length:
                        queue.waiting.popleft()
        if not link.is_fifo:
            if is_shut and buffered <= link.kernel_bytes:
                is_shut = False
            turns = True
            while turns and not is_shut:
                turns = False
                rng.shuffle(queues)
                for queue in queues:
                    if queue.is_due(now_s):
                        queue.held = queue.waiting.popleft()
                        queue.sends_s = now_s + queue.throttle_s
                    if queue.held is not None and not is_shut:
                        buffer.append((queue.stream.size, (queue.stream, queue.held)))
                        buffered += queue.stream.size
                        queue.held = None
                        turns = True
                        is_shut = buffered > link.kernel_bytes + BUFFER_BYTES
            if is_shut:
                for queue in queues:
                    if queue.is_due(now_s):
                        queue.held = queue.waiting.popleft()
                        queue.sends_s = now_s + queue.throttle_s
        credit = min(credit + link.rate_Bps(now_s) * STEP_S, 20_000.0 if not buffer else 1e9)
        while buffer and credit >= buffer[0][0]:
            size, what = buffer.popleft()
            credit -= size
            buffered -= size
            last_down_s = max(last_down_s, now_s + link.down_s(now_s))
            coming.append((last_down_s, what))
        if not buffer:
            credit = min(credit, link.rate_Bps(now_s) * STEP_S)
        while coming and coming[0][0] <= now_s:
            _, what = coming.popleft()
            if isinstance(what, float):
                transport.took(PING_BYTES)
                transport.answered(what, now_s)
                continue
            if isinstance(what, _Call):
                transport.took(CALL_BYTES)
                if now_s - what.requested_s <= CALL_WITHIN_S:
                    transport.clock.answered(what.requested_s, now_s, what.car_s)
                    next_call_s = now_s + CALL_EVERY_S
                continue
            stream, source_s = what  # type: ignore[misc]
            transport.took(stream.size)
            delay_s = transport.receive(stream.topic, now_s, stream.stamp_s(source_s))
            yield Arrival(stream.topic, now_s, now_s - source_s, delay_s, transport.late_s(now_s))
