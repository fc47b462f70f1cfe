"""The exact texts and numbers of each check's findings, kept in findings.json.

Where a change is meant, `python -m tests.monitor.checks.test_findings` writes the file anew: read the difference.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path
from typing import Any, get_args

import pytest

from monitor.car_clock import ClockJump
from monitor.catalog import CHECKS
from monitor.check import Finding
from monitor.phones import Why
from monitor.reading import Unusable
from monitor.shell_facts import ReachFacts
from monitor.slow_proof import SlowProof
from monitor.snapshot import Snapshot
from monitor.values import Bearing, Effort, Level, Twist
from tests.monitor.checks.known import ask, known
from tests.monitor.checks.test_obstacle import before, estimated
from tests.monitor.checks.test_obstacle import seen as ahead
from tests.monitor.checks.test_phone import view
from tests.monitor.checks.test_three_answers import (
    DRIVES,
    FIX,
    NOW_S,
    STANDS,
    all_rates,
    clock,
    diagnosed,
    late,
    linked,
    ran,
    rode,
    row_of,
    seen,
    slowed,
    taped,
    useless,
    with_more,
)

KEPT = Path(__file__).with_name("findings.json")


NOT_MEASURED = Unusable(
    reason="not measured (why)", at_s=NOW_S, since_s=NOW_S - 9.0, count=200, horizon_s=1.0, is_declared=True
)


def one_fewer() -> Snapshot:
    return known(scan=replace(seen(20.0), ranges_m=seen(20.0).ranges_m[:-1]))


PROOFS = {
    "stands as ordered": SlowProof(ordered_s=NOW_S - 2.0, shown="stopped", shown_s=NOW_S),
    "stood already": SlowProof(ordered_s=NOW_S - 2.0, stood_before=True),
    "stands unproven": SlowProof(ordered_s=NOW_S - 2.0),
    "stands after another order": SlowProof(ordered_s=NOW_S - 9.0, shown="stopped"),
}
MORE: dict[str, dict[str, Snapshot]] = {
    "reach": {
        "stands": with_more(known(speed=STANDS), reach=ReachFacts(can=0, of=2, why="sound off")),
        "not monitored": known(),
        "old speed": with_more(known(age_s=2.0, speed=DRIVES), reach=ReachFacts()),
        "reversing": with_more(known(speed=Twist(speed_mps=-3.0)), reach=ReachFacts(can=0, of=1, why="no contact")),
    },
    "slow_down_unconfirmed": {
        "not sent": slowed(0.0, sending_s=None),
        "nothing commanded": slowed(0.0, commanded_mps=None),
        "no speed yet": with_more(slowed(0.0, sending_s=NOW_S - 0.4), readings={}),
        "no speed": with_more(slowed(0.0), readings={}),
        "not shown": slowed(-1.4, shown=False),
        "follows": slowed(0.0, commanded_mps=4.8),
        "too few speeds": with_more(slowed(0.0), speed_slope_mps2=None),
        "shown of late": with_more(
            slowed(0.0), slow_proof=SlowProof(ordered_s=NOW_S - 2.0, shown="slows", shown_s=NOW_S)
        ),
        **{name: with_more(slowed(0.0), slow_proof=one, standing_since_s=NOW_S) for name, one in PROOFS.items()},
    },
    "slow_down_rivals": {"four": slowed(0.0, rivals=("/a", "/b", "/c", "/d")), "two": slowed(0.0, rivals=("/a", "/b"))},
    "slow_down_hold_ended": {
        "just over": slowed(0.0, ended_at_longest_s=NOW_S - 60.0, ordered_s=NOW_S - 700.0),
        "not reported any more": slowed(0.0, ended_at_longest_s=NOW_S - 1000.0, ordered_s=None),
    },
    "phone_missing": {why: rode(why=why, usable_s=NOW_S - 11.0) for why in get_args(Why)},
    "phone_car": {"no car": with_more(known(), phone=view()), "nobody": known(position=FIX)},
    "phone_tracks": {"nobody": known(position=FIX)},
    "obstacle": {
        "not published": known(),
        "comes": before(ahead(15.0, 5.0), 20.0),
        "ahead as fast": before(ahead(9.6, 5.0), 9.6),
        "speed unknown": ahead(4.0, None),
        "speed not a number": ahead(4.0, math.nan),
        "nothing": ahead(None),
    },
    "obstacle_nearest": {
        "not published": known(),
        "comes": before(estimated(15.0, 5.0), 20.0),
        "left": estimated(4.2, 0.0, bearing=Bearing(bearing_rad=0.3)),
        "straight": estimated(4.2, 0.0, bearing=Bearing(bearing_rad=0.03)),
        "bearing not a number": estimated(4.2, 0.0, bearing=Bearing(bearing_rad=math.nan)),
        "nothing": estimated(None),
        "not a number": estimated(math.nan),
    },
    "gps_fix": {
        "error too large": known(position=replace(FIX, sigma_m=30.0)),
        "no error reported": known(position=replace(FIX, sigma_m=None)),
        "no place": known(position=replace(FIX, lat_deg=math.nan)),
        "not set": known(position=replace(FIX, lat_deg=math.nan, lon_deg=math.nan, status=-1, is_unset=True)),
    },
    "signal_unusable.acceleration": {
        "not measured": replace(known(), unusable={"acceleration": NOT_MEASURED}),
    },
    "gps_jump": {
        "just": ran(3.1),
        "no speed": with_more(ran(23.0), readings={"position": ran(23.0).readings["position"]}),
    },
    "clock_offset": {"behind": clock(-60.0), "just": clock(5.1), "jumped": known(position=FIX)},
    "clock_jump": {
        "ahead": with_more(
            clock(0.0), clock_jump=ClockJump(at_s=NOW_S - 1.0, by_s=30.0, signals=("position", "speed"))
        ),
        "long ago": with_more(clock(0.0), clock_jump=ClockJump(at_s=NOW_S - 99.0, by_s=30.0, signals=("position",))),
    },
    "no_message": {
        "with a hint": linked(
            connected_s=NOW_S - 9.0, last_message_s=None, behind_title="It waits.", behind_hint="Start it."
        ),
        "not connected": linked(phase="connecting"),
    },
    "link_late": {"just": late(1.05), "lost": linked(phase="lost", late_s=2.0)},
    "all_slow": {"two of four": all_rates(9.0, 9.0, 20.0, 20.0), "all": all_rates(9.0, 8.0, 7.0, 6.0)},
    "diagnostics_error": {"several": diagnosed(2, 2, 3, 0), "none": diagnosed()},
    "diagnostics_warn": {"several": diagnosed(1, 1, 1, 1, 3)},
    "fuel_low": {
        "not a number": known(fuel=Level(value=math.nan, unit="%")),
        "at the limit": known(fuel=Level(value=10.0, unit="%")),
        "above it": known(fuel=Level(value=11.0, unit="%")),
        "empty": known(fuel=Level(value=0.0, unit="%")),
    },
    "car_unusable": {"two": useless("speed", "brake", for_s=1.5)},
    "recorder_behind": {"behind": taped(state="recording", behind_s=3.0)},
    "disk_nearly_full": {"full": taped(state="held", left_gb=0.0, limit="0.5 GB must stay free")},
    "paused_long": {
        f"{minutes} min": with_more(known(), paused=True, paused_since_s=NOW_S - 60.0 * minutes)
        for minutes in (4, 5, 10, 14, 15, 30, 60, 120)
    },
    "scan_shape": {
        "one beam fewer": replace(one_fewer(), scan_habit=frozenset({0})),
        "one beam fewer, as always": replace(one_fewer(), scan_habit=frozenset({-1})),
        "one beam fewer, or as many": replace(one_fewer(), scan_habit=frozenset({-1, 0})),
        "one beam fewer, at first": one_fewer(),
        "two fewer": known(scan=replace(seen(20.0), ranges_m=seen(20.0).ranges_m[:-2])),
        "step not a number": known(scan=replace(seen(20.0), angle_increment_rad=math.nan)),
    },
    "speed_limit": {"not a number": known(speed=Twist(speed_mps=math.nan))},
    "pedals": {"not a number": known(brake=Effort(percent=math.nan), accelerator=Effort(percent=1.0))},
    "not_moving": {"just": with_more(known(speed=STANDS), standing_since_s=NOW_S - 10.0), "short": known(speed=STANDS)},
}


def snapshot_of(check_id: str, answer: str) -> Snapshot | None:
    """None where a check has no such answer."""
    more = MORE.get(check_id, {})
    found = more[answer] if answer in more else getattr(row_of(check_id), answer)
    return found if isinstance(found, Snapshot) else None


def as_row(finding: Finding) -> list[Any]:
    """Short enough for a line: verdict, text, brief, what was measured, against what, causes, level, applies."""
    measured, limit = (
        None if quantity is None else list(asdict(quantity).values()) for quantity in (finding.measured, finding.limit)
    )
    return [
        finding.verdict.value,
        finding.text,
        finding.brief,
        measured,
        limit,
        list(finding.causes),
        finding.level,
        finding.applies,
    ]


def deck() -> Iterator[tuple[str, str]]:
    """Each check and its answers; of a family of signals one."""
    families = set()
    for check in CHECKS:
        family = check.id.partition(".")[0]
        if family not in families:
            families.add(family)
            for answer in ("ok", "fault", "unknown", *MORE.get(check.id, {})):
                if snapshot_of(check.id, answer) is not None:
                    yield check.id, answer


def found(check_id: str, answer: str) -> dict[str, list[Any]]:
    """By name; while the alarm is active only what is found otherwise then."""
    row, name = row_of(check_id), f"{check_id} {answer}"
    snapshot = snapshot_of(check_id, answer)
    assert snapshot is not None
    usual, active = (
        as_row(ask(check_id, snapshot, was_active=was_active, **row.limits)) for was_active in (False, True)
    )
    return {name: usual} if active == usual else {name: usual, f"{name} active": active}


@cache
def kept() -> dict[str, list[Any]]:
    rows: dict[str, list[Any]] = json.loads(KEPT.read_text(encoding="utf-8"))
    return rows


def test_each_of_them_is_kept_and_no_other() -> None:
    assert {name.removesuffix(" active") for name in kept()} == {" ".join(names) for names in deck()}


@pytest.mark.parametrize(("check_id", "answer"), list(deck()))
def test_what_is_found(check_id: str, answer: str) -> None:
    name = f"{check_id} {answer}"
    assert found(check_id, answer) == {one: row for one, row in kept().items() if one in (name, f"{name} active")}


if __name__ == "__main__":
    everything = {name: row for names in deck() for name, row in found(*names).items()}
    lines = (f"{json.dumps(name)}: {json.dumps(row, ensure_ascii=False)}" for name, row in everything.items())
    KEPT.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
