"""What waits for a slow client: bounded, in order, counted."""

from __future__ import annotations

from server.rosbridge_server.outbox import Counters, Lane, Outbox


class Line:
    """A wire that takes frames while it is open."""

    def __init__(self, room: int = 10**9) -> None:
        self.room = room
        self.written: list[bytes] = []

    @property
    def is_ready(self) -> bool:
        return self.room > 0

    def write(self, frame: bytes) -> None:
        self.room -= 1
        self.written.append(frame)


def outbox(room: int, limit_bytes: int = 1_000) -> tuple[Outbox, Line, Counters]:
    line, counters = Line(room), Counters()
    return Outbox(line, counters, limit_bytes=limit_bytes), line, counters


def test_what_can_go_goes_at_once() -> None:
    box, line, counters = outbox(room=2)
    box.send(Lane(1), b"a")
    box.send(Lane(1), b"b")
    assert line.written == [b"a", b"b"]
    assert (counters.sent, counters.dropped, counters.bytes_sent, box.is_empty) == (2, 0, 2, True)


def test_a_full_wire_queues_in_the_order_of_arrival() -> None:
    box, line, _ = outbox(room=0)
    fast, slow = Lane(0), Lane(0)
    for frame, lane in ((b"1", fast), (b"2", slow), (b"3", fast), (b"4", fast), (b"5", slow)):
        box.send(lane, frame)
    line.room = 3
    box.flush()
    assert line.written == [b"1", b"2", b"3"]
    line.room = 9
    box.flush()
    assert line.written == [b"1", b"2", b"3", b"4", b"5"]
    assert box.is_empty


def test_newcomers_do_not_overtake_what_waits() -> None:
    box, line, _ = outbox(room=0)
    lane = Lane(0)
    box.send(lane, b"old")
    line.room = 1  # room again, but nobody has flushed yet
    box.send(lane, b"new")
    assert line.written == []
    line.room = 9
    box.flush()
    assert line.written == [b"old", b"new"]


def test_a_lane_keeps_the_newest_of_its_length() -> None:
    box, line, counters = outbox(room=0)
    short, long = Lane(2), Lane(0)
    box.send(long, b"keep")
    for number in range(5):
        box.send(short, b"%d" % number)
    assert counters.dropped == 3
    line.room = 9
    box.flush()
    assert line.written == [b"keep", b"3", b"4"]


def test_the_byte_limit_drops_the_oldest_of_all() -> None:
    box, line, counters = outbox(room=0, limit_bytes=10)
    first, second = Lane(0), Lane(0)
    for frame, lane in ((b"aaaa", first), (b"bbbb", second), (b"cccc", first), (b"dddd", second)):
        box.send(lane, frame)
    assert counters.dropped == 2
    line.room = 9
    box.flush()
    assert line.written == [b"cccc", b"dddd"]


def test_a_frame_beyond_the_limit_is_dropped_whole() -> None:
    box, line, counters = outbox(room=0, limit_bytes=10)
    box.send(Lane(0), b"x" * 11)
    assert (counters.dropped, box.is_empty) == (1, True)
    line.room = 9
    box.flush()
    assert line.written == []


def test_answers_go_before_messages_and_are_never_dropped() -> None:
    box, line, counters = outbox(room=0, limit_bytes=4)
    gone: list[bool] = []
    box.on_replies_gone = lambda: gone.append(True)
    box.send(Lane(1), b"m")
    for _ in range(9):
        box.reply(b"answer")
    assert box.reply_bytes == 54
    line.room = 99
    box.flush()
    assert line.written == [b"answer"] * 9 + [b"m"]
    assert (box.reply_bytes, counters.dropped, gone) == (0, 0, [True])


def test_an_ended_subscription_takes_its_frames_along_without_loss() -> None:
    box, line, counters = outbox(room=0)
    lane, other = Lane(0), Lane(0)
    box.send(lane, b"a")
    box.send(other, b"b")
    box.forget(lane)
    line.room = 9
    box.flush()
    assert (line.written, counters.dropped) == ([b"b"], 0)


def test_what_waited_for_a_client_that_left_is_counted() -> None:
    box, _, counters = outbox(room=0)
    box.send(Lane(0), b"a")
    box.send(Lane(0), b"b")
    box.close()
    assert (counters.dropped, box.is_empty) == (2, True)
    box.send(Lane(0), b"c")
    box.reply(b"answer")
    assert (counters.dropped, box.is_empty, box.reply_bytes) == (2, True, 0)
