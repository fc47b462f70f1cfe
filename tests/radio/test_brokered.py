"""The radio between a car's agent and its broker: what pages of a web node show, and what becomes of their orders."""

from __future__ import annotations

import asyncio
import random
import time
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from tests.radio.__main__ import shown
from tests.radio.rig import IS_POSSIBLE, WHY_NOT, brokered, on_air, page
from tests.radio.seen import Seen
from tests.radio.senders import carried_out, senders

pytestmark = [pytest.mark.skipif(not IS_POSSIBLE, reason=WHY_NOT), pytest.mark.timeout(900)]

FRESH_S = 1.0  # no older value is drawn as fresh
READ_S = 0.05  # of two clocks
LIVE_S = 2.0  # behind a gap values are uncovered, but for one in ten, where idle connections were dialled meanwhile
DIALLED_S = 20.0
BACK_WITHIN_S = 120.0  # on a busy machine; how soon it is, is printed
RADIOS = ("fair", "weak", "bad")
Note = Callable[[str, object], None]


async def live(seen: Seen, from_ms: float) -> float:
    """From then until the page shows values, once it does [s]."""
    async with asyncio.timeout(BACK_WITHIN_S):
        while seen.live_s(from_ms) == float("inf"):
            await asyncio.sleep(0.05)
    return seen.live_s(from_ms)


@pytest.mark.field
@pytest.mark.parametrize(
    ("lasts_s", "gaps", "gap_s", "apart_s"),
    [
        pytest.param(10.0, 1, 8.0, 2.0),
        # Over bad another connection takes some 6 s: behind gaps in a quick row there is no idle one.
        *(
            pytest.param(60.0, 10, 30.0, apart_s, marks=[pytest.mark.soak, pytest.mark.timeout(3000)])
            for apart_s in (2.0, 20.0)
        ),
    ],
)
async def test_no_old_value_is_drawn_as_fresh_before_and_after_gaps(
    lasts_s: float, gaps: int, gap_s: float, apart_s: float, tmp_path: Path, record_property: Note
) -> None:
    async with (
        on_air(3, "clean") as air,
        brokered(air, tmp_path) as host,
        page(air, host, "", end=0, of="ocelot") as seen,
    ):
        for radio in RADIOS:
            began_ms = await air.shape(radio)
            await asyncio.sleep(lasts_s)
            live_s = []
            for _ in range(gaps):
                await air.shape("off")
                await asyncio.sleep(gap_s)
                assert seen.samples[-1][1], "the values are covered"
                back_ms = await air.shape(radio)
                live_s.append(await live(seen, back_ms))
                await asyncio.sleep(apart_s)
            then = seen.between(began_ms, time.time() * 1000)
            row = f"{then.row()}  fresh ≤ {then.oldest_fresh_s:.2f} s  live {shown(live_s)} s after a gap"
            print(radio, row)
            record_property(radio, row)
            assert then.frames, radio
            assert then.fresh or radio == "bad", radio
            assert then.oldest_fresh_s <= FRESH_S + READ_S, (radio, row)
            if apart_s >= DIALLED_S:
                assert sorted(live_s)[-2] <= LIVE_S, (radio, live_s)


WITHIN_S = {"take_over": 0.5, "pause": 0.5, "arm": 0.5, "slow_down": 0.5, "resume": 3.0}  # a resume only ends a pause
SENDERS = 20
PRESSED_WITHIN_MS = 500
STRAGGLES_S = 12.0  # TCP repeats what is under way after that at the latest
KNOWN_WITHIN_S = 70.0  # on a busy machine; how soon it is, is printed


@pytest.mark.field
@pytest.mark.parametrize(
    "orders", [pytest.param(60), pytest.param(1000, marks=[pytest.mark.soak, pytest.mark.timeout(5400)])]
)
async def test_of_orders_that_the_radio_holds_up_none_acts_late_and_each_sender_knows_its_outcome(
    orders: int, tmp_path: Path, record_property: Note
) -> None:
    chance = random.Random(38)
    async with (
        on_air(4, "clean") as air,
        brokered(air, tmp_path) as host,
        page(air, host, "", end=0, of="ocelot") as seen,
        senders(air, host, SENDERS) as pages,
    ):
        while not carried_out(tmp_path / "agent.log"):  # without a radio orders are; on a busy machine some are late
            await pages.give(2000, "take_over")
            await pages.known(KNOWN_WITHIN_S)
        before = len(pages.orders)
        for n in range(orders // SENDERS):
            await live(seen, await air.shape(radio := RADIOS[n % len(RADIOS)]))
            await pages.give(PRESSED_WITHIN_MS, *WITHIN_S)
            await asyncio.sleep(PRESSED_WITHIN_MS / 2000)  # some are on their way, and others not sent yet
            await air.shape("off")
            await asyncio.sleep(0.5 * 20 ** chance.random())  # half of them below 2.3 s: the connection survives
            await air.shape(radio)
            await pages.known(KNOWN_WITHIN_S)
        await air.shape("clean")
        await asyncio.sleep(STRAGGLES_S)
        done = carried_out(tmp_path / "agent.log")
    given = pages.orders[before:]
    late = [(done[one.id] - one.pressed_ms) / 1000 - WITHIN_S[one.what] for one in given if one.id in done]
    row = (
        f"{len(given)} orders, {len(late)} carried out, {max(late, default=0.0):+.2f} s after its deadline; answered "
        f"{counted(one.answer for one in given)}, known in the end {counted(one.final for one in given)}, "
        f"after {max(one.known_ms - one.pressed_ms for one in given) / 1000:.1f} s at most"
    )
    print(row)
    record_property("orders", row)
    assert len(given) == orders
    assert max(late, default=-1.0) <= READ_S, row
    assert [one for one in given if (one.id in done) != (one.final in ("done", "done_late"))] == []
    assert [one for one in given if one.final == "not_known"] == []
    assert {one.answer for one in given} & {"unknown", "refused"}, "some were under way when the radio was lost"


def counted(of: Iterable[str]) -> str:
    return ", ".join(f"{number} {name}" for name, number in Counter(of).most_common())
