"""The topic of the car's button: how it is subscribed to, and that what is no mark of it is recorded."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

from server.rosbridge.sent_rows import SentRows
from server.vehicle.car_marks import TOPIC, ButtonSubscription, CarMarks
from server.vehicle.delivery import Delivery
from server.vehicle.message_intake import MessageIntake
from server.vehicle.subscription_table import BY_NAME_AGAIN_S, SubscriptionTable
from server.vehicle.tick_parts import TickParts
from server.vehicle.type_definitions import TypeDefinitions


class Rows(SentRows):
    """A link that is not open."""

    def __init__(self) -> None:
        super().__init__(lambda _: None, lambda: False, None)

    @property
    def subscriptions(self) -> tuple[Any, ...]:
        return tuple(self.table.values())


class Topics:
    """The table of one car, and when it is."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.delivery = Delivery()
        definitions = TypeDefinitions(lambda _: None, lambda: None)
        self.table = SubscriptionTable(cast("Any", Rows()), definitions, self.delivery, now=lambda: self.now_s)

    def opened(self) -> None:
        self.delivery.opened(self.now_s)
        self.table.opened()


def test_where_a_second_subscription_is_not_possible_none_is_expected_to_be_answered() -> None:
    topics = Topics()
    topics.opened()
    topics.table.subscribe_by_name({})
    rows = cast("Any", topics.table._link)
    topics.now_s += 10.0
    assert topics.table.probe(TOPIC)
    assert topics.table.button == ButtonSubscription(110.0, is_renewal=True)
    rows.again = lambda topic: False
    topics.now_s += 10.0
    assert not topics.table.probe(TOPIC)
    assert topics.table.button == ButtonSubscription(110.0, is_renewal=True)


def test_a_quiet_row_that_is_renewed_is_no_first_subscription() -> None:
    """Without rosapi: what comes after a renewal was never given on this connection."""
    topics = Topics()
    topics.opened()
    topics.table.subscribe_by_name({})
    assert topics.table.button == ButtonSubscription(100.0)
    for _ in range(3):
        topics.now_s += 8 * BY_NAME_AGAIN_S
        topics.table.renew_by_name()
        assert topics.table.button == ButtonSubscription(topics.now_s, is_renewal=True), (
            "a publisher that came late is found"
        )
    topics.delivery.received(TOPIC, topics.now_s)
    found = topics.table.button
    topics.now_s += 100.0
    topics.table.renew_by_name()
    topics.table.subscribe_by_name({})
    assert topics.table.button == found, "it has come: nothing is renewed"
    topics.table.renew_all()
    assert topics.table.button == ButtonSubscription(topics.now_s)
    topics.now_s += 1.0
    topics.opened()
    assert topics.table.button == ButtonSubscription(topics.now_s)
    topics.now_s += 1.0
    topics.table.subscribe({}, {TOPIC: "std_msgs/Bool"}, needs_client_count=False)
    assert topics.table.button == ButtonSubscription(topics.now_s), (
        "of another type: the bridge gives what is latched again"
    )


def test_what_is_no_mark_is_recorded_as_a_message() -> None:
    """Released, bounced, given again or refused: nothing that came is lost, and none of it was unasked."""
    marks: list[str] = []
    recorded: list[Any] = []
    reception, transport = SimpleNamespace(unasked=0), SimpleNamespace(read_s=lambda sent_s: sent_s)

    def button(now_s: float, *, read_s: Any) -> CarMarks:
        def place(id: str, text: str, suffix: str) -> None:
            marks.append(text)

        return CarMarks(place, lambda _: None, is_known=lambda _: True, read_s=read_s, now_s=now_s)

    table = SimpleNamespace(button=ButtonSubscription(10.0), transforms=frozenset())
    now_s = [10.1]
    intake = MessageIntake(
        "car",
        cast("Any", None),
        cast("Any", SimpleNamespace(reception=reception, transport=transport)),
        cast("Any", SimpleNamespace(part="1", take=lambda topic, type, message, *_: recorded.append(message))),
        cast("Any", None),
        TickParts("car"),
        cast("Any", SimpleNamespace(button=button)),
        now=lambda: now_s[0],
    )
    subscriptions = SimpleNamespace(
        table=table, others={}, by_topic={}, received=lambda _: None, type_of=lambda _: None, ros_version=1
    )
    link = SimpleNamespace(frame_bytes=20)
    intake.follow(cast("Any", SimpleNamespace(subscriptions=subscriptions, link=link)))
    came = [(10.1, True), (11.0, True), (11.2, True), (12.0, False), (13.0, True)]
    for at_s, is_pressed in came:
        now_s[0] = at_s
        intake.message_received(TOPIC, {"data": is_pressed}, None)
    assert (len(marks), [one["data"] for one in recorded]) == (2, [True, True, False])
    assert reception.unasked == 0
