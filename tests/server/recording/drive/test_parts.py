"""A drive of several parts is one: what was recorded is added up, and the time between two parts is not driven."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from server.recording.drive.facts import DriveFacts, DriveLog, figures_of, read_facts
from server.recording.drive.link_way import blind_times, late_times
from server.recording.drive.modes import ModeSpan
from server.recording.drive.parts import DrivePart, outside, parts_of
from server.recording.drive.people import PersonInDrive, Span, joined_people
from server.recording.drive.unrecorded import Beside, missing, unrecorded_of
from server.recording.read.read import open_recording
from tests.server.recording.bags import BEGIN_S
from tests.server.recording.drive.story import BEGIN_MS, LENGTH_S, NS, SECOND, in_two_parts, logged, recorded, standing


@pytest.fixture(scope="module")
def paths(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return in_two_parts(tmp_path_factory.mktemp("parts"))


def read(*paths: Path) -> DriveFacts:
    with open_recording(paths) as recording:
        return read_facts(recording)


@pytest.fixture(scope="module")
def drive(paths: list[Path]) -> DriveFacts:
    return read(*paths)


@pytest.fixture(scope="module")
def log(drive: DriveFacts) -> DriveLog:
    assert drive.log is not None
    return drive.log


def test_the_figures_of_the_parts_are_added_up(paths: list[Path], drive: DriveFacts) -> None:
    whole = figures_of(drive)
    one, other = (figures_of(read(path)) for path in paths)
    assert whole["driven_s"] == 180.0
    assert whole["distance_m"] == pytest.approx(1800, abs=3.0), "at the end of neither part is any of the way missing"
    for name in ("distance_m", "driven_s", "blind_s"):
        assert whole[name] == pytest.approx(one[name] + other[name], abs=3.0), name
    assert (one["alarms"], one["slow_downs"], other["alarms"], other["slow_downs"]) == (3, 2, 1, 0)
    for name in ("alarms", "interventions", "marks", "slow_downs", "blind"):
        assert whole[name] == one[name] + other[name], name
    for mode in ("autonomous", "manual", "unknown"):
        for unit in ("m", "s"):
            sum_of_parts = one["modes"][mode][unit] + other["modes"][mode][unit]
            assert whole["modes"][mode][unit] == pytest.approx(sum_of_parts, abs=3.0), (mode, unit)
    assert sum(row["s"] for row in whole["modes"].values()) == 180.0


def test_the_time_between_two_parts_is_reported_and_neither_driven_nor_lost(drive: DriveFacts) -> None:
    (gap,) = drive.gaps
    assert gap == pytest.approx((LENGTH_S, SECOND[0]), abs=0.1)
    assert drive.motion.apart_m(*gap) == pytest.approx(300.0, abs=3.0)
    assert (drive.motion.until(gap[1] + 0.3) or 0.0) - (drive.motion.until(gap[0]) or 0.0) < 5.0
    for from_s, to_s in [*drive.motion.blind_spans(), *((a, b) for a, b, _ in drive.held_delays())]:
        assert to_s <= gap[0] + 0.1 or from_s >= gap[1] - 0.1
    assert [(one.from_s, one.to_s) for one in blind_times(drive)] == [pytest.approx((60.0, 64.0), abs=0.1)]
    assert late_times(drive) == []


def test_what_begins_in_one_part_goes_on_in_the_next(log: DriveLog) -> None:
    assert [(one.alarm, one.to_acknowledge_s) for one in log.alarms[2:]] == [("gps_drift", 32.5), ("speed_limit", None)]
    described = {one.intervention: one.what for one in log.interventions}
    assert described["i1"] == "described later"
    assert list(described) == ["i1", "i2"]
    assert [row["mark"] for row in log.marks] == ["m1", "m3", "m9"]
    assert log.departure.state == "signed"


def test_what_began_where_no_part_is_there_is_in_the_report_once(tmp_path: Path) -> None:
    own = [logged(5.0, "raised", "gps_drift", state="UNACKED")]
    between = [
        logged(15.0, "raised", "speed_limit", state="UNACKED"),
        logged(16.0, "planned_stop", reason="workshop"),
        logged(17.0, "slow_down", step="ordered", order=7, why="obstacle"),
    ]
    first = recorded(tmp_path, own, name="s2.mcap", length_s=10.0)
    stood, later = standing(*own, *between), [logged(22.0, "acknowledged", "speed_limit")]
    second = recorded(tmp_path, later, name="s2_p2.mcap", from_s=20.0, length_s=10.0, part="2", **stood)
    third = recorded(tmp_path, [], name="s2_p3.mcap", from_s=40.0, length_s=10.0, part="3", **stood)
    log = read(first, second, third).log
    assert log is not None
    assert [(one.alarm, one.to_acknowledge_s) for one in log.alarms] == [("gps_drift", None), ("speed_limit", 7.0)]
    assert [one.from_ms for one in log.planned_stops] == [BEGIN_MS + 16_000]
    assert [one.order for one in log.slow_downs] == [7]
    assert log.slow_downs[0].steps == 2


def test_a_session_that_resumes_counts_no_alarm_again_and_another_does(tmp_path: Path) -> None:
    stood = standing(logged(5.0, "raised", "gps_drift", state="UNACKED"))
    counts = []
    for name, resumes in (("s3", True), ("s4", False)):
        started = logged(30.0, "started", resumes=resumes)
        facts = read(recorded(tmp_path, [started], name=f"{name}.mcap", from_s=30.0, length_s=5.0, **stood))
        counts.append((figures_of(facts)["alarms"], figures_of(facts)["components"]))
        assert facts.log is not None
        assert [one.alarm for one in facts.log.alarms] == ["gps_drift"]
    assert counts == [(0, {}), (1, {"Position": 1})]
    _, alarms, raised = logged(25.0, "raised", "speed_limit", state="UNACKED")  # while no part was open
    early = ((BEGIN_S + 30) * NS, alarms, raised)
    part = recorded(tmp_path, [early], name="s5.mcap", from_s=30.0, length_s=5.0, part="2", **stood)
    assert figures_of(read(part))["alarms"] == 1


def test_a_mode_holds_within_its_part(log: DriveLog) -> None:
    later = [span for span in log.modes if span.from_ms >= BEGIN_MS + 149_000]
    assert later == [
        ModeSpan(mode="autonomous", from_ms=BEGIN_MS + 150_000, to_ms=BEGIN_MS + 170_000),
        ModeSpan(mode="manual", from_ms=BEGIN_MS + 170_000, to_ms=BEGIN_MS + 210_000),
    ]
    assert max(span.to_ms for span in log.modes if span not in later) == BEGIN_MS + 120_000


def test_a_part_that_does_not_know_the_mode_makes_no_figure_better(tmp_path: Path, paths: list[Path]) -> None:
    without = recorded(tmp_path, [], name="s1_p3.mcap", from_s=300.0, length_s=10.0, session="s1", part="3")
    assert figures_of(read(*paths, without))["interventions"] is None


def test_people_are_on_duty_through_the_time_between_only_where_both_parts_say_so() -> None:
    def person(name: str, *spans: tuple[int | None, int | None]) -> PersonInDrive:
        return PersonInDrive(name=name, role="operator", on_duty=[Span(from_ms=a, to_ms=b) for a, b in spans])

    first = [person("A", (10, None)), person("B", (20, None)), person("C", (None, 50))]
    second = [person("A", (None, 250)), person("C", (None, None))]
    found = {
        one.name: [(s.from_ms, s.to_ms) for s in one.on_duty]
        for one in joined_people([(0, 100, first), (200, 300, second)])
    }
    assert found == {"A": [(10, 250)], "B": [(20, 100)], "C": [(None, 50), (200, None)]}


@pytest.mark.parametrize(
    ("span", "gaps", "left"),
    [
        ((0, 10), [(2, 3), (5, 7)], [(0, 2), (3, 5), (7, 10)]),
        ((2.5, 6), [(2, 3), (5, 7)], [(3, 5)]),
        ((0, 2), [(2, 3)], [(0, 2)]),
        ((2, 3), [(1, 4)], []),
        ((4, 4), [], []),
    ],
)
def test_what_is_in_no_gap(span: Any, gaps: Any, left: Any) -> None:
    assert outside(span, gaps) == left


def part(session: str, number: int | None, from_s: float = 0.0, to_s: float = 1.0, **metadata: str) -> DrivePart:
    id = f"{session}_p{number}" if (number or 1) > 1 else session
    return DrivePart(id=id, session=session, number=number, from_s=from_s, to_s=to_s, metadata=metadata)


def texts(parts: list[DrivePart], beside: Beside | None = None) -> list[str]:
    found = missing(parts) if beside is None else missing(parts, beside)
    return [one.sentence(lambda at_s: f"{at_s:g}").partition(" of the drive")[0] for one in found]


def test_a_part_that_is_not_there_is_named_with_its_time() -> None:
    assert texts([part("a", 1), part("a", 2, 5.0, 9.0), part("b", 1, 9.5, 20.0)]) == []
    assert texts([part("a", 2, clip_of="x"), part("", 5)]) == []
    later = [part("a", 1, 0, 10), part("a", 3, 30, 40), part("a", 6, 70, 80), part("b", 4, 100, 110)]
    assert texts(later) == [
        "No record here from 10 to 30: Part 2",
        "No record here from 40 to 70: Parts 4, 5",
        "No record here from 80 to 100: Parts 1, 2, 3",
    ]
    assert texts([part("a", 3, 30, 40)]) == ["No record here until 30: Parts 1, 2"]
    (whole,) = missing([part("a", 2, 30, 40)])
    assert "Part 1 of the drive of a_p2 is not in this report" in whole.sentence(str)


def test_the_last_part_is_named_by_what_is_beside_it() -> None:
    own = [part("a", 1, 0, 10), part("a", 2, 20, 30)]
    known = frozenset({"a", "a_p2", "a_p3", "b_p9"})
    assert texts(own, Beside(known=known)) == ["No record here from 30 on: Part 3"]
    assert texts(own, Beside(known=known, next_s={"a": 75.0, "b": 90.0})) == ["No record here from 30 to 75: Part 3"]
    both = [*own, part("b", 1, 60, 70)]
    assert texts(both, Beside(known=known - {"b_p9"})) == ["No record here from 30 to 60: Part 3"], "one reason for it"


def test_what_is_there_and_not_in_the_report_is_not_called_without_a_record() -> None:
    own = [part("a", 1, 0, 10), part("a", 4, 40, 50)]
    files = frozenset({"a", "a_p2", "a_p3", "a_p4", "a_p5"})
    assert texts(own, Beside(known=files, files=files)) == [
        "Not in this report from 10 to 40: Parts 2, 3",
        "Not in this report from 50 on: Part 5",
    ]
    (one,) = missing(own, Beside(files=frozenset({"a_p2"})))
    assert one.sentence(str) == (
        "No record here from 10 to 40: Parts 2, 3 of the drive of a are not in this report: "
        "the file of part 2 is being recorded, in the trash, or beside the others."
    )


def test_a_number_that_no_part_has_is_not_counted_up_to() -> None:
    own = [part("a", 1, 0, 10)]
    assert texts(own, Beside(known=frozenset({"a_p99999999"}))) == []


def test_a_lost_link_is_no_time_without_a_record_and_a_stopped_server_is_one() -> None:
    assert texts([part("a", 1, 0, 10), part("a", 2, 60, 70)]) == []
    (one,) = missing([part("a", 1, 0, 10), part("b", 1, 60, 70)])
    assert one.sentence(lambda at_s: f"{at_s:g}") == "No record here from 10 to 60: nothing was recorded between them."


def test_a_last_part_that_is_gone_for_good_is_named_by_the_next_drive(tmp_path: Path) -> None:
    paths = in_two_parts(tmp_path)
    named = {"previous": "s1_p3", "previous_record": "57", "previous_head": "ab" * 32}
    begun = {"session": "s2", "started_ms": str(BEGIN_MS + 400_000)}
    recorded(tmp_path, [], name="s2.mcap", from_s=400.0, length_s=5.0, **begun, **named)
    with open_recording(paths) as recording:
        (one,) = unrecorded_of(recording, parts_of(recording))
    assert (one.parts, one.to_s) == ((3,), 400.0)
    assert one.from_s == pytest.approx(SECOND[0] + SECOND[1], abs=0.1)


def test_what_is_damaged_within_a_part_is_a_time_without_a_record(tmp_path: Path) -> None:
    path = recorded(tmp_path, [], name="s1.mcap", length_s=60.0)
    with open_recording([path]) as recording:
        (file,) = recording.files
        file.damage.lost.append((BEGIN_S * NS + 10 * NS, BEGIN_S * NS + 20 * NS))
        (one,) = unrecorded_of(recording, parts_of(recording))
    assert one.sentence(lambda at_s: f"{at_s:.0f}") == "No record here from 10 to 20: s1.mcap is damaged there."


def test_the_times_of_a_damaged_index_are_not_trusted(tmp_path: Path) -> None:
    path = recorded(tmp_path, [], name="s1.mcap", length_s=60.0)
    with open_recording([path]) as recording:
        (file,) = recording.files
        file.damage.lost.append((0, 1))
        (one,) = unrecorded_of(recording, parts_of(recording))
    assert one.sentence(str) == "No record here at a time that is not known: s1.mcap is damaged."
