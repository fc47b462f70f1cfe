"""What a bridge may refuse is sent a few at a time."""

from __future__ import annotations

import asyncio
import time
from typing import Any

import pytest

from server.rosbridge.sent_rows import AT_ONCE, PAUSE_S, Paced, SentRows
from server.rosbridge.subscription import Subscription

pytestmark = pytest.mark.virtual_time

MOST_AT_ONCE = 16  # of rosbridge-server-rs, which closes the connection then


async def test_a_few_at_a_time_and_each_once_in_order() -> None:
    sent: list[tuple[str, bool]] = []
    times_s: list[float] = []

    def send(topic: str, is_renewed: bool) -> None:
        sent.append((topic, is_renewed))
        times_s.append(time.monotonic())

    paced = Paced(send)
    topics = [str(n) for n in range(3 * AT_ONCE)]
    for topic in (*topics, topics[-1]):
        paced.put(topic)
    assert len(sent) == AT_ONCE < MOST_AT_ONCE
    paced.take_back(topics[-1])
    paced.put("again", is_renewed=True)
    async with asyncio.timeout(5.0):
        while len(sent) < len(topics):
            await asyncio.sleep(0.005)
    assert sent == [*((topic, False) for topic in topics[:-1]), ("again", True)]
    waits_s = [at_s - times_s[0] for at_s in times_s]
    assert waits_s == pytest.approx([n // AT_ONCE * PAUSE_S for n in range(len(topics))], abs=0.001)
    paced.put("later")
    async with asyncio.timeout(5.0):
        while len(sent) == len(topics):
            await asyncio.sleep(0.005)


async def test_what_waits_ends_with_the_connection() -> None:
    sent: list[str] = []
    paced = Paced(lambda topic, is_renewed: sent.append(topic))
    for topic in "abcdefgh":
        paced.put(topic)
    before = len(sent)
    paced.clear()
    paced.put("z")
    async with asyncio.timeout(5.0):
        while "z" not in sent:
            await asyncio.sleep(0.005)
    assert sent[before:] == ["z"]


class Table:
    """One whose bridge is always there; what it is sent, and a full pace, so that what follows waits."""

    def __init__(self) -> None:
        self.sent: list[str] = []
        self.rows = SentRows(self._send, lambda: True, None)

    def _send(self, operation: dict[str, Any]) -> None:
        self.sent.append(f"{operation['op']} {operation['topic']} {operation.get('throttle_rate', '')}".strip())

    def fill(self) -> None:
        """All that may be sent now is sent."""
        for n in range(AT_ONCE):
            self.rows.subscribe(Subscription(topic=f"/fill{n}", type=None))

    async def of(self, topic: str, count: int) -> list[str]:
        """What was sent of a topic, once it is so much and the row behind it was sent too."""
        self.rows.subscribe(Subscription(topic="/last", type=None))
        async with asyncio.timeout(5.0):
            while "subscribe /last 0" not in self.sent:
                await asyncio.sleep(0.005)
        found = [one for one in self.sent if f" {topic} " in f"{one} "]
        assert len(found) == count, found
        return found


ANY = Subscription(topic="/any", type=None)
SLOWER = Subscription(topic="/any", type=None, throttle_ms=50)
TYPED = Subscription(topic="/any", type="a/B")


@pytest.mark.parametrize(
    ("after", "sent"),
    [(None, ["unsubscribe /any"]), (TYPED, ["unsubscribe /any", "subscribe /any 0"])],
    ids=["unsubscribed", "other-type"],
)
async def test_a_row_that_lives_is_ended_though_a_change_of_it_waits(
    after: Subscription | None, sent: list[str]
) -> None:
    table = Table()
    table.rows.subscribe(ANY)
    table.fill()
    table.rows.subscribe(SLOWER)
    if after is None:
        table.rows.unsubscribe("/any")
    else:
        table.rows.subscribe(after)
    assert await table.of("/any", 1 + len(sent)) == ["subscribe /any 0", *sent]


async def test_a_row_that_was_never_sent_is_not_ended() -> None:
    """Neither one that only waited, nor one of the connection before."""
    table = Table()
    table.fill()
    for is_renewed in (False, True):
        table.rows.subscribe(ANY)
        if is_renewed:
            table.rows.renew("/any")
        table.rows.unsubscribe("/any")
    table.rows.opened()
    table.rows.unsubscribe("/fill3")
    table.rows.closed()
    table.rows.unsubscribe("/fill2")
    assert await table.of("/any", 0) == []
    assert not any(one.startswith("unsubscribe") and "/fill2" in one for one in table.sent)


async def test_a_change_does_not_undo_a_renewal_that_waits() -> None:
    table = Table()
    table.rows.subscribe(ANY)
    table.fill()
    table.rows.renew("/any")
    table.rows.subscribe(SLOWER)
    assert await table.of("/any", 3) == ["subscribe /any 0", "unsubscribe /any", "subscribe /any 50"]


async def test_a_subscription_made_once_more_has_no_end_between() -> None:
    table = Table()
    table.rows.subscribe(ANY)
    table.fill()
    table.rows.again("/any")
    assert await table.of("/any", 2) == ["subscribe /any 0", "subscribe /any 0"]
    table.rows.closed()
    table.rows.again("/none")


async def test_a_change_alone_is_no_renewal() -> None:
    table = Table()
    table.rows.subscribe(ANY)
    table.fill()
    table.rows.subscribe(SLOWER)
    assert await table.of("/any", 2) == ["subscribe /any 0", "subscribe /any 50"]
