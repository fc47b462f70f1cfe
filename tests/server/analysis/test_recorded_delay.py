"""A recording keeps the delay of its link: judged again, a drive over a slow link raises what the session raised."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from server.analysis.rehearse import rehearse
from server.app.config import Config
from server.judge.drive import Drive
from server.judge.offline import OfflineRun
from server.recording.delay import MOST_S, DelayWriter, LinkDelay, RecordedDelay, recorded_delay
from server.recording.event_channels import read_recorded_events
from server.recording.read.read import open_recording
from server.rosbridge_server.server import RosBridge
from server.vehicle.vehicle import Vehicle
from tests.server.cars import driving
from tests.server.conftest import serving
from tests.server.slow_proxy import slow_proxy
from tests.server.viewer import viewer

pytestmark = pytest.mark.world(n=6)

TICK_S = 0.1 + 0.03  # with what a loop may be late: the two have their ticks at other moments


class Rows:
    """A recording with nothing but rows on the channel of delays."""

    start_s = 100.0

    def __init__(self, rows: list[tuple[float, Any]]) -> None:
        self._rows = rows

    def own(self, topic: str) -> Any:
        assert topic == "/catgraph/delay"
        return ((self.start_s + at_s, row) for at_s, row in self._rows)


def delay_of(rows: list[tuple[float, Any]]) -> RecordedDelay:
    recording: Any = Rows(rows)
    return RecordedDelay(recording)


@pytest.mark.field
async def test_a_session_over_a_slow_link_is_judged_again_as_it_was(bridge: RosBridge, tmp_path: Path) -> None:
    port = int(bridge.address.rpartition(":")[2].strip("/"))  # type: ignore[attr-defined]
    async with slow_proxy(port, None) as proxy:
        config = Config(vehicles=(Vehicle(name="car", address=f"127.0.0.1:{proxy.port}"),), data=tmp_path)
        async with (
            serving(config) as base,
            viewer(base) as page,
            driving(bridge, speed=lambda _: 4.0, scans=True),
        ):
            await page.state(lambda s: s["recording"]["messages"] > 50, within_s=20.0)
            proxy.rate_Bps = 2_000.0

            def stands(alarm_id: str) -> Any:
                return lambda s: any(alarm["id"] == alarm_id for alarm in s["alarms"])

            await page.state(stands("link_late_moving"), within_s=40.0)
            proxy.rate_Bps = None
            await page.state(lambda s: not stands("link_late_moving")(s) or s["link"]["late_s"] < 0.5, within_s=20.0)
            await asyncio.sleep(0.3)  # some rows more of a link that is in time
            assert (await page.ask(kind="disconnect"))["ok"]
            await page.state(lambda s: s["recording"]["state"] == "off", within_s=20.0)
    (path,) = (tmp_path / "recordings").rglob("*.mcap")
    with open_recording([path]) as recording:
        raised = {
            event["alarm"]: event["at_ms"] / 1000 - recording.start_s
            for _, event in recording.own("/catgraph/alarms")
            if event["change"] == "raised"
        }
        again = {one.alarm_id: one.at_s for one in rehearse(recording).transitions if one.change == "raised"}
        late = {alarm for alarm in raised if alarm.startswith("link_late")}  # the warning where it comes before
        assert "link_late_moving" in late
        assert {alarm for alarm in again if alarm.startswith("link_late")} == late
        for alarm in late:
            print(f"{alarm}: {raised[alarm]:.3f} s, judged again {again[alarm]:.3f} s")
            assert again[alarm] == pytest.approx(raised[alarm], abs=TICK_S), alarm
        run = OfflineRun(recording, Drive(recording, read_recorded_events(recording), delay=recorded_delay(recording)))
        run.advance(raised["link_late_moving"])
        reading = run.run_state.state.get("speed")
        assert reading is not None
        assert reading.delay_s > 1.0
        late_s = run.run_state.state.snapshot(run.at_s).link.late_s
        assert late_s is not None
        assert late_s > 2.0


def test_what_changed_is_written_and_read_again_at_any_moment() -> None:
    writer, rows = DelayWriter(), []
    for tick in range(1, 101):
        at_s = tick / 10
        late_s = 0.01 if at_s < 5.0 else at_s - 5.0
        less = (frozenset({"scan"}), "Less.") if at_s > 8.0 else (frozenset[str](), None)
        row = writer.row({"/vel": late_s, "/gps": 0.02}, LinkDelay(at_s, late_s, *less))
        if row is not None:
            rows.append((at_s, row))
    assert len(rows) < 55, "nothing is written while nothing changes"
    delay = delay_of(rows)
    assert delay.is_known
    for at_s in (9.95, 7.05, 2.0, 6.55):  # in any order
        expected_s = max(0.01, at_s + 0.05 - 5.0)
        assert delay.receive("/vel", at_s) == pytest.approx(expected_s, abs=0.051)
        assert delay.receive("/gps", at_s) == 0.02
        assert delay.receive("/unknown", at_s) == 0.0
    assert delay.link(7.0).late_s == pytest.approx(2.0, abs=0.001)
    assert (delay.link(7.0).throttled, delay.link(9.0).throttled) == (frozenset(), frozenset({"scan"}))
    assert delay.link(9.0).reduced == "Less."
    assert delay.link(0.0).late_s is None


def test_a_recording_without_it_came_without_delay() -> None:
    delay = delay_of([])
    assert not delay.is_known
    assert delay.link(5.0) == LinkDelay()


@pytest.mark.parametrize(
    "row",
    [
        {},
        {"late_s": "long", "delays": [1]},
        {"late_s": -1.0, "delays": {"/vel": -1.0}},
        {"late_s": 1e9, "delays": {"/vel": True}},
        {"late_s": None, "delays": {"/vel": "x"}, "throttled": [5], "reduced": 7},
        {"delays": None, "throttled": "scan"},
    ],
)
def test_a_row_that_makes_no_sense_is_no_delay(row: dict[str, Any]) -> None:
    delay = delay_of([(1.0, row)])
    assert delay.receive("/vel", 2.0) == 0.0
    assert (delay.link(2.0).late_s, delay.link(2.0).throttled, delay.link(2.0).reduced) == (None, frozenset(), None)


def test_a_sample_that_is_older_than_any_delay_is_read_as_the_oldest() -> None:
    row = DelayWriter().row({"/fuel": 90_000.0}, LinkDelay())
    assert delay_of([(5.0, row)]).receive("/fuel", 5.0) == MOST_S
