"""Each act of the lease with all of its fields, and the lease, the requests and the return exactly at their limits."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from server.control.lease import ANSWER_S, LEASE_S, RETURN_S, Act, Control, Lease, NotInControl, Operator
from tests.server.control.test_lease import ANN, BEN, CEM, everybody, held


def requested() -> Control:
    """Ann is in control since 0 s; Ben requests it since 1 s, Cem since 2 s."""
    control = held()
    control.request(BEN, 1.0)
    control.request(CEM, 2.0)
    return control


def last(act: Act | list[Act] | None) -> Act | None:
    return act[-1] if isinstance(act, list) else act


@pytest.mark.parametrize(
    ("do", "change", "by", "holder", "fence", "before"),
    [
        (lambda c: c.take_over(BEN, 3.0), "taken_over", BEN, BEN, 8, ANN),
        (lambda c: c.hand_over(ANN, 7, BEN, 3.0), "granted", ANN, BEN, 8, ANN),
        (lambda c: c.hand_over(ANN, None, CEM, 3.0), "granted", ANN, CEM, 8, ANN),
        (lambda c: c.keep(ANN, 7, CEM.page), "kept", ANN, ANN, 7, None),
        (lambda c: c.withdraw(CEM), "withdrawn", CEM, ANN, 7, None),
        (lambda c: c.release(ANN, 7, 3.0)[:1], "released", ANN, None, None, ANN),
        (lambda c: c.release(ANN, 7, 3.0), "granted", None, BEN, 8, None),
        (lambda c: c.leave(ANN, 3.0)[:1], "lapsed", None, None, None, ANN),
        (lambda c: c.leave(ANN, 3.0), "granted", None, BEN, 8, None),
        (lambda c: c.advance(3.1, everybody)[:1], "lapsed", None, None, None, ANN),
        (lambda c: c.advance(3.1, everybody), "granted", None, BEN, 8, None),
        (lambda c: c.request(Operator(page="d", who="d", name="Dan"), 3.0), "requested", "Dan", ANN, 7, None),
    ],
)
def test_who_did_what_and_who_has_it_by_which_number(
    do: Callable[[Control], Any],
    change: str,
    by: Operator | str | None,
    holder: Operator | None,
    fence: int | None,
    before: Operator | None,
) -> None:
    control = requested()
    act = last(do(control))
    assert act is not None
    assert (act.change, act.holder, act.fence, act.before) == (change, holder, fence, before)
    assert (act.by.name if isinstance(by, str) and act.by else act.by) == by
    if holder is not None and holder != ANN:
        assert control.requests == ()  # a request to the former holder ends
        assert control.lease is not None
        assert control.lease.since_s == control.lease.renewed_s >= 3.0
        assert control.lapsed is None


def test_a_lease_is_renewed_with_its_number_and_its_beginning() -> None:
    control = held()
    assert control.lease == Lease(holder=ANN, fence=7, since_s=0.0, renewed_s=0.0)
    control.present(Operator(page=ANN.page, who=ANN.who, name="Anna"), 2.0)
    assert control.lease is not None
    assert (control.lease.holder.name, control.lease.fence, control.lease.since_s, control.lease.renewed_s) == (
        "Anna",
        7,
        0.0,
        2.0,
    )


def test_it_lapses_at_the_limit_and_names_for_how_long_it_was_silent() -> None:
    control = held()
    assert control.advance(LEASE_S, everybody) == []
    (act,) = control.advance(7.4, everybody)
    assert (act.text.startswith("Ann"), " 7 s" in act.text) == (True, True)
    assert control.lapsed is not None
    assert (control.lapsed.holder, control.lapsed.at_s) == (ANN, 7.4)


def test_only_the_holder_s_page_leaves_and_it_has_control_again_by_coming_back() -> None:
    control = held()
    assert control.leave(BEN, 1.0) == []
    assert control.holder == ANN
    assert [act.change for act in control.leave(ANN, 1.0)] == ["lapsed"]
    assert control.leave(ANN, 1.1) == []
    assert control.present(BEN, 2.0) is None
    act = control.present(ANN, 2.0)
    assert act is not None
    assert (act.change, act.by, act.holder, act.fence, act.before) == ("returned", None, ANN, 8, None)
    assert control.lease == Lease(holder=ANN, fence=8, since_s=2.0, renewed_s=2.0)


@pytest.mark.parametrize(("after_s", "returns"), [(RETURN_S, True), (RETURN_S + 0.001, False)])
def test_the_return_is_over_with_time_alone(after_s: float, returns: bool) -> None:
    control = held()
    control.leave(ANN, 1.0)
    assert control.advance(1.0 + after_s, everybody) == []
    assert (control.lapsed is not None) is returns


@pytest.mark.parametrize(("after_s", "granted"), [(ANSWER_S - 0.001, False), (ANSWER_S, True)])
def test_of_two_who_ask_the_first_has_it_after_its_time(after_s: float, granted: bool) -> None:
    control = requested()
    control.present(ANN, 1.0 + after_s)
    acts = control.advance(1.0 + after_s, everybody)
    assert [(act.change, act.by, act.holder, act.before) for act in acts] == (
        [("granted", None, BEN, ANN)] if granted else []
    )


def test_a_request_of_a_page_that_is_away_is_forgotten_and_the_next_one_counts() -> None:
    control = requested()
    control.present(ANN, 12.0)
    (act,) = control.advance(12.0, lambda one: one != BEN)
    assert act.holder == CEM


def test_what_is_refused_names_the_holder() -> None:
    control = held()
    for act in (lambda: control.take(BEN, 1.0), lambda: control.admit(BEN, None), lambda: control.admit(ANN, 1)):
        with pytest.raises(NotInControl) as refused:
            act()
        assert refused.value.holder == ANN
    for act in (lambda: control.keep(BEN, 7, CEM.page), lambda: control.release(BEN, 7, 1.0)):
        with pytest.raises(NotInControl) as refused:
            act()
        assert (refused.value.holder, refused.value.reason) == (ANN, "Ann is in control.")
    free = Control()
    with pytest.raises(NotInControl) as refused:
        free.release(ANN, None, 1.0)
    assert (refused.value.holder, refused.value.reason) == (None, "Nobody is in control.")
    with pytest.raises(NotInControl) as refused:
        free.admit_fence(0)
    assert refused.value.holder is None


def test_handed_to_itself_nothing_happens() -> None:
    control = requested()
    assert control.hand_over(ANN, 7, ANN, 3.0) is None
    assert [one.of for one in control.requests] == [BEN, CEM]
    assert [one.asked_s for one in control.requests] == [1.0, 2.0]


def test_a_kept_or_withdrawn_request_leaves_the_others() -> None:
    control = requested()
    control.keep(ANN, 7, BEN.page)
    assert [one.of for one in control.requests] == [CEM]
    control = requested()
    control.withdraw(CEM)
    assert [one.of for one in control.requests] == [BEN]


def test_nobody_is_the_same_as_somebody() -> None:
    assert not ANN.is_same(None)
    assert ANN.is_same(Operator(page=ANN.page, who=ANN.who, name="another name"))
