"""One drive, judged live and recorded: everything that reads the recording finds the same transitions."""

from __future__ import annotations

import asyncio
import csv
import io
import time
import zipfile
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any, cast

import pytest

from monitor.alarm import Transition
from monitor.catalog import CHECKS
from server.analysis.recorded_log import read_recorded_log
from server.analysis.rehearse import Rehearsed, rehearse
from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.judge.pipeline import TICK_S
from server.protocol.answers import DriveTrendsAnswer
from server.recording.catalog.survey import survey
from server.recording.export.clip import Window, write_clip
from server.recording.export.formats.csv_zip import write_csv_zip
from server.recording.folder import RecordingsFolder
from server.recording.read.read import open_recording
from server.replay.playback import Playback
from server.simulator.car import SimulatedCar
from server.simulator.messages import VEL
from server.vehicle.session import Session
from server.vehicle.vehicle import Vehicle
from tests.server.vehicle.car_source import CarSource
from tests.tree import RECORDINGS
from tests.world.played import run

pytestmark = [pytest.mark.slow, pytest.mark.field]

BEGAN_S = 1_790_000_000.0
LENGTH_S = 62.0
RESUMED_S = 29.0
CHANGED_S = 32.0  # the topic of the speed
WHEELS = "/wheels/vel"  # another speed, 6 m/s more
PHONE = "0a1b2c3d"
DRAWN = ["speed", "brake", "distance", "steering"]
ORDERS: list[tuple[float, dict[str, Any]]] = [
    (8.0, {"kind": "set", "values": {"speed_limit.max_mps": 2.0}}),
    (9.4, {"kind": "silence", "alarm": "speed_limit", "occurrence": 1}),
    (10.0, {"kind": "acknowledge", "alarm": "speed_limit", "occurrence": 1}),
    (14.0, {"kind": "set", "values": {"speed_limit.max_mps": 11.0}}),
    (18.0, {"kind": "set", "topics": {"speed": WHEELS}}),
    (24.0, {"kind": "pause"}),
    (RESUMED_S, {"kind": "resume"}),
    (CHANGED_S, {"kind": "set", "topics": {"speed": None}}),
    (36.0, {"kind": "ride", "phone": PHONE}),
    (44.0, {"kind": "arm"}),
    (45.0, {"kind": "slow_down"}),
    (52.0, {"kind": "release", "number": 1}),
    (57.6, {"kind": "shelve", "alarm": "not_moving", "occurrence": 1}),
    (58.4, {"kind": "unshelve", "alarm": "not_moving"}),
]
# What no recording can show: who is there to hear an alarm, and this server's own parts.
ELSEWHERE = ("reach", "recording_stopped", "recorder_behind", "disk_nearly_full", "log_not_kept")

Change = tuple[str, int, str]  # alarm, occurrence, what happened


class Watched(Session):
    """Keeps the transitions of a session."""

    def __init__(self, *args: Any, **more: Any) -> None:
        self.transitions: list[Transition] = []
        super().__init__(*args, **more)

    def alarms_changed(self, transitions: Collection[Transition]) -> None:
        self.transitions += transitions
        super().alarms_changed(transitions)


@dataclass(frozen=True, kw_only=True)
class Driven:
    """What became of the live drive. Times are seconds since the beginning of the recording."""

    path: Path
    transitions: list[Transition]
    trends: DriveTrendsAnswer


