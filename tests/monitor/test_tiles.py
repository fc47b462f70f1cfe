"""The tiles of the home tab: the worst of what they stand for, in few letters."""

from __future__ import annotations

from dataclasses import replace

import pytest

from monitor.check import OK, Check, Finding, Limits, Verdict, absent, fault, ok, unknown
from monitor.tiles import places, tiles
from tests.monitor.test_alarm import SPEC

A, B, C = (
    Check(id=name, label=name.upper(), tile="Signals", alarm=SPEC, limits=Limits, find=lambda *_: OK) for name in "abc"
)

FAULT_1, FAULT_2 = fault("a is bad", brief="a 3 s"), fault("b is bad", brief="b 9 s")
HUH, HUH_2 = unknown("a is old", short="stale"), unknown("b is old", short="stale")
NONE = absent("c is not published")


@pytest.mark.parametrize(
    ("findings", "verdict", "brief", "text"),
    [
        pytest.param([OK, OK, OK], "ok", "OK", "OK", id="all the same"),
        pytest.param([ok("1 m"), ok("2 m"), NONE], "ok", "OK", "All 2 OK", id="what is absent does not count"),
        pytest.param([NONE, NONE, NONE], "unknown", "not published", "c is not published", id="nothing but absent"),
        pytest.param([OK, FAULT_1, HUH], "fault", "FAULT: a 3 s", "a is bad", id="one fault has its own text"),
        pytest.param([FAULT_1, FAULT_2, OK], "fault", "FAULT 2 of 3", "a is bad; b is bad", id="two are counted"),
        pytest.param([OK, HUH, OK], "unknown", "not checked: stale", "a is old", id="not checked beats good"),
        pytest.param([HUH, HUH_2, OK], "unknown", "not checked: stale", "a is old; b is old", id="one reason"),
        pytest.param(
            [HUH, unknown("b waits", short="waiting"), OK],
            "unknown",
            "not checked: 2 of 3",
            "a is old; b waits",
            id="several reasons",
        ),
        pytest.param([OK, OK], "unknown", "not checked", "Not checked yet", id="one was never run"),
    ],
)
def test_the_worst_speaks(findings: list[Finding], verdict: str, brief: str, text: str) -> None:
    found = dict(zip("abc", findings, strict=False))
    (tile,) = tiles(places((A, B, C)), found)
    assert (tile.verdict, tile.brief, tile.text) == (Verdict(verdict), brief, text)
    assert (tile.id, tile.label, tile.checks) == ("signals", "Signals", ("a", "b", "c"))


def test_each_label_is_a_tile_in_the_order_of_the_checks() -> None:
    checks = (replace(B, tile="GPS drift"), A, replace(C, tile=""))
    assert [(tile.id, tile.label) for tile in tiles(places(checks), {})] == [
        ("gps_drift", "GPS drift"),
        ("signals", "Signals"),
        ("c", "C"),
    ]


def test_no_brief_is_longer_than_its_tile() -> None:
    many = tuple(replace(A, id=str(n)) for n in range(100))
    (tile,) = tiles(places(many), {str(n): unknown(f"{n}", short=f"no {n % 3}") for n in range(100)})
    assert tile.brief == "not checked"
    assert len(fault("", brief="Accelerator 3599 seconds").brief) <= 21
    assert len(unknown("", short="something long").brief) <= 21
