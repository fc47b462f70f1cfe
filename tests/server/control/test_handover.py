"""A hand-over of control with read-back: what has to be confirmed, and what ends an offer; in virtual time."""

from __future__ import annotations

from dataclasses import replace

import pytest

from monitor.runner import Refused
from server.control.handover import AWAY_S, LASTS_S, Handover, Line, NotReadBack, version_of
from server.control.lease import Lease, Operator

ANN, BEN, CEM = (Operator(page=f"page-{name}", who=name, name=name.capitalize()) for name in ("ann", "ben", "cem"))
LEASE = Lease(holder=ANN, fence=7, since_s=0.0, renewed_s=0.0)
SPEED = Line(key="alarm:speed:1", kind="alarm", title="Speed limit exceeded")
LIMIT = Line(key="limit:speed:12", kind="limit", title="Speed limit: 12 m/s")
LINES = [SPEED, LIMIT]


@pytest.fixture
def offered() -> Handover:
    handover = Handover()
    assert handover.begin(ANN, LEASE, BEN, 0.0)
    return handover


def test_only_the_holder_offers_and_not_to_itself() -> None:
    for by, lease, to in ((BEN, LEASE, CEM), (ANN, None, BEN), (ANN, LEASE, ANN)):
        with pytest.raises(Refused):
            Handover().begin(by, lease, to, 0.0)


def test_every_line_is_read_back_before_control_changes(offered: Handover) -> None:
    with pytest.raises(NotReadBack, match="2 lines are not read back yet: Speed limit exceeded"):
        offered.accept(BEN, version_of(LINES), LINES)
    offered.read(BEN, SPEED.key, True, LINES)
    with pytest.raises(NotReadBack, match="One line is"):
        offered.accept(BEN, version_of(LINES), LINES)
    offered.read(BEN, LIMIT.key, True, LINES)
    offered.read(BEN, SPEED.key, False, LINES)
    assert offered.unread(LINES) == [SPEED]
    offered.read(BEN, SPEED.key, True, LINES)
    assert offered.accept(BEN, version_of(LINES), LINES).by == ANN
    assert offered.offer is None


def test_a_new_alarm_is_read_back_too(offered: Handover) -> None:
    for line in LINES:
        offered.read(BEN, line.key, True, LINES)
    again = [replace(SPEED, key="alarm:speed:2"), LIMIT]  # another occurrence of the same alarm
    with pytest.raises(NotReadBack, match="One line"):
        offered.accept(BEN, version_of(LINES), again)


def test_a_list_that_changed_is_not_accepted_by_its_old_version(offered: Handover) -> None:
    for line in LINES:
        offered.read(BEN, line.key, True, LINES)
    with pytest.raises(NotReadBack, match="has changed meanwhile"):
        offered.accept(BEN, version_of(LINES), [LIMIT])  # an alarm ended: fewer lines, all of them read
    assert offered.accept(BEN, version_of([LIMIT]), [LIMIT]).to == BEN


def test_only_the_taker_reads_back(offered: Handover) -> None:
    for by in (ANN, CEM):
        with pytest.raises(Refused, match="not offered to this page"):
            offered.read(by, SPEED.key, True, LINES)
        with pytest.raises(Refused):
            offered.accept(by, version_of([]), [])
    with pytest.raises(NotReadBack, match="no longer applies"):
        offered.read(BEN, "alarm:gone:1", True, LINES)
    with pytest.raises(Refused):
        offered.end(CEM)
    assert offered.end(BEN).by == ANN


def test_the_text_of_a_measured_value_does_not_change_the_version() -> None:
    assert version_of(LINES) == version_of([LIMIT, replace(SPEED, text="12.1 of 11.0 m/s")])
    assert version_of(LINES) != version_of([SPEED])


def test_an_offer_ends_with_the_lease_it_is_of(offered: Handover) -> None:
    assert offered.advance(LEASE, lambda _: True, 1.0) is None
    ended = offered.advance(replace(LEASE, fence=8), lambda _: True, 2.0)
    assert ended == "The hand-over to Ben ended: Ann is not in control any more."
    assert offered.advance(LEASE, lambda _: True, 3.0) is None


def test_an_offer_ends_where_the_taker_is_away(offered: Handover) -> None:
    assert offered.advance(LEASE, lambda _: False, AWAY_S) is None
    assert "away" in (offered.advance(LEASE, lambda _: False, AWAY_S + 0.1) or "")


def test_an_offer_does_not_last_for_ever(offered: Handover) -> None:
    assert offered.advance(LEASE, lambda _: True, LASTS_S) is None
    assert "10 min" in (offered.advance(LEASE, lambda _: True, LASTS_S + 0.1) or "")
