"""The car's own button marks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from monitor.alarm import Refused
from server.rosbridge_server.rosapi import ROSAPI_NODE
from server.rosbridge_server.server import RosBridge
from server.vehicle.car_marks import AGAIN, OLDER, RATE, TOPIC, ButtonSubscription, CarMarks, unfit
from tests.server.marks.marked_drive import marked_drive

HOSTILE = "<b>\x1b[2Jdoor\u202e" + "x" * 5000


class Button:
    """One that keeps its marks and notes, and whose bridge reads all it is sent after `late_s`."""

    def __init__(self, *known: str, late_s: float = 0.0, now_s: float = 0.0) -> None:
        self.known = set(known)
        self.marks: list[tuple[str, str]] = []
        self.notes: list[str] = []
        self.now_s = now_s
        self._marks = CarMarks(
            self._place,
            self.notes.append,
            is_known=lambda text: text.strip() in self.known,
            read_s=lambda sent_s: sent_s + late_s if self.now_s >= sent_s + late_s else None,
            now_s=now_s,
        )

    def _place(self, id: str, text: str, suffix: str) -> None:
        self.known.add(text.strip())
        self.marks.append((text, suffix))

    def gives(self, at_s: float, message: Any, subscription: ButtonSubscription | None = None) -> bool:
        """Whether it marked."""
        self.now_s = at_s
        return self._marks.receive(message, at_s, subscription)


def made(messages: list[tuple[float, Any]]) -> tuple[list[str], list[str]]:
    """The texts of the marks, and what was noted."""
    button = Button()
    given = [button.gives(at_s, message) for at_s, message in messages]
    assert sum(given) == len(button.marks), "what is no mark is to be recorded as a message"
    return [text for text, _ in button.marks], button.notes


@pytest.mark.parametrize(
    ("messages", "texts"),
    [
        ([(0.0, {}), (0.2, {}), (0.45, {}), (1.0, {})], ["", ""]),
        ([(0.0, {"data": "a"}), (0.1, {"data": "b"}), (0.2, {"data": "b"}), (0.6, {"data": "b"})], ["a", "b", "b"]),
        ([(0.0, {"data": True}), (0.1, {"data": False}), (0.2, {"data": True}), (0.3, {"data": True})], ["", ""]),
        ([(0.0, {"data": False}), (1.0, {"data": 7}), (2.0, None)], ["", ""]),
    ],
    ids=["empty", "string", "bool", "odd"],
)
def test_each_press_is_one_mark(messages: list[tuple[float, Any]], texts: list[str]) -> None:
    assert made(messages)[0] == texts


def test_a_car_that_never_stops_is_told_once() -> None:
    texts, notes = made([(n * 0.001, {"data": str(n)}) for n in range(1000)])
    assert RATE.at_once <= len(texts) <= RATE.at_once + RATE.per_s + 1
    assert 1 <= len(notes) <= 2
    assert notes[0] == f"Marks of the car are not kept: more than one message a second came on {TOPIC}."


def test_a_drive_that_is_full_is_told_once() -> None:
    def full(id: str, text: str, suffix: str) -> None:
        raise Refused("This drive has 2000 marks.")

    notes: list[str] = []
    button = CarMarks(full, notes.append, is_known=lambda text: False, read_s=lambda _: None, now_s=0.0)
    for n in range(5):
        assert not button.receive({"data": str(n)}, float(n), None)
    assert notes == ["Marks of the car are not kept: This drive has 2000 marks."]


def test_fifty_presses_in_five_seconds_are_fifty_marks() -> None:
    texts, notes = made([(n * 0.1, {"data": str(n)}) for n in range(50)])
    assert (len(texts), notes) == (50, [])


@pytest.mark.parametrize("message", [{"data": "door"}, {"data": True}, {}], ids=["string", "bool", "empty"])
def test_what_a_bridge_gives_again_is_not_marked_again(message: dict[str, Any]) -> None:
    """Each connection gives a latched message again; a press after that counts, even with the same text."""
    text = message["data"] if isinstance(message.get("data"), str) else ""
    button = Button(text)
    for subscription in (ButtonSubscription(10.0), ButtonSubscription(20.0)):
        assert not button.gives(subscription.at_s + 0.4, message, subscription)
        assert button.gives(subscription.at_s + 0.8, message, subscription)
        assert button.gives(subscription.at_s + 5.0, message, subscription)
    assert button.marks == [(text, "")] * 4
    named = ' Its text: "door".' if text else ""
    note = f"A message on {TOPIC} that came just after subscribing is not marked.{AGAIN}{named}"
    assert button.notes == [note] * 2, "whether it is the press before is not known"


def test_several_latched_messages_are_one_burst() -> None:
    """A publisher that keeps the last ten gives them all."""
    button = Button("", "a", "b")
    for subscription in (ButtonSubscription(10.0), ButtonSubscription(20.0)):
        for n, data in enumerate([False, True, False, True, "a", "b", True, "a"]):
            assert not button.gives(subscription.at_s + 0.4 + n * 0.03, {"data": data}, subscription)
    assert (button.marks, len(button.notes)) == ([], 2)


def test_a_first_press_long_after_the_connection_counts() -> None:
    button = Button("a")
    assert button.gives(12.5, {"data": "a"}, ButtonSubscription(10.0))
    assert button.marks == [("a", "")]


def test_a_first_message_that_comes_with_the_connection_marks_and_says_so() -> None:
    button = Button()
    for at_s, text in ((10.5, "a"), (10.7, "b"), (11.0, "c")):
        assert button.gives(at_s, {"data": text}, ButtonSubscription(10.0))
    assert button.marks == [("a", OLDER), ("b", OLDER), ("c", "")]


def test_what_comes_after_a_renewal_was_not_given_before() -> None:
    """A subscription that the bridge refused, as the topic had no publisher, is renewed again and again."""
    button = Button("")
    assert button.gives(15.5, {}, ButtonSubscription(15.0, is_renewal=True))
    assert button.gives(16.5, {}, ButtonSubscription(15.0, is_renewal=True))
    assert button.marks == [("", OLDER), ("", "")]


@pytest.mark.parametrize("at_s", [13.1, 15.0], ids=["unread", "read"])
def test_a_late_link_does_not_mark_again(at_s: float) -> None:
    """The time counts from when the bridge has read the subscription."""
    assert not Button("a", late_s=3.5).gives(at_s, {"data": "a"}, ButtonSubscription(10.0))


def test_words_that_differ_by_blanks_are_told_once() -> None:
    button = Button("a")
    for n in range(2000):
        button.gives(10.0 + n * 0.0001, {"data": "a" + n * " "}, ButtonSubscription(9.9))
    assert (button.marks, len(button.notes)) == ([], 1)


def test_hostile_words_are_told_short_and_clean() -> None:
    button = Button(HOSTILE)
    assert not button.gives(10.1, {"data": HOSTILE}, ButtonSubscription(10.0))
    assert '"<b> [2Jdoorxx' in button.notes[0]
    assert len(button.notes[0]) < 300
    assert button.notes[0].isprintable()


@pytest.mark.parametrize("type", ["std_msgs/Int32", "std_msgs/msg/Header"])
def test_a_topic_of_another_type_is_told(type: str) -> None:
    assert str(unfit(type)).startswith(f"{TOPIC} does not mark: it is {type}, ")


@pytest.mark.parametrize("type", [None, "", "std_msgs/Bool", "std_msgs/msg/Empty"], ids=["none", "no", "1", "2"])
def test_a_topic_that_can_be_read_needs_no_word(type: str | None) -> None:
    assert unfit(type) is None


@pytest.mark.slow
async def test_one_that_cannot_mark_is_recorded_and_told(bridge: RosBridge, tmp_path: Path) -> None:
    bridge.advertise(TOPIC, "std_msgs/Int32")
    async with marked_drive(bridge, tmp_path) as drive:

        async def logged() -> Any:
            bridge.publish(TOPIC, {"data": 7})
            events = (await drive.get("/api/log?limit=50"))["events"]
            return [event for event in events if "does not mark" in event["text"]]

        assert len(await drive.until(logged)) == 1

        async def recorded() -> Any:
            bridge.publish(TOPIC, {"data": 7})
            signals = await drive.get("/api/signals")
            return [row for row in signals["topics"] if row["topic"] == TOPIC]

        assert await drive.until(recorded)
        assert (await drive.get("/api/marks"))["marks"] == []


@pytest.mark.slow
async def test_a_message_on_the_topic_is_a_mark_of_the_drive(bridge: RosBridge, tmp_path: Path) -> None:
    bridge.advertise(TOPIC, "std_msgs/String")
    async with marked_drive(bridge, tmp_path) as drive:

        async def marked() -> Any:
            bridge.publish(TOPIC, {"data": HOSTILE})
            return (await drive.get("/api/marks"))["marks"]

        rows = await drive.until(marked)
        assert rows[0]["source"] == "car"
        assert rows[0]["by"] is None
        assert rows[0]["words"].startswith("<b> [2Jdoorxx")
        assert 1990 < len(rows[0]["words"]) <= 2000
        assert (await drive.get("/api/state"))["recording"].get("left_out_count", 0) == 0


@pytest.mark.slow
async def test_it_marks_without_rosapi_too(bridge: RosBridge, tmp_path: Path) -> None:
    bridge.end_node(ROSAPI_NODE)
    bridge.advertise(TOPIC, "std_msgs/String")
    async with marked_drive(bridge, tmp_path) as drive:

        async def marked() -> Any:
            bridge.publish(TOPIC, {"data": "door"})
            return (await drive.get("/api/marks"))["marks"]

        assert (await drive.until(marked))[0]["words"] == "door"