async def drive(folder: Path) -> Driven:
    loop = asyncio.get_running_loop()
    car = SimulatedCar(seed=3, start_s=BEGAN_S)
    source = CarSource(car, {WHEELS: VEL.type})
    session = Watched(
        Vehicle(name="car", address="ws://192.0.2.1:9090"),
        LocalBus(Journal(None), now=loop.time),
        now=loop.time,
        wall_ms=lambda: round((BEGAN_S + loop.time()) * 1000),
        server=dict,
        recordings=RecordingsFolder(folder),
        open_source=source,
    )
    await session.start()
    orders, phone_s = list(ORDERS), 1.0
    for step in car.steps():
        now_s = step.at_s - BEGAN_S
        if now_s > LENGTH_S:
            break
        await asyncio.sleep(max(0.0, now_s - loop.time()))
        if orders and now_s >= orders[0][0]:
            order = orders.pop(0)[1]
            answer = await session._commands.handle({"by": "Anna", "console": True} | order)
            assert answer["ok"], (order, answer)
        if now_s >= phone_s:
            phone_s += 1.0
            await session._commands.handle({"by": "Anna", **phone(car, now_s)})
            let_the_recorder_write()
        wheels = [faster(message) for message in step.messages if message.topic == VEL.topic]
        source.publish([*step.messages, *wheels])
    transitions = list(session.transitions)
    trends = await session._commands.handle({"kind": "drive_trends", "signals": DRAWN, "buckets": 600})
    session.disconnect(by="Anna")
    path = await finished(RecordingsFolder(folder))
    await session.stop()
    with open_recording([path]) as recording:
        start_s = recording.start_s - BEGAN_S
    moved = [replace(one, at_s=one.at_s - start_s) for one in transitions]
    return Driven(path=path, transitions=moved, trends=cast(DriveTrendsAnswer, trends))


async def finished(folder: RecordingsFolder) -> Path:
    """The recording, once it is closed."""
    for _ in range(600):
        if found := folder.finished():
            return found[0]
        await asyncio.sleep(0)
        let_the_recorder_write()
    raise AssertionError(f"the recording was not closed: {folder.unfinished()}")


def let_the_recorder_write() -> None:
    """Its thread works in real time, of which hardly any passes here."""
    time.sleep(0.02)


def faster(message: Any) -> Any:
    twist = message.message
    linear = dict(twist["linear"]) | {"x": twist["linear"]["x"] + 6.0}
    return replace(message, topic=WHEELS, message={**twist, "linear": linear})


def phone(car: SimulatedCar, now_s: float) -> Mapping[str, Any]:
    """A phone that is in the car for 37 s and then 1 km away."""
    truth = car.state()["truth"]
    lat_deg = truth["lat_deg"] + (0.01 if now_s > 37.0 else 0.0)
    wall_ms = (BEGAN_S + now_s) * 1000
    fix = {
        "lat_deg": lat_deg, "lon_deg": truth["lon_deg"], "accuracy_m": 5.0, "at_ms": wall_ms, "age_s": 0.1,
        "heard_ms": wall_ms - 50.0, "held_s": 0.05,
    }  # fmt: skip
    return {"kind": "position", "phone": PHONE, "handheld": True, "fix": fix}


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> Driven:
    return run(drive(tmp_path_factory.mktemp("recordings")))


@pytest.fixture(scope="module")
def checked(driven: Driven) -> Rehearsed:
    with open_recording([driven.path]) as recording:
        return rehearse(recording)


def judged(transitions: Collection[Transition]) -> list[Transition]:
    """Those that follow from the recorded messages and events."""
    return [one for one in transitions if one.alarm_id not in ELSEWHERE]


def named(transition: Transition) -> Change:
    return transition.alarm_id, transition.occurrence, transition.change


def assert_same(found: Collection[Transition], expected: Collection[Transition]) -> None:
    """The same transitions of each alarm in the same order, each within a tick: those of a session and those of
    a later run are at other moments."""

    def of_each(transitions: Collection[Transition]) -> dict[str, list[Transition]]:
        return {
            name: [one for one in transitions if one.alarm_id == name] for name in {t.alarm_id for t in transitions}
        }

    ours, theirs = of_each(found), of_each(expected)
    assert {name: [named(one) for one in ours[name]] for name in ours} == {
        name: [named(one) for one in theirs[name]] for name in theirs
    }
    for name, transitions in ours.items():
        times = [one.at_s for one in transitions]
        assert times == pytest.approx([one.at_s for one in theirs[name]], abs=TICK_S + 0.001), name


def test_the_drive_has_what_is_to_be_compared(driven: Driven) -> None:
    found = {(one.alarm_id, one.change) for one in driven.transitions}
    assert {("speed_limit", "raised"), ("speed_limit", "cleared"), ("phone_car", "raised")} <= found
    assert ("speed_limit", "suppressed") in found, "by the pause"
    assert {
        ("speed_limit", "silenced"),
        ("speed_limit", "acknowledged"),
        ("not_moving", "shelved"),
        ("not_moving", "unshelved"),
    } <= found
    with open_recording([driven.path]) as recording:
        steps = {event.get("step") for _, event in recording.own("/catgraph/alarms")}
    assert {"ordered", "sent", "released"} <= steps


