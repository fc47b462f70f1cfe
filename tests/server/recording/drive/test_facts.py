"""The facts of a drive in its recording, against a drive whose facts are known."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from server.recording.catalog.survey import survey
from server.recording.drive.alarms import component_of, marks_of, percentile
from server.recording.drive.departure import check_of
from server.recording.drive.facts import DriveFacts, DriveLog, figures_of, read_facts
from server.recording.drive.modes import interventions_of
from server.recording.drive.people import Span
from server.recording.read.read import open_recording
from server.recording.standing import EarlyEntries
from tests.server.recording.bags import Drive, write_ros1
from tests.server.recording.drive import story
from tests.server.recording.drive.story import BEGIN_MS, EVIL, check, logged, mark, mode, recorded

NEAR_S = 0.2


def read(path: Path) -> DriveFacts:
    with open_recording([path]) as recording:
        return read_facts(recording)


def log_of(path: Path) -> DriveLog:
    log = read(path).log
    assert log is not None
    return log


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp("story"))


@pytest.fixture(scope="module")
def facts(path: Path) -> DriveFacts:
    return read(path)


@pytest.fixture(scope="module")
def log(facts: DriveFacts) -> DriveLog:
    assert facts.log is not None
    return facts.log


def test_figures_are_those_of_the_drive(facts: DriveFacts) -> None:
    found = figures_of(facts)
    assert found["distance_m"] == pytest.approx(1200, abs=2.0), "the car drives at the end: none of the way is missing"
    assert found["modes"]["autonomous"]["m"] == pytest.approx(700, rel=0.01)
    assert found["modes"]["manual"]["m"] == pytest.approx(500, rel=0.02)
    assert [found["modes"][name]["s"] for name in ("autonomous", "manual", "unknown")] == [70, 50, 0]
    assert (found["driven_s"], found["blind"]) == (120, 1)
    assert found["blind_s"] == pytest.approx(4, abs=NEAR_S)
    names = ("alarms", "interventions", "marks", "slow_downs", "unacknowledged", "departure")
    assert [found[name] for name in names] == [2, 1, 2, 1, 0, "signed"]
    assert (found["acknowledged_p50_s"], found["acknowledged_p90_s"]) == (3.3, 4.6)  # of 2.1 s and 4.6 s (4.55 rounded)
    assert found["components"] == {"Speed": 1, "Laser": 1}


def test_each_thing_is_at_its_second(facts: DriveFacts, log: DriveLog) -> None:
    found = {
        "raised": facts.at_s(log.alarms[0].raised_ms),
        "acknowledged": facts.at_s(log.alarms[0].acknowledged_ms or 0),
        "mark": facts.at_s(log.marks[0]["marked_ms"]),
        "late mark": facts.at_s(log.marks[1]["marked_ms"]),
        "intervention": facts.at_s(log.interventions[0].at_ms),
        "ordered": facts.at_s(log.slow_downs[0].ordered_ms),
        "proven": facts.at_s(log.slow_downs[0].slows_ms or 0),
        "signed": facts.at_s(log.departure.at_ms or 0),
        "lost": facts.motion.blind_spans()[0][0],
        "found": facts.motion.blind_spans()[0][1],
    }
    truth = {
        "raised": 20.0,
        "acknowledged": 22.1,
        "mark": 33.33,
        "late mark": 50.0,
        "intervention": 80.0,
        "ordered": 95.0,
        "proven": 96.4,
        "signed": 6.0,
        "lost": story.LOST_S[0],
        "found": story.LOST_S[1],
    }
    assert found == {name: pytest.approx(at_s, abs=NEAR_S) for name, at_s in truth.items()}


def test_people_and_who_was_in_control(log: DriveLog) -> None:
    operator, other = log.people
    assert (operator.name, operator.role) == ("A. K.", "operator")
    assert operator.on_duty == [Span(from_ms=BEGIN_MS + 500, to_ms=BEGIN_MS + 56_000)]
    assert operator.in_control == [Span(from_ms=BEGIN_MS + 600, to_ms=BEGIN_MS + 55_000)]
    assert (other.name, other.role) == ("M. R. (Tablet)", "")  # nobody signed on there
    assert other.in_control == [Span(from_ms=BEGIN_MS + 55_000, to_ms=None)]


def test_what_stood_before_has_no_beginning(tmp_path: Path) -> None:
    before = logged(-50.0, "duty", act="on", person="S. T.", role="safety_driver")
    (one,) = log_of(recorded(tmp_path, [before])).people
    assert (one.role, one.on_duty) == ("safety driver", [Span(from_ms=None, to_ms=None)])


def test_the_newest_of_each_item_and_mark_counts(log: DriveLog) -> None:
    results = {item.item: (item.result, item.value, item.note) for item in log.departure.items}
    assert [item.item for item in log.departure.items if item.had_failed] == ["clock"]
    assert results["clock"] == ("done", "0.02 s", "set again")
    assert results["hitch"] == ("not_applicable", "", EVIL)
    assert (log.departure.state, log.departure.done, log.departure.of) == ("signed", 2, 3)
    assert [(row["mark"], row["words"], row["photo"]) for row in log.marks] == [("m1", EVIL, True), ("m3", "", False)]
    intervention = log.interventions[0]
    assert (intervention.what, intervention.category, intervention.initiated_by) == (EVIL, "object late", "driver")
    assert intervention.before == ((-10.0, 10.0),)  # what has no number is left out


def test_who_began_an_intervention_is_by_the_newest_description_or_else_the_data() -> None:
    one: dict[str, Any] = {"intervention": "i", "at_ms": BEGIN_MS}
    begun = one | {"change": "intervention", "initiated_by": "driver"}
    event = one | {"change": "intervention_described", "what": "A box."}
    by = [
        [one.initiated_by for one in interventions_of([begun, *described])]
        for described in ([event | {"initiated_by": "operator"}], [event | {"initiated_by": "operator"}, event])
    ]
    assert by == [["operator"], ["driver"]]


@pytest.mark.parametrize(
    ("more", "state"),
    [
        pytest.param([], "none", id="none was made"),
        pytest.param([check(1, "begun")], "open", id="begun"),
        pytest.param([check(1, "begun"), check(2, "signed"), check(3, "reopened")], "open", id="opened again"),
        pytest.param(
            [check(1, "signed"), logged(2, "departure", step="without")], "none", id="the next drive has none"
        ),
    ],
)
def test_a_check_that_is_not_signed(more: list[Any], state: str, tmp_path: Path) -> None:
    assert log_of(recorded(tmp_path, more)).departure.state == state


def test_a_check_that_was_signed_before_the_recording(tmp_path: Path) -> None:
    path = recorded(tmp_path, [], departure='{"check": "c", "at_ms": 5, "by": "A. K.", "done": 9, "of": 9}')
    found = log_of(path).departure
    assert (found.state, found.at_ms, found.done) == ("signed", 5, 9)


def test_its_items_with_an_interval_are_kept_in_what_is_known_before_the_recording(tmp_path: Path) -> None:
    row = {"item": "brakes", "title": "Brakes", "every_days": 30, "every_km": None, "is_done": True}
    nonsense: list[Any] = [7, {"item": 3}, {**row, "item": "x", "every_days": -4, "every_km": "far", "is_done": 1}]
    entries = EarlyEntries()
    entries.note("alarms", {"change": "departure", "step": "signed", "at_ms": 5, "recurring": [row, *nonsense]})
    found = log_of(recorded(tmp_path, [], departure=entries.standing()["departure"])).departure
    bare = {"item": "x", "title": "Brakes", "every_days": None, "every_km": None, "is_done": False}
    assert list(found.recurring) == [row, bare]
    assert (check_of(found) or {})["recurring"] == [row, bare]


def test_without_a_mode_nothing_is_known_of_interventions(tmp_path: Path) -> None:
    found = figures_of(read(recorded(tmp_path, [logged(1, "connected")])))
    assert (found["interventions"], found["alarms"]) == (None, 0)
    assert found["modes"]["unknown"] == {"m": found["distance_m"], "s": 120.0}


def test_a_recording_of_others_knows_none_of_it(tmp_path: Path) -> None:
    with open_recording([write_ros1(tmp_path / "bag.bag", Drive(messages=story.rows(10)))]) as recording:
        facts = read_facts(recording)
    found = figures_of(facts)
    assert facts.log is None
    assert {found[name] for name in ("alarms", "interventions", "marks", "departure", "acknowledged_p50_s")} == {None}
    assert found["distance_m"] == pytest.approx(100, abs=2.0)


def test_nonsense_in_a_log_is_left_out(tmp_path: Path) -> None:
    nonsense = [
        mark(1, "../../etc"),
        mark(1, "x", marked_ms=True),
        mark(1, "y", marked_ms=2**60),
        logged(1, "intervention", intervention=7, active="no list", before={"a": 1}),
        logged(
            1, "intervention", intervention="i", speed_mps="fast", initiated_by=["x"], active=[1, "a"], before=[[], 3]
        ),
        logged(1, "departure", step=["x"], done=-4, of="many"),
        logged(1, "mode", mode="flying", before=None),
        logged(1, "slow_down", order="one", step="sent"),
        logged(1, "duty", person=["x"], act=5),
        logged(1, "control", holder=9),
        logged(1, "raised", "x.y", causes="no list", priority=[]),
    ]
    log = log_of(recorded(tmp_path, nonsense))
    assert (log.marks, log.slow_downs, log.people) == ([], [], [])
    assert [(one.speed_mps, one.initiated_by, one.active) for one in log.interventions] == [(None, "unknown", ("a",))]
    assert [(one.priority, one.component) for one in log.alarms] == [("critical", "Other")]
    assert (log.departure.state, log.departure.done) == ("open", 0)


def test_marks_that_came_later_are_among_them(tmp_path: Path) -> None:
    path = recorded(tmp_path, [mark(10, "a", words="first"), mark(20, "b")])
    row = {"mark": "a", "marked_ms": BEGIN_MS + 11_000, "category": "gps", "words": "later", "voice": False}
    path.with_name(path.name + ".json").write_text(json.dumps({"marks": [row, 5, {}], "removed": ["b", 1]}))
    assert [(row["mark"], row["words"], row["category"]) for row in log_of(path).marks] == [("a", "later", "gps")]


def test_a_check_that_goes_on_while_the_car_drives_is_whole(tmp_path: Path) -> None:
    """The car drove off without a signature; what was answered before belongs to the check that is signed then."""

    def item(at_s: float, name: str, result: str) -> story.Own:
        return check(at_s, "item", item=name, result=result)

    before = [
        check(1, "begun"),
        item(2, "gps", "failed"),
        item(3, "belt", "done"),
        logged(4, "departure", step="without"),
    ]
    found = log_of(recorded(tmp_path, [*before, item(5, "gps", "done"), check(6, "signed")])).departure
    assert found.state == "signed"
    assert {one.item: (one.result, one.had_failed) for one in found.items} == {
        "gps": ("done", True),
        "belt": ("done", False),
    }


def test_modes_follow_each_other_without_a_gap(tmp_path: Path) -> None:
    spans = log_of(recorded(tmp_path, [mode(30, "autonomous", "manual"), mode(60, "unknown", "autonomous")])).modes
    assert [(one.mode, (one.from_ms - BEGIN_MS) / 1000, (one.to_ms - BEGIN_MS) / 1000) for one in spans] == [
        ("manual", 0, 30),
        ("autonomous", 30, 60),
        ("unknown", 60, 120),
    ]


def test_the_survey_finds_the_same_figures(path: Path, facts: DriveFacts) -> None:
    assert survey(path)["figures"] == figures_of(facts)


def test_percentiles_and_components() -> None:
    assert percentile([], 0.9) is None
    assert [percentile([1, 2, 3, 4, 5, 6, 7, 8, 9, 10], share) for share in (0.5, 0.9)] == [5.5, 9]
    assert component_of("signal_stale.position") == "Position"
    assert component_of("diagnostics_error", ["level 2", "planner"]) == "planner"
    assert component_of("link_lost") == "Link"


def test_planned_stops_and_the_alarms_in_them(tmp_path: Path) -> None:
    stop = {"reason": "workshop", "by": "A. K. (Pixel)"}
    again = {"reason": "workshop", "by": "A. K. (Pixel)", "since_ms": BEGIN_MS + 10_000}
    log = log_of(
        recorded(
            tmp_path,
            [
                logged(10.0, "planned_stop", **stop),
                logged(12.0, "raised", "gps_drift", state="UNACKED", planned_stop="workshop"),
                logged(15.0, "planned_stop", **again),  # the server was started again
                logged(20.0, "planned_stop", reason="charging", by="M. R. (Tablet)"),
                logged(30.0, "planned_stop_ended", reason="charging", text="The planned stop ended: the car moves."),
                logged(31.0, "planned_stop_ended", text=EVIL),  # of none that is known
                logged(40.0, "raised", "speed_limit", state="UNACKED"),
                logged(50.0, "planned_stop", reason="of another version", by=EVIL),
            ],
        )
    )
    found = [(one.reason, one.from_ms - BEGIN_MS, one.to_ms and one.to_ms - BEGIN_MS) for one in log.planned_stops]
    assert found == [
        ("in the workshop", 10_000, 20_000),
        ("charging or refuelling", 20_000, 30_000),
        ("parked", 50_000, None),
    ]
    assert (log.planned_stops[1].ended, log.planned_stops[1].ended_by) == ("The planned stop ended: the car moves.", "")
    assert [(one.alarm, one.planned_stop) for one in log.alarms] == [("gps_drift", True), ("speed_limit", False)]


def test_an_alarm_that_was_shelved_or_suppressed_bears_the_mark(tmp_path: Path) -> None:
    own = [
        logged(1.0, "raised", "gps_drift", state="UNACKED"),
        logged(2.0, "shelved", "gps_drift", state="SHELVED"),
        logged(3.0, "cleared", "gps_drift", state="SHELVED"),
        logged(4.0, "raised", "gps_drift", state="SHELVED"),
        logged(5.0, "raised", "speed_limit", state="UNACKED"),
        logged(6.0, "suppressed", "speed_limit", state="SUPPRESSED"),
        logged(7.0, "unsuppressed", "speed_limit", state="UNACKED"),
        logged(8.0, "raised", "fuel", state="UNACKED"),
        logged(9.0, "acknowledged", "fuel", state="ACKED"),
        logged(10.0, "suppressed", "fuel", state="SUPPRESSED", suppressed_by=["paused"]),
        logged(11.0, "raised", "laser", state="UNACKED"),
        logged(12.0, "suppressed", "laser", state="SUPPRESSED", suppressed_by=["paused", "speed_limit"]),
        logged(13.0, "raised", "tracks", state="UNACKED"),
    ]
    alarms = [asdict(one) for one in log_of(recorded(tmp_path, own)).alarms]
    assert [(one["alarm"], marks_of(one)) for one in alarms] == [
        ("gps_drift", "shelved"),
        ("gps_drift", "shelved"),
        ("speed_limit", "suppressed by another alarm"),
        ("fuel", "suppressed: monitoring was paused"),
        ("laser", "suppressed: monitoring was paused · suppressed by another alarm"),
        ("tracks", ""),
    ]


def test_a_planned_stop_is_kept_in_what_is_known_before_the_recording(tmp_path: Path) -> None:
    entries = EarlyEntries()
    _, _, began = logged(-30.0, "planned_stop", reason="parked", by="A. K. (Pixel)")
    entries.note("alarms", began)
    (stop,) = log_of(recorded(tmp_path, [], standing=entries.standing()["standing"])).planned_stops
    assert (stop.reason, stop.by, stop.from_ms, stop.to_ms) == ("parked", "A. K. (Pixel)", BEGIN_MS - 30_000, None)
    entries.note("alarms", logged(-20.0, "planned_stop_ended", reason="parked")[2])
    assert json.loads(entries.standing()["standing"]) == []
