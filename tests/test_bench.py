"""The bench measures what it reports, and leaves nothing running."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import threading
import time
from pathlib import Path

import orjson
import psutil
import pytest
from websockets.sync.client import connect
from websockets.sync.server import serve

from server.judge.unit_evidence import new_evidence
from server.judge.units import rule_for
from server.simulator.messages import VEL
from tests.bench.__main__ import main
from tests.bench.car import PROBES_MPS, Car
from tests.bench.child import Child, Failed
from tests.bench.line import fitted
from tests.bench.program import Program, used
from tests.bench.rig import QUICK, Rig
from tests.bench.rows.latency import latencies_ms
from tests.bench.rows.memory import growth_mb_an_hour
from tests.bench.serving import LoopLag
from tests.bench.table import Group, Row, printed
from tests.bench.wire import Wire
from tests.tree import PROJECT

MS = 1_000_000


def started_since(before: list[psutil.Process]) -> list[psutil.Process]:
    """What runs now and did not then: other tests may keep helpers of theirs."""
    return [one for one in psutil.Process().children() if one not in before]


@pytest.mark.field
@pytest.mark.slow
def test_a_run_has_a_figure_for_each_way_and_leaves_nothing_running(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found, before = tmp_path / "found.json", psutil.Process().children()
    assert main(["--quick", "--only", "latency", "--json", str(found)]) == 0
    assert started_since(before) == []
    printed_lines = capsys.readouterr().out.splitlines()
    assert any("alarm to one viewer, p50 [ms]" in line for line in printed_lines)
    (group,) = orjson.loads(found.read_bytes())["groups"]
    p50, p99, longest = group["rows"]
    for way in ("catgraph", "floor", "today"):
        assert 0 < p50[way] <= p99[way] <= longest[way] < 5000


@pytest.mark.field
@pytest.mark.slow
@pytest.mark.world(n=25)
def test_the_growth_of_the_servers_memory_has_a_row(tmp_path: Path) -> None:
    found = tmp_path / "found.json"
    assert main(["--quick", "--only", "memory", "--json", str(found)]) == 0
    (group,) = orjson.loads(found.read_bytes())["groups"]
    growth, used = group["rows"]
    assert (growth["unit"], growth["reach"]) == ("MB/h", 1.0)
    assert used["catgraph"] > 20


@pytest.mark.field
@pytest.mark.slow
def test_the_stalls_of_the_event_loop_have_a_row(tmp_path: Path) -> None:
    found = tmp_path / "found.json"
    assert main(["--quick", "--only", "stall", "--json", str(found)]) == 0
    (group,) = orjson.loads(found.read_bytes())["groups"]
    p99, longest, *_, lost = group["rows"]
    assert (p99["unit"], p99["reach"], lost["reach"]) == ("ms", 20.0, 0)
    assert 0 < p99["catgraph"] <= longest["catgraph"]


@pytest.mark.field
@pytest.mark.slow
@pytest.mark.timeout(300)  # it starts ten processes, one after the other
def test_cars_and_pages_of_a_fleet_have_rows_and_nothing_is_left_running(tmp_path: Path) -> None:
    found, before = tmp_path / "found.json", psutil.Process().children()
    assert main(["--quick", "--only", "many", "--json", str(found)]) == 0
    assert started_since(before) == []
    (group,) = orjson.loads(found.read_bytes())["groups"]
    rows = {(row["what"], row["unit"]): row for row in group["rows"]}
    for kind, hz in (("6 pages, Home, 1 of 1 cars", 10.0), ("6 pages, all cars, 2 cars", 2.0)):
        assert 0.2 * hz < rows[f"node, {kind}: each got", "frames/s"]["catgraph"] < 4 * hz
        assert 0 < rows[f"node, {kind}", "% of a core"]["catgraph"] < 200
    for part in ("broker, 2 cars, 1 page of all", "node, 2 cars, 1 page of all", "agent, each of 1"):
        assert 0 < rows[part, "% of a core"]["catgraph"] < 200
        assert 2 < rows[part, "MB"]["catgraph"] < 300
    assert rows["node, each page on Home", "kB"]["reach"] == 150.0
    assert any("extrapolated to 1000 cars" in note for note in group["notes"])


def test_a_line_goes_through_points_of_several_counts_and_tells_how_far_it_is_off() -> None:
    points = [
        ((cars, pages), 5.0 + 2.0 * cars + 0.25 * pages) for cars, pages in ((1, 10), (1, 100), (10, 10), (3, 40))
    ]
    line = fitted(points)
    assert (line.base, *line.each) == pytest.approx((5.0, 2.0, 0.25))
    assert line.residual == pytest.approx(0.0, abs=1e-9)
    assert line.at(1000, 10_000) == pytest.approx(4505.0)
    assert fitted([((x,), y) for x, y in ((0.0, 1.0), (1.0, 3.0), (2.0, 1.0), (3.0, 3.0))]).residual > 0.5


@pytest.mark.field
def test_a_process_is_measured_by_its_own_work() -> None:
    busy = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    idle = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    try:
        time.sleep(0.3)
        found = used({"busy": busy.pid, "idle": idle.pid}, 0.5)
    finally:
        for one in (busy, idle):
            one.kill()
            one.wait()
    assert found["idle"].share < 5 < found["busy"].share < 110
    assert 1 < found["idle"].memory_mb < 30
    with pytest.raises(Failed, match="cannot be measured"):
        used({"gone": busy.pid}, 0.0)


def test_a_program_that_does_not_start_says_why_and_leaves_nothing() -> None:
    before = psutil.Process().children()
    with pytest.raises(Failed, match="no address of a broker"):
        Program("web", "--broker", "elsewhere")
    assert started_since(before) == []


@pytest.mark.field
async def test_a_stall_of_the_event_loop_is_seen() -> None:
    lag = LoopLag()
    await lag.begin()
    await asyncio.sleep(0.02)
    time.sleep(0.1)  # noqa: ASYNC251 - the stall
    await asyncio.sleep(0.02)
    assert max(lag_s for lag_s, _ in await lag.end()) > 0.09


def test_the_disk_of_a_process_is_made_slow(tmp_path: Path) -> None:
    """Each kind of access takes longer, and files elsewhere do not."""
    program = (
        "import os, sqlite3, sys, time; from pathlib import Path; from tests.bench import slow_disk\n"
        "slow, other = Path(sys.argv[1]), Path(sys.argv[2]); slow_disk.begin(slow, 0.2)\n"
        "database = sqlite3.connect(':memory:')\n"
        "def took(work): began = time.monotonic(); work(); return time.monotonic() - began\n"
        "for work in (lambda: (slow / 'a').open('w').close(), lambda: os.stat(slow), lambda: os.listdir(slow),\n"
        "             lambda: database.execute('SELECT 1'), lambda: (other / 'a').open('w').close()):\n"
        "    print(took(work) > 0.19)"
    )
    slow, other = tmp_path / "slow", tmp_path / "other"
    slow.mkdir()
    other.mkdir()
    ended = subprocess.run(
        [sys.executable, "-c", program, str(slow), str(other)], cwd=PROJECT, capture_output=True, text=True, check=True
    )
    assert ended.stdout.split() == ["True"] * 4 + ["False"]


@pytest.mark.world(n=25)
def test_a_slope_is_that_of_the_whole_time_and_not_of_one_step() -> None:
    steady = [(float(s), 80.0 + 18.0 * s / 3600) for s in range(0, 600, 20)]
    assert growth_mb_an_hour(steady) == pytest.approx(18.0)
    one_step = [(float(s), 80.0 + (0.5 if s > 300 else 0.0)) for s in range(0, 600, 20)]
    assert growth_mb_an_hour(one_step) < 1.5 * 3.6


@pytest.mark.field
@pytest.mark.slow
def test_a_process_that_fails_prints_the_reason_and_none_is_left() -> None:
    before = psutil.Process().children()
    with Rig(QUICK) as rig:
        with pytest.raises(Failed, match="KeyError: 'no such order'"):
            rig.car.ask("no such order")
        assert rig.car.ask("counts")["dropped"] == 0, "it goes on"
    assert started_since(before) == []


def test_a_process_that_does_not_start_prints_the_reason() -> None:
    before = psutil.Process().children()
    with pytest.raises(Failed, match="No module named"):
        Child("nowhere")
    assert started_since(before) == []


@pytest.mark.field
def test_commands_are_timed_as_they_come_to_the_port_and_nothing_else_is() -> None:
    """Short and long frames of a real client; another topic and another port are none of ours."""
    with serve(lambda one: list(one), "127.0.0.1", 0) as bridge, serve(lambda one: list(one), "127.0.0.1", 0) as other:
        for server in (bridge, other):
            threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            wire = Wire(bridge.socket.getsockname()[1])
        except PermissionError:
            pytest.skip("looking at packets needs a right that is not ours")
        began_ns = time.time_ns()
        for server in (other, bridge):
            with connect(f"ws://127.0.0.1:{server.socket.getsockname()[1]}", compression=None) as client:
                for text in ("", "a" * 200):
                    for topic in ("/ours", "/theirs"):
                        client.send(orjson.dumps({"op": "publish", "topic": topic, "msg": {"data": text}}).decode())
        ended_ns = time.time_ns()
        time.sleep(0.1)
        wire.stop()
        bridge.shutdown()
        other.shutdown()
    arrived = wire.published("/ours")
    assert len(arrived) == 2
    assert began_ns < arrived[0] <= arrived[1] < ended_ns


async def test_no_speed_above_the_limit_looks_like_another_unit_of_the_drives_speed() -> None:
    """Else a server judges the speed no more, and no alarm comes."""
    car = Car(None)
    speeds = sorted({round(message["linear"]["x"], 2) for _, topic, message in car.tape if topic == VEL.topic})
    rule = rule_for("speed", VEL.type)
    assert rule is not None
    for calm_mps in speeds:
        for fast_mps in PROBES_MPS:
            evidence = new_evidence("speed", rule)
            for _ in range(20):
                evidence.add(calm_mps, rule.units)
                evidence.add(fast_mps, rule.units)
            assert not evidence.alternates, (calm_mps, fast_mps)


def test_alarms_are_matched_with_their_speeds() -> None:
    sent = [[12.0, 10 * MS], [12.1, 20 * MS]]
    assert latencies_ms(sent, [["12.0 m/s, limit 11.0 m/s", 11 * MS], [12.1, 25 * MS]]) == [1.0, 5.0]


@pytest.mark.parametrize(
    "alarms",
    [
        [["12.0 m/s", 11 * MS]],
        [["12.1 m/s", 11 * MS], ["12.0 m/s", 25 * MS]],
        [["12.0 m/s", 11 * MS], ["12.1 m/s", 25 * MS], ["12.1 m/s", 26 * MS]],
    ],
    ids=["one lost", "out of order", "one twice"],
)
def test_alarms_that_are_not_those_sent_are_no_measurement(alarms: list[list[object]]) -> None:
    with pytest.raises(Failed, match="are others"):
        latencies_ms([[12.0, 10 * MS], [12.1, 20 * MS]], alarms)


def test_the_table_tells_what_is_reached() -> None:
    rows = (
        Row(what="load", unit="%", catgraph=50, floor=10, today=100, reach=40, digits=0),
        Row(what="silence", unit="s", catgraph=0.1, reach=0.2),
    )
    title, _, heading, load, silence = printed([Group(name="a", title="On the bridge", rows=rows)]).splitlines()
    assert title.split() == ["reach", "catgraph", "floor", "today", "ours/floor", "today/ours"]
    assert heading == "On the bridge"
    assert load.split("  ")[1] == "load [%]"
    assert "≤ 40 MISSED" in load
    assert load.endswith("5.00 ×      2.00 ×")
    assert "≤ 0.20 ok" in silence