def test_check_finds_what_the_session_found(driven: Driven, checked: Rehearsed) -> None:
    assert_same(judged(checked.transitions), judged(driven.transitions))


@pytest.fixture(scope="module")
def playback(driven: Driven) -> Iterator[Playback]:
    """One whose time line is made."""
    found = opened(driven.path)
    found.index.work(lambda: False)
    yield found
    found.close()


def opened(path: Path) -> Playback:
    return Playback(open_recording([path]), lambda: open_recording([path]), settings="", now_s=0.0)


def active(transitions: Collection[Transition], at_s: float) -> dict[str, int]:
    """Alarm → occurrence, of those that are active, suppressed ones too."""
    found: dict[str, int] = {}
    for one in transitions:
        if one.at_s <= at_s and one.change == "raised":
            found[one.alarm_id] = one.occurrence
        elif one.at_s <= at_s and one.change == "cleared":
            found.pop(one.alarm_id, None)
    return found


def shown(transitions: Collection[Transition], at_s: float) -> dict[str, int]:
    """The same without suppressed ones."""
    newest = {one.alarm_id: one for one in transitions if one.at_s <= at_s}
    return {name: number for name, number in active(transitions, at_s).items() if not newest[name].suppressed_by}


@pytest.mark.parametrize("at_s", [7.0, 12.0, 17.0, 21.5, 26.0, 31.0, 43.0, 48.0, 58.0])
def test_a_seek_shows_what_the_session_showed_and_finds_what_check_finds(
    driven: Driven, checked: Rehearsed, playback: Playback, at_s: float
) -> None:
    playback.seek(at_s, 0.0)
    while playback.is_seeking:
        playback.work(0.0, lambda: False)
    frame = playback.frame(vehicle="car", name="x", settings_version=1)
    assert {one["id"]: one["occurrence"] for one in frame["alarms"] if one["active"]} == shown(driven.transitions, at_s)
    found = playback._run.run_state.monitor.alarms.values()
    assert {one.id: one.occurrence for one in found if one.active} == active(checked.transitions, at_s)


def test_the_trends_of_the_recording_are_those_of_the_session(driven: Driven, playback: Playback) -> None:
    """The drive begins where the car was dialled, the recording a little later."""
    live = driven.trends
    found = cast(DriveTrendsAnswer, playback.answer({"kind": "drive_trends", "signals": DRAWN, "buckets": 600}))
    later_s = (found["start_ms"] - live["start_ms"]) / 1000
    assert 0.0 <= later_s < 2.0
    assert found["known_s"] == found["length_s"]

    def moved(times: list[tuple[float, float]]) -> list[float]:
        return [one - later_s for one in chain.from_iterable(times)]

    for name in DRAWN:
        ours, theirs = found["signals"][name], live["signals"][name]
        assert known(ours["lowest"], min) == known(theirs["lowest"], min), name
        assert known(ours["highest"], max) == known(theirs["highest"], max), name
        assert [value for _, value in ours["limits"]] == [value for _, value in theirs["limits"]], name
        times = [at_s - later_s for at_s, _ in theirs["limits"]][1:]
        assert [at_s for at_s, _ in ours["limits"]][1:] == pytest.approx(times, abs=0.1), name
        open_s = found["length_s"] - 2.0
        closed = [gap for gap in ours["gaps"] if gap[0] > 0.5 and gap[1] < open_s]
        expected = [gap for gap in theirs["gaps"] if gap[0] - later_s > 0.5 and gap[1] - later_s < open_s]
        assert list(chain.from_iterable(closed)) == pytest.approx(moved(expected), abs=0.1), name
    announced = [one for one in live["marks"] if one["alarm"] not in ELSEWHERE]
    assert [one["alarm"] for one in found["marks"] if one["alarm"] not in ELSEWHERE] == [
        one["alarm"] for one in announced
    ]
    assert len(announced) > 3


