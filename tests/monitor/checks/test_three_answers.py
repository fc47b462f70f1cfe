"""Each check gives each of its answers: a row for every check there is, so that a new one without its row fails.

A check that is never in doubt states why.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from monitor.car_clock import ClockJump
from monitor.catalog import CHECKS
from monitor.check import Verdict
from monitor.freeze_detection import Repeats
from monitor.gps_watch import GpsWatch
from monitor.rates import Rate
from monitor.reading import Unusable
from monitor.shell_facts import LinkFacts, ReachFacts, RecorderFacts, SlowingFacts
from monitor.slow_proof import SlowProof
from monitor.state import Reading, Snapshot
from monitor.values import (
    Component,
    Diagnostics,
    Distance,
    Effort,
    GpsFix,
    LaserScan,
    Level,
    MotionCommand,
    Twist,
)
from tests.monitor.checks.known import LINK, Row, ask, known
from tests.monitor.checks.test_frozen import RESTING
from tests.monitor.checks.test_phone import apart, tracks, view
from tests.monitor.test_corridor import sweep

OK, FAULT, UNKNOWN = Verdict.OK, Verdict.FAULT, Verdict.UNKNOWN
NOW_S = 100.0
FIX = GpsFix(lat_deg=32.23, lon_deg=-110.95, sigma_m=1.0, covariance_type=2)
STANDS, DRIVES = Twist(speed_mps=0.0), Twist(speed_mps=5.0)


def with_more(snapshot: Snapshot, **more: Any) -> Snapshot:
    return replace(snapshot, **more)


def linked(**facts: Any) -> Snapshot:
    return known(link=replace(LINK, **facts))


def taped(**facts: Any) -> Snapshot:
    return replace(known(), recorder=RecorderFacts(**facts))


def diagnosed(*levels: int) -> Snapshot:
    parts = tuple(Component(name=f"part {n}", level=level, message="") for n, level in enumerate(levels))
    return known(diagnostics=Diagnostics(components=parts))


def seen(gap_m: float) -> LaserScan:
    return sweep([(gap_m, 0.0, 0.5), (60.0, 0.0, 50.0)])


def late(late_s: float) -> Snapshot:
    return replace(known(speed=DRIVES, link=replace(LINK, late_s=late_s)), heard_s=NOW_S)


def useless(*signals: str, for_s: float) -> Snapshot:
    """These signals come, and none of their values can be used."""
    one = Unusable(
        reason="linear.x is not a number", at_s=NOW_S, since_s=NOW_S - for_s, count=20, horizon_s=1.0, period_s=0.05
    )
    return replace(known(), unusable=dict.fromkeys(signals, one))


def one(name: str, *, age_s: float = 0.0, stamp_s: float | None = None, **more: Any) -> Reading[Any]:
    made = Reading(value=RESTING[name], received_s=NOW_S - age_s, horizon_s=1.0, period_s=0.05, count=100, **more)
    return made if stamp_s is None else replace(made, stamp_s=stamp_s)


def received(**readings: Reading[Any]) -> Snapshot:
    return Snapshot(now_s=NOW_S, readings=readings, link=LINK)


def stale(name: str) -> Row:
    """Silent while messages of another one arrive; in doubt while nothing has come yet."""
    other = "brake" if name != "brake" else "speed"
    waiting = replace(LINK, published=frozenset({name}), connected_s=NOW_S - 1.0)
    return Row(
        ok=received(**{name: one(name)}),
        fault=received(**{name: one(name, age_s=2.0), other: one(other)}),
        unknown=Snapshot(now_s=NOW_S, link=waiting),
        limits={f"{name}_hz": 20.0},  # so that those which may be silent are missed too
    )


def slow(name: str) -> Row:
    def at(measured_hz: float, *, settled: bool = True) -> Snapshot:
        rate = Rate(measured_hz=measured_hz, expected_hz=20.0, settled=settled, learning=not settled)
        return with_more(received(**{name: one(name)}), rates={name: rate})

    return Row(ok=at(20.0), fault=at(10.0), unknown=at(10.0, settled=False), limits={f"{name}_hz": 20.0})


def frozen(name: str) -> Row:
    def at(stamp_n: int, age_s: float = 0.0) -> Snapshot:
        repeats = Repeats(stamp_n=stamp_n, stamp_s=stamp_n * 0.1)
        return received(**{name: one(name, age_s=age_s, stamp_s=1.0, repeats=repeats)})

    return Row(ok=at(0), fault=at(40), unknown=at(40, age_s=1.5))


def all_rates(*hz: float) -> Snapshot:
    names = ("speed", "brake", "accelerator", "steering")[: len(hz)]
    rates = {n: Rate(measured_hz=h, expected_hz=20.0, settled=True) for n, h in zip(names, hz, strict=True)}
    return with_more(received(**{name: one(name) for name in names}), rates=rates)


def clock(offset_s: float) -> Snapshot:
    position = one("position", stamp_s=1.79e9 + NOW_S + offset_s, stamp_change_s=0.0)
    return with_more(received(position=position), link=replace(LINK, wall_zero_s=1.79e9))


def drifted(metres: float) -> Snapshot:
    watch = GpsWatch(drift_m=(metres,) * 3, anchored_s=NOW_S - 10.0, sigma_m=0.5)
    return with_more(known(speed=STANDS, position=FIX), gps=watch, standing_since_s=NOW_S - 12.0)


def ran(mps: float, fixes: int = 3) -> Snapshot:
    watch = GpsWatch(over_ground_mps=(mps,) * fixes, net_mps=mps)
    return with_more(known(speed=STANDS, position=FIX), gps=watch)


def rode(**more: Any) -> Snapshot:
    return with_more(known(NOW_S, position=FIX), phone=view(**more))


def ordered(mps: float, slope_mps2: float | None = 0.0, *, age_s: float = 0.0) -> Snapshot:
    snapshot = known(speed=DRIVES)
    command = Reading(
        value=MotionCommand(speed_mps=mps, tyre_angle_rad=None), received_s=NOW_S - age_s, horizon_s=1.0, count=9
    )
    return with_more(snapshot, readings={**snapshot.readings, "command": command}, speed_slope_mps2=slope_mps2)


def slowed(slope_mps2: float, *, shown: bool = True, **facts: Any) -> Snapshot:
    """A car that drives 5 m/s while 2 m/s are ordered; `shown`: its speed has shown that the order slows it."""
    ordered: dict[str, Any] = {
        "is_armed": True,
        "topic": "/cmd_vel",
        "ordered_s": NOW_S - 2.0,
        "sending_s": NOW_S - 2.0,
        "deceleration_mps2": 1.5,
        "commanded_mps": 2.0,
    }
    order = SlowingFacts(**ordered | facts)
    proof = SlowProof(ordered_s=order.ordered_s, shown="slows" if shown else None, shown_s=NOW_S - 1.2)
    return with_more(known(NOW_S, speed=DRIVES), speed_slope_mps2=slope_mps2, slowing=order, slow_proof=proof)


def silent_for(seconds: float, *, proved: bool = True) -> Snapshot:
    """All signals as old as that; the bridge answered since, or did not."""
    link = replace(LINK, bridge_heard_s=NOW_S if proved else NOW_S - seconds, last_message_s=NOW_S - seconds)
    readings = {name: one(name, age_s=seconds) for name in ("speed", "brake")}
    return Snapshot(now_s=NOW_S, readings=readings, link=link, heard_s=NOW_S - seconds)


ROWS: dict[str, Row | Callable[[str], Row]] = {
    "speed_limit": Row(ok=known(speed=DRIVES), fault=known(speed=Twist(speed_mps=12.0)), unknown=known()),
    "obstacle": Row(
        ok=known(scan=seen(20.0), speed=STANDS),
        fault=known(scan=seen(4.0), speed=STANDS),
        unknown=known(scan=sweep([]), speed=STANDS),
    ),
    "obstacle_nearest": Row(
        ok=known(distance=Distance(distance_m=20.0), speed=STANDS),
        fault=known(distance=Distance(distance_m=4.0), speed=STANDS),
        unknown=known(age_s=2.0, distance=Distance(distance_m=4.0), speed=STANDS),
    ),
    "no_response": Row(ok=ordered(5.0), fault=ordered(0.0), unknown=ordered(0.0, None)),
    "pedals": Row(
        ok=known(brake=Effort(percent=0.0), accelerator=Effort(percent=20.0)),
        fault=known(brake=Effort(percent=20.0), accelerator=Effort(percent=20.0)),
        unknown=known(brake=Effort(percent=20.0)),
    ),
    "gps_fix": Row(
        ok=known(position=FIX), fault=known(position=replace(FIX, status=-1)), unknown=known(age_s=2.0, position=FIX)
    ),
    "gps_quality": Row(
        ok=known(position=FIX),
        fault=known(position=replace(FIX, sigma_m=None)),
        unknown=known(age_s=2.0, position=FIX),
        limits={"strict": 1.0},
    ),
    "gps_drift": Row(ok=drifted(1.0), fault=drifted(5.0), unknown=known(speed=DRIVES, position=FIX)),
    "gps_jump": Row(ok=ran(0.5), fault=ran(23.0), unknown=ran(23.0, fixes=2)),
    "phone_car": Row(ok=rode(), fault=rode(comparisons=apart(*[90.0] * 5)), unknown=rode(comparisons=())),
    "phone_tracks": Row(ok=rode(), fault=rode(tracks=tracks(0.1)), unknown=rode(tracks=None)),
    "phone_missing": Row(
        ok=rode(),
        fault=rode(why="timeout", usable_s=NOW_S - 11.0),
        unknown=rode(why="timeout", usable_s=NOW_S - 3.0),
    ),
    "laser_blind": Row(
        ok=known(scan=seen(20.0)), fault=known(scan=sweep([])), unknown=known(age_s=2.0, scan=seen(20.0))
    ),
    "scan_shape": Row(
        ok=known(scan=seen(20.0)),
        fault=known(scan=replace(seen(20.0), angle_increment_rad=0.1)),
        unknown=known(scan=replace(seen(20.0), ranges_m=seen(20.0).ranges_m[:1], angle_increment_rad=0.0)),
    ),
    "signal_stale": stale,
    "signal_slow": slow,
    "signal_frozen": frozen,
    "all_slow": Row(
        ok=all_rates(20.0, 20.0, 20.0, 20.0), fault=all_rates(9.0, 9.0, 9.0, 20.0), unknown=all_rates(9.0, 9.0)
    ),
    "not_moving": Row(
        ok=known(speed=DRIVES),
        fault=with_more(known(speed=STANDS), standing_since_s=NOW_S - 11.0),
        unknown=known(age_s=2.0, speed=STANDS),
    ),
    "connect_failed": Row(ok=linked(), fault=linked(phase="failed"), unknown=linked(phase="connecting")),
    "no_message": Row(
        ok=linked(connected_s=NOW_S - 9.0, last_message_s=NOW_S),
        fault=linked(connected_s=NOW_S - 9.0, last_message_s=None),
        unknown=linked(connected_s=NOW_S - 1.0, last_message_s=None),
    ),
    "bridge_fault": Row(
        ok=linked(), fault=linked(behind_title="rosapi has ended."), unknown=linked(phase="connecting")
    ),
    "link_lost": Row(ok=linked(), fault=linked(phase="lost"), unknown=linked(phase="connecting")),
    "car_silent": Row(ok=silent_for(0.0), fault=silent_for(2.0), unknown=silent_for(1.45, proved=False)),
    "signal_unusable": lambda signal: Row(
        ok=known(**{signal: RESTING[signal]}),
        fault=useless(signal, for_s=1.5),
        unknown=useless(signal, for_s=0.5),
    ),
    "car_unusable": Row(
        ok=useless("speed", for_s=5.0),
        fault=useless("speed", "brake", "steering", for_s=1.5),
        unknown=useless("speed", "brake", "steering", for_s=0.5),
    ),
    "link_late": Row(ok=linked(late_s=0.2), fault=late(1.5), unknown=linked(late_s=None)),
    "link_late_moving": Row(ok=late(1.5), fault=late(2.5), unknown=linked(late_s=2.5)),
    "clock_jump": Row(
        ok=clock(0.0),
        fault=with_more(clock(0.0), clock_jump=ClockJump(at_s=NOW_S, by_s=-30.0, signals=("position",))),
        unknown=known(position=FIX),
    ),
    "clock_offset": Row(ok=clock(0.1), fault=clock(60.0), unknown=clock(3e8)),
    "diagnostics_error": Row(ok=diagnosed(0, 1), fault=diagnosed(0, 2), unknown=known()),
    "diagnostics_warn": Row(ok=diagnosed(0, 2), fault=diagnosed(0, 1), unknown=known()),
    "fuel_low": Row(
        ok=known(fuel=Level(value=50.0, unit="%")),
        fault=known(fuel=Level(value=5.0, unit="%")),
        unknown=known(fuel=Level(value=5.0, unit="l")),
    ),
    "log_not_kept": Row(
        ok=linked(),
        fault=linked(log_trouble="The disk is full."),
        unknown="the disk's own report, which is there or not",
    ),
    "recording_stopped": Row(
        ok=taped(state="recording"),
        fault=taped(state="stopped", trouble="Recording stopped: the disk is full."),
        unknown=taped(state="off"),
    ),
    "recorder_behind": Row(
        ok=taped(state="recording", behind_s=0.3),
        fault=taped(state="recording", dropped=3, dropped_s=NOW_S - 1.0),
        unknown=taped(state="off"),
    ),
    "disk_nearly_full": Row(
        ok=taped(state="recording", left_gb=50.0),
        fault=taped(state="recording", left_gb=0.4),
        unknown=taped(state="recording", left_gb=None),
    ),
    "reach": Row(
        ok=with_more(known(speed=DRIVES), reach=ReachFacts(can=1, of=3, why="sound off")),
        fault=with_more(known(speed=DRIVES), reach=ReachFacts()),
        unknown=with_more(known(speed=None), reach=ReachFacts()),
    ),
    "slow_down_unconfirmed": Row(
        ok=slowed(-1.4),
        fault=slowed(-0.2),
        unknown=slowed(-0.2, shown=False, sending_s=NOW_S - 0.4),
    ),
    "slow_down_hold_ended": Row(
        ok=slowed(-1.4), fault=slowed(-1.4, ended_at_longest_s=NOW_S - 1.0), unknown=known(speed=DRIVES)
    ),
    "slow_down_rivals": Row(ok=slowed(-1.4), fault=slowed(-1.4, rivals=("/lap_driver",)), unknown=known(speed=DRIVES)),
    "paused_long": Row(
        ok=known(),
        fault=with_more(known(), paused=True, paused_since_s=NOW_S - 301.0),
        unknown="whether it is paused is always known",
    ),
}

for _path in sorted(Path(__file__).parent.glob("test_*.py")):  # a check may have its row beside its table
    if "\nANSWERS = " in _path.read_text(encoding="utf-8"):
        ROWS |= import_module(f"tests.monitor.checks.{_path.stem}").ANSWERS


def row_of(check_id: str) -> Row:
    family, _, signal = check_id.partition(".")
    row = ROWS[family]
    return row if isinstance(row, Row) else row(signal)


def test_every_check_has_its_row() -> None:
    assert ROWS.keys() == {check.id.partition(".")[0] for check in CHECKS}


@pytest.mark.parametrize("check_id", [check.id for check in CHECKS])
def test_each_answer_is_given(check_id: str) -> None:
    row = row_of(check_id)
    assert ask(check_id, row.ok, **row.limits).verdict is OK
    assert ask(check_id, row.fault, **row.limits).verdict is FAULT
    if isinstance(row.unknown, Snapshot):
        assert ask(check_id, row.unknown, **row.limits).verdict is UNKNOWN
    else:
        assert row.unknown


@pytest.mark.parametrize("check_id", [check.id for check in CHECKS])
@pytest.mark.parametrize("snapshot", [Snapshot(now_s=0.0), known(), Snapshot(now_s=0.0, link=LinkFacts())])
def test_where_nothing_is_known_nothing_is_at_fault(check_id: str, snapshot: Snapshot) -> None:
    assert ask(check_id, snapshot).verdict is not FAULT or check_id == "no_message"
