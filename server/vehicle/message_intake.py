"""Takes each message of a car to the parts that need it: recorder, slow-down, judge, scans."""

from __future__ import annotations

import logging
import math
import re
from collections.abc import Callable, Collection
from typing import Any

from server.bus.bus import SessionBus
from server.judge.frames import is_static
from server.judge.topics import plain_type
from server.judge.transforms import MAX_FRAMES
from server.recording import recorded_topics
from server.recording.controller import SessionRecording
from server.rosbridge.raw_frame import RawFrame
from server.slowdown.command_target import GUARD_STATE
from server.slowdown.controller import SlowDownController
from server.vehicle import car_marks
from server.vehicle.connection import Connection
from server.vehicle.doubtful import ANSWERED_WITHIN_S, Doubtful, Held, may_be_kept
from server.vehicle.judgement import Judgement
from server.vehicle.marks import Marks
from server.vehicle.scan_feed import ScanFeed
from server.vehicle.sent_again import Arrival, SentAgain, is_same
from server.vehicle.tick_parts import TickParts
from server.vehicle.undelivered import CLIENT_COUNT

log = logging.getLogger("catgraph.frames")

TRANSFORM_PERIOD_S = 0.2  # of each frame: where a sensor is changes slowly
TRANSFORM_FRAME_S = 0.004  # with more frames, each comes less often: 500 of them every 2 s
MOST_FRAME_KEY = 120  # bytes

# From the name of this field to that of the next one, in JSON and in CBOR: the same for the same frame. The order of
# the fields is that of their definition; where a bridge has another one, nothing is found.
_CHILD = re.compile(rb"child_frame_id(.{1,%d}?)transform" % MOST_FRAME_KEY, re.DOTALL)

RECORDING = "recording of messages"  # its name where it fails
OF_ANY_NODE = recorded_topics.EVENTS | {"rosbridge_msgs/ConnectedClients", "rosgraph_msgs/Clock"}  # the bridge's too
EACH_COUNTS = (GUARD_STATE, CLIENT_COUNT, car_marks.TOPIC)  # these have their own rules for what is sent again


class TransformPace:
    """Which messages of transforms are parsed, of one car while its link is open: each frame's newest is seen soon.

    A car sends the transforms of wheels and joints fifty times a second, and between them perhaps once a second where
    its laser is. What counts is therefore when each frame was parsed last, which the unparsed text of a message shows.
    Pure: time is an argument, on a monotonic clock in seconds.
    """

    def __init__(self) -> None:
        self._parsed_s: dict[tuple[str, bytes], float] = {}  # by topic and frame
        self._is_binary = False  # as which it came last: a frame looks different then
        self._rest_s: dict[str, float] = {}  # by topic: of messages whose frames are not known, or too many

    def is_due(self, sent: RawFrame, now_s: float, needed: Collection[bytes] = ()) -> bool:
        """Whether a message is to be parsed, because it has a frame that was not parsed for a while. Names of frames
        that hold one of `needed` are kept, whatever else a car sends; of the others, the first ones."""
        if sent.is_binary != self._is_binary:
            self._is_binary = sent.is_binary
            self._parsed_s.clear()
        topic = sent.topic
        frames = {(topic, name) for name in _CHILD.findall(sent.payload)}
        known = self._parsed_s
        period_s = max(TRANSFORM_PERIOD_S, len(known) * TRANSFORM_FRAME_S)
        kept = {
            one for one in frames if one in known or len(known) < MAX_FRAMES or any(name in one[1] for name in needed)
        }
        rest_s = self._rest_s.get(topic, -math.inf)
        oldest_s = min((known.get(one, -math.inf) for one in kept), default=rest_s)
        has_rest = len(kept) < len(frames) or not frames
        if now_s - (min(oldest_s, rest_s) if has_rest else oldest_s) < period_s:
            return False
        if has_rest:
            self._rest_s[topic] = now_s
        for one in kept:
            known.pop(one, None)
            known[one] = now_s  # the newest last
        while len(known) > MAX_FRAMES:
            del known[next(iter(known))]
        return True