def known(numbers: list[float | None], which: Callable[[list[float]], float]) -> float:
    return which([number for number in numbers if number is not None])


def test_the_list_of_recordings_counts_what_was_raised(driven: Driven) -> None:
    with open_recording([driven.path]) as recording:
        start_ms = recording.start_s * 1000
    found = [(one["alarm"], (one["at_ms"] - start_ms) / 1000) for one in survey(driven.path)["raised"]]
    raised = [one for one in driven.transitions if one.change == "raised"]
    assert [alarm for alarm, _ in found] == [one.alarm_id for one in raised]
    assert [at_s for _, at_s in found] == pytest.approx([one.at_s for one in raised], abs=TICK_S)


def test_the_tables_hold_every_transition(driven: Driven, tmp_path: Path) -> None:
    with open_recording([driven.path]) as recording:
        write_csv_zip(recording, tmp_path / "out.zip")
    with zipfile.ZipFile(tmp_path / "out.zip") as packed:
        rows = list(csv.DictReader(io.StringIO(packed.read("alarms.csv").decode())))
        speeds = list(csv.reader(io.StringIO(packed.read("speed.csv").decode())))[1:]
    found = [(row["alarm"], int(row["occurrence"]), row["change"]) for row in rows if row["alarm"]]
    assert found[: len(driven.transitions)] == [named(one) for one in driven.transitions]
    between = [float(row[3]) for row in speeds if 20.0 < float(row[1]) < 30.0]
    after = [float(row[3]) for row in speeds if 34.0 < float(row[1]) < 43.0]
    assert min(between) > 9.0 > max(after), "the tables have the topic that was chosen at the time"


def test_the_page_of_the_drive_has_the_announced_alarms(driven: Driven) -> None:
    with open_recording([driven.path]) as recording:
        recorded = read_recorded_log(recording)
    assert recorded is not None
    raised = [one for one in driven.transitions if one.change == "raised"]
    assert sorted(one.alarm_id for one in recorded.episodes) == sorted(one.alarm_id for one in raised)


def test_a_clip_that_begins_in_a_pause_is_judged_as_the_whole(
    driven: Driven, checked: Rehearsed, tmp_path: Path
) -> None:
    """Its checks begin without knowledge, so an alarm that stood comes a second after the pause."""
    with open_recording([driven.path]) as recording:
        start_s = recording.start_s
        write_clip(
            recording, tmp_path / "clip.mcap", Window(at_ns=round((start_s + 41) * 1e9), before_s=15.0, after_s=20.0),
            clip_of="car",
        )  # fmt: skip
    with open_recording([tmp_path / "clip.mcap"]) as clip:
        later_s = clip.start_s - start_s
        found = [replace(one, at_s=one.at_s + later_s) for one in rehearse(clip).transitions]
    assert later_s == pytest.approx(26.0, abs=0.2)

    moments = [28.25, *(30.25 + 0.5 * n for n in range(60))]
    specs = {check.id: check.alarm for check in CHECKS}

    def at(transitions: Collection[Transition], at_s: float) -> list[str]:
        """What is shown, but for an alarm whose delay is as long as its fault lasts after the pause."""
        names = shown(judged(transitions), at_s)
        return sorted(name for name in names if specs[name].on_delay_s < CHANGED_S - RESUMED_S)

    expected = [at(checked.transitions, at_s) for at_s in moments]
    assert [at(found, at_s) for at_s in moments] == expected
    assert expected[0] == []
    assert "speed_limit" in expected[1], "the pause is over"


def test_a_recorded_drive_of_others_is_judged_alike_by_check_and_replay() -> None:
    path = RECORDINGS / "catvehicle_2016-06-01.bag"
    if not path.is_file():
        pytest.skip("the recorded drives are not here")
    with open_recording([path]) as recording:
        announced = [one for one in rehearse(recording).transitions if one.announces]
    playback = opened(path)
    playback.index.work(lambda: False)
    marks = playback.timeline()["marks"]
    playback.close()
    assert [mark["alarm"] for mark in marks] == [one.alarm_id for one in announced]
    assert [mark["at_s"] for mark in marks] == pytest.approx([one.at_s for one in announced], abs=TICK_S)
