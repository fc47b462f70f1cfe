"""The cause table: which alarm explains which, and for how long."""

from __future__ import annotations

from dataclasses import replace

import pytest

from monitor.alarm import Alarm
from monitor.inhibition import GRACE_S, UNSEEN_S, CauseTable
from tests.monitor.test_alarm import SPEC

TABLE = {"slow": ("stale",), "stale": ("silent",), "silent": ("lost",), "lost": (), "speed": ()}
LOST = Alarm(id="lost", spec=SPEC, condition=True, active=True)
GONE = replace(LOST, condition=False, active=False)
WAITS = replace(LOST, active=False)  # for its on-delay
GRACES = {"lost": GRACE_S}


def test_causes_of_causes_count_and_come_first() -> None:
    table = CauseTable(TABLE)
    assert table.order.index("lost") < table.order.index("silent") < table.order.index("stale")
    assert table.inhibitors == {"stale", "silent", "lost"}
    table.note(LOST, 0.0)
    assert [table.holding(name, 0.0) for name in ("slow", "stale", "silent", "lost", "speed")] == [
        ("lost",),
        ("lost",),
        ("lost",),
        (),
        (),
    ]


@pytest.mark.parametrize(("after_s", "holds"), [(0.0, True), (GRACE_S - 0.01, True), (GRACE_S, False)])
def test_the_consequences_get_a_grace_to_go_too(after_s: float, holds: bool) -> None:
    table = CauseTable(TABLE, GRACES)
    table.note(LOST, 9.0)
    table.note(GONE, 10.0)
    assert bool(table.holding("stale", 10.0 + after_s)) == holds


def test_it_holds_by_its_condition_whatever_its_own_delays() -> None:
    table = CauseTable(TABLE)
    table.note(WAITS, 10.0)
    assert table.holding("stale", 10.0) == ("lost",)
    table.note(replace(GONE, active=True), 11.0)  # still active: waits out its off-delay
    assert table.holding("stale", 11.0) == ()


def test_without_a_grace_a_danger_that_is_seen_again_waits_for_nothing() -> None:
    table = CauseTable(TABLE)
    table.note(LOST, 10.0)
    table.note(GONE, 10.1)
    assert table.holding("stale", 10.1) == ()


def test_the_grace_counts_from_the_end_of_the_condition() -> None:
    table = CauseTable(TABLE, GRACES)
    table.note(LOST, 10.0)
    assert table.holding("stale", 99.0) == ("lost",)
    for now_s in (99.0, 100.0, 101.9):
        table.note(GONE, now_s)
        assert table.holding("stale", now_s) == ("lost",)
    assert table.holding("stale", 102.0) == ()


def test_what_never_happened_explains_nothing() -> None:
    table = CauseTable(TABLE)
    table.note(GONE, 10.0)
    assert table.holding("stale", 10.0) == ()


def test_a_clock_that_goes_back_does_not_make_the_grace_last_for_ever() -> None:
    table = CauseTable(TABLE, GRACES)
    table.note(LOST, 1e6 - 1.0)
    table.note(GONE, 1e6)
    table.note(GONE, 5.0)
    assert table.holding("stale", 5.0) == ("lost",)
    table.note(GONE, 5.0 + GRACE_S)
    assert table.holding("stale", 5.0 + GRACE_S) == ()


def test_a_condition_that_comes_and_goes_unannounced_explains_for_a_bounded_time() -> None:
    table = CauseTable(TABLE, GRACES, {"lost": 1.0})

    def holds(at_s: float) -> bool:
        table.note(WAITS if round(10 * at_s) % 10 < 8 else GONE, at_s)  # 0.8 s of each second
        return bool(table.holding("stale", at_s))

    held = [holds(tenth / 10) for tenth in range(600)]
    assert held == [tenth / 10 <= 1.0 + UNSEEN_S for tenth in range(600)]
    table.note(LOST, 60.0)  # it is announced: what it explains is hidden for as long as it stands
    assert table.holding("stale", 99.0) == ("lost",)
    table.note(GONE, 100.0)
    over_s = 100.0 + UNSEEN_S + GRACE_S
    table.note(GONE, over_s)
    table.note(WAITS, over_s)
    assert table.holding("stale", over_s) == ("lost",), "it was over: it begins anew"


@pytest.mark.parametrize("off_s", [3.0, 3.5, 6.0, 8.0, 10.9, 11.0, 15.0])
def test_a_pause_frees_all_that_it_explains_for_the_longest_delay_or_does_not_count(off_s: float) -> None:
    table = CauseTable(TABLE, GRACES, {"lost": 1.0, "slow": 5.0})
    free_s = longest_s = 0.0
    for tenth in range(1_000):
        at_s = tenth / 10
        table.note(WAITS if at_s % (0.8 + off_s) < 0.8 else GONE, at_s)
        free_s = 0.0 if table.holding("slow", at_s) else free_s + 0.1
        longest_s = max(longest_s, free_s)
    assert longest_s > 5.0


def test_what_is_explained_itself_explains_for_as_long() -> None:
    table = CauseTable(TABLE, GRACES)
    table.note(replace(WAITS, suppressed_by=("link",)), 10.0)
    assert table.holding("stale", 99.0) == ("lost",)
    table.note(WAITS, 99.0)
    assert table.holding("stale", 99.0 + UNSEEN_S) == ("lost",)
    assert table.holding("stale", 99.1 + UNSEEN_S) == ()


def test_cleared_it_knows_nothing() -> None:
    table = CauseTable(TABLE)
    table.note(LOST, 10.0)
    table.clear()
    assert table.holding("stale", 10.0) == ()


@pytest.mark.parametrize(
    ("table", "reason"),
    [
        ({"a": ("b",), "b": ("a",)}, "circle: a → b → a"),
        ({"a": ("a",)}, "circle"),
        ({"a": ("b",)}, "b, which does not exist"),
    ],
)
def test_a_table_that_makes_no_sense_is_refused(table: dict[str, tuple[str, ...]], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        CauseTable(table)