class MessageIntake:
    """Of one vehicle. `now` is a monotonic clock in seconds."""

    def __init__(
        self,
        vehicle: str,
        bus: SessionBus,
        judgement: Judgement,
        recording: SessionRecording,
        slow_down: SlowDownController,
        tick_parts: TickParts,
        marks: Marks,
        *,
        now: Callable[[], float],
    ) -> None:
        self._vehicle = vehicle
        self._bus = bus
        self._judgement = judgement
        self._recording = recording
        self._slow_down = slow_down
        self._tick_parts = tick_parts
        self._button = marks.button(now(), read_s=self._read_s)
        self._now = now
        self._connection: Connection | None = None
        self.reset()

    def _read_s(self, sent_s: float) -> float | None:
        return self._judgement.transport.read_s(sent_s)

    def follow(self, connection: Connection) -> None:
        """From now on messages of this connection come; to be called once."""
        self._connection = connection

    def reset(self) -> None:
        """Another car's messages come."""
        self._scans = ScanFeed(self._vehicle, self._bus)
        self._pace = TransformPace()
        self._needed: set[bytes] = set()  # of frames that place a sensor, one in the text of each
        self._sent_again = SentAgain(self._read_s)
        self._doubtful = Doubtful()

    def subscribed(self, topic: str) -> None:
        """A subscription to a topic was sent: what the bridge kept of it may come again."""
        now_s = self._now()
        self._sent_again.subscribed(topic, now_s)
        self._doubtful.subscribed(topic, now_s)

    def link_opened(self) -> None:
        """The car's messages come from the beginning, also those that are sent once."""
        self._judgement.frames.forget()
        self._pace = TransformPace()
        self._recording.release()

    def junk_received(self, why: str) -> None:
        """Something came that is no message."""
        self._judgement.reception.junk(why)
        if why == "binary noise" and self._scans.is_empty and self._connection is not None:
            self._connection.subscriptions.binary_noise()

    def recorded_unreadable(self, topic: str, why: str) -> None:
        """Counts a message that the recorder could not read; its topic is received as JSON from now on."""
        self._judgement.reception.junk(why)
        if self._connection is not None:
            self._connection.subscriptions.unreadable(topic, why)

    def frame_received(self, frame: RawFrame) -> bool:
        """Pass a message that is only recorded to the recorder unparsed, to keep the work off the loop."""
        connection = self._connection
        if connection is None or frame.topic in (GUARD_STATE, CLIENT_COUNT):
            return False
        topics = connection.subscriptions
        is_recorded, is_transforms = frame.topic in topics.others, frame.topic in topics.table.transforms
        if not (is_recorded or is_transforms):
            return False
        now_s, size = self._now(), len(frame.payload)
        if is_transforms and (is_static(frame.topic) or self._is_due(frame, now_s)):
            return False
        arrival = self._arrived(connection, frame.topic, frame, size, now_s)
        if plain_type(topics.others.get(frame.topic, "")) not in OF_ANY_NODE and not (arrival and arrival.is_repeat):
            self._judgement.other_message_s = now_s
        if is_recorded and self._is_to_record(connection, frame.topic, _held(frame, size, now_s, arrival), arrival):
            self._record(connection, frame.topic, frame, now_s, size)
        return True

    def _is_due(self, frame: RawFrame, now_s: float) -> bool:
        """Whether transforms that move are to be parsed."""
        self._judgement.frames.note_needed(self._needed)
        return self._pace.is_due(frame, now_s, self._needed)

    def message_received(self, topic: str, message: Any, note: str | None) -> None:
        """One message of the car: recorded, decoded, applied and judged in the same pass."""
        connection = self._connection
        if connection is None:
            return
        now_s = self._now()
        topics = connection.subscriptions
        size = 0 if connection.link is None else connection.link.frame_bytes
        arrival = self._arrived(connection, topic, message, size, now_s)
        is_button = topic == car_marks.TOPIC and topic not in topics.others
        if is_button and self._button.receive(message, now_s, topics.table.button):
            return  # recorded as a mark
        if topic in topics.table.transforms:
            self._transforms_received(connection, topic, message, arrival, now_s)
            return
        one = _held(message, size, now_s, arrival)
        if connection.link is not None and self._is_to_record(connection, topic, one, arrival):
            self._record(connection, topic, message, now_s, size)
        if is_button or self._slow_down.receive(topic, message) or topics.took(topic, message):
            return
        if topic in topics.others:
            return  # subscribed to be recorded: what is judged must not depend on what is recorded
        if topics.signals.compare(topic, message, now_s):
            topics.map_again()
        sources = topics.by_topic.get(topic)
        if sources is None and topic in topics.signals.watched:
            self._judgement.last_message_s = now_s  # the car sends, though nothing of it can be judged
            connection.prove()
            return
        if sources is None:
            self._judgement.reception.unasked += 1
            return
        connection.prove()
        if arrival is not None and arrival.is_repeat:
            self._judgement.receive_again(sources, topic, message, note, now_s, came_s=arrival.sample.first_s)
            return
        changed = self._judgement.receive(sources, topic, message, note, now_s)
        if "scan" in changed:
            self._show_scan(message, now_s)

    def _transforms_received(
        self, connection: Connection, topic: str, message: Any, arrival: Arrival | None, now_s: float
    ) -> None:
        """Transforms place sensors; each part of a recording begins with those that are sent once."""
        frames = self._judgement.frames
        noted = len(frames.notes)
        frames.receive(topic, message)
        for note in frames.notes[noted:]:
            log.warning("transforms: topic=%s note=%r", topic, note)
        connection.subscriptions.table.needs_moving = frames.needs_moving
        is_repeat = arrival is not None and arrival.is_repeat
        if not is_repeat:
            self._judgement.other_message_s = now_s
        kind = connection.subscriptions.type_of(topic)
        is_in_part = is_repeat and is_static(topic) and self._recording.holds(topic, message)
        if connection.link is not None and not is_in_part:
            size = connection.link.frame_bytes
            if self._is_to_record(connection, topic, _held(message, size, now_s, arrival), arrival):
                self._record(connection, topic, message, now_s, size)
        if is_static(topic):
            self._recording.hold(topic, kind, message)

    def _arrived(self, connection: Connection, topic: str, message: Any, size: int, now_s: float) -> Arrival | None:
        """Follow a topic's messages, and what its bridge sends again of them; None: each message of it counts."""
        if topic in EACH_COUNTS:
            connection.subscriptions.received(topic)
            return None
        arrival = self._sent_again.receive(topic, message, size, now_s)
        if arrival.is_repeat:
            connection.subscriptions.table.given(topic)
            self._judgement.reception.repeats += 1
        else:
            connection.subscriptions.received(topic)
        return arrival

    def _is_to_record(self, connection: Connection, topic: str, one: Held, arrival: Arrival | None) -> bool:
        """Whether a message belongs into the recording: each one once in a part."""
        part = self._recording.part
        if part is None or arrival is None:
            return part is not None
        sample = arrival.sample
        if arrival.is_repeat and sample.part == part and not arrival.may_be_new:
            if arrival.is_doubtful:
                self._doubt(connection, topic, one, arrival)
            return False
        if arrival.is_repeat and sample.part != part:
            self._judgement.transport.given(topic, one.at_s - sample.first_s)
        self._record_late(connection, topic, *self._doubtful.came_new(topic, one, is_same))
        if not arrival.is_repeat:
            self._judgement.transport.is_new(topic)
        sample.part = part
        return True

    def _doubt(self, connection: Connection, topic: str, one: Held, arrival: Arrival) -> None:
        """Another subscription shows whether a message was published now, or is what its publisher keeps."""
        within_s = ANSWERED_WITHIN_S + self._judgement.transport.answer_s(one.at_s)
        verdict = self._doubtful.came(
            topic, one, may_be_kept=may_be_kept(arrival.period_s, arrival.silent_s, within_s), within_s=within_s
        )
        self._record_late(connection, topic, *verdict.record)
        if verdict.probes:
            self._probe(connection, topic)

    def _probe(self, connection: Connection, topic: str) -> None:
        if not connection.subscriptions.table.probe(topic):
            self._record_late(connection, topic, *self._doubtful.settled(topic))

    def tick(self, now_s: float) -> None:
        """Records what was in doubt and is not any more."""
        connection = self._connection
        if connection is None:
            return
        is_heard = connection.bridge_answers(now_s)
        for topic in self._doubtful.to_probe(now_s) if is_heard else ():
            self._probe(connection, topic)
        for topic, held in self._doubtful.overdue(now_s, is_heard=is_heard):
            self._record_late(connection, topic, *held)
            if not held:
                self._sent_again.is_kept(topic)

    def settle(self) -> None:
        """A part of the recording ends: what is in doubt belongs into it."""
        if self._connection is not None:
            for topic, one in self._doubtful.all():
                self._record_late(self._connection, topic, one)

    def _record_late(self, connection: Connection, topic: str, *held: Held) -> None:
        """Records messages that were in doubt, as old as their age is shown: only something new makes it anew."""
        now_s = self._now()
        for one in held:
            self._judgement.transport.given(topic, now_s - one.first_s)
            self._record(connection, topic, one.message, now_s, one.size)

    def _show_scan(self, message: Any, now_s: float) -> None:
        self._scans.count()
        if self._scans.is_due(now_s):
            monitor = self._judgement.monitor
            self._scans.put(
                self._judgement.state.snapshot(now_s),
                monitor.limits.obstacle,
                was_active="obstacle" in monitor.alarms and monitor.alarms["obstacle"].active,
                kinds_kept=not isinstance(message["ranges"], list),
            )

    def _record(self, connection: Connection, topic: str, message: Any, now_s: float, size: int) -> None:
        """A recording that fails must not keep the message from being judged."""

        def take() -> None:
            topics = connection.subscriptions
            self._recording.ros_version = topics.ros_version  # a part begins with its first message
            self._recording.take(topic, topics.type_of(topic), message, now_s, size)

        self._tick_parts.attempt(RECORDING, take)


def _held(message: Any, size: int, now_s: float, arrival: Arrival | None) -> Held:
    return Held(message, size, now_s, now_s if arrival is None else arrival.sample.first_s)
