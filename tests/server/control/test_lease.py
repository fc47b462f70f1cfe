"""The lease of control: by table, and by any course of events at all."""

from __future__ import annotations

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from monitor.runner import Refused
from server.control.lease import ANSWER_S, LEASE_S, MOST_REQUESTS, RETURN_S, Act, Control, NotInControl, Operator

ANN, BEN, CEM = (
    Operator(page=f"page-{letter}", who=f"phone-{letter}", name=name)
    for letter, name in (("a", "Ann"), ("b", "Ben"), ("c", "Cem"))
)


def everybody(_: Operator) -> bool:
    return True


def nobody(_: Operator) -> bool:
    return False


def held(fence: int = 6) -> Control:
    """Ann took control at 0 s."""
    control = Control(fence)
    act = control.take(ANN, 0.0)
    assert act is not None
    assert (act.change, act.text, act.fence, act.holder) == ("taken", "Ann is in control.", fence + 1, ANN)
    return control


def changes(acts: list[Act]) -> list[str]:
    return [act.change for act in acts]


# -- orders ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("fence", [7, None])
def test_the_holder_s_order_counts(fence: int | None) -> None:
    held().admit(ANN, fence)


@pytest.mark.parametrize("fence", [6, 8, 0])
def test_an_order_of_another_lease_is_refused_even_the_holder_s_own(fence: int) -> None:
    with pytest.raises(NotInControl, match="Control changed since this command: check, then send it again"):
        held().admit(ANN, fence)


@pytest.mark.parametrize("fence", [7, None])
def test_another_page_s_order_is_refused_and_names_who_is_in_control(fence: int | None) -> None:
    with pytest.raises(NotInControl) as refused:
        held().admit(BEN, fence)
    assert refused.value.reason == "Ann is in control."
    assert refused.value.holder == ANN


@pytest.mark.parametrize(
    "other",
    [
        Operator(page="page-a", who="phone-b", name="Ann"),  # another device that gives itself the page's name
        Operator(page="page-b", who="phone-a", name="Ann"),  # another page of the same device
    ],
)
def test_a_name_is_no_proof(other: Operator) -> None:
    with pytest.raises(NotInControl):
        held().admit(other, 7)


def test_where_nobody_is_in_control_an_order_counts_but_not_an_old_one() -> None:
    control = held()
    control.admit(ANN, 7)
    control.release(ANN, 7, 1.0)
    control.admit(BEN, None)
    with pytest.raises(NotInControl):
        control.admit(ANN, 7)  # it hung in the radio while control was given up


# -- time --------------------------------------------------------------------------------------------------------------


def test_a_page_that_is_seen_keeps_it_and_a_silent_one_loses_it_after_3_s() -> None:
    control = held()
    for at_s in (1.0, 2.0, 3.0, 4.0):
        assert control.advance(at_s, everybody) == []
        assert control.present(ANN, at_s) is None
    assert control.advance(4.0 + LEASE_S, everybody) == []
    (act,) = control.advance(4.01 + LEASE_S, everybody)
    assert (act.change, act.holder, act.fence, act.before) == ("lapsed", None, None, ANN)
    assert act.text == "Ann fell silent for 3 s: nobody is in control."
    assert control.lease is None


def test_another_page_s_status_renews_nothing() -> None:
    control = held()
    control.present(BEN, 2.9)
    assert changes(control.advance(3.1, everybody)) == ["lapsed"]


@pytest.mark.parametrize(("back_s", "again"), [(0.1, True), (RETURN_S, True), (RETURN_S + 0.01, False)])
def test_the_former_holder_back_within_30_s_has_it_again_by_another_number(back_s: float, again: bool) -> None:
    control = held()
    control.advance(4.0, everybody)
    control.advance(4.0 + back_s, everybody)
    act = control.present(ANN, 4.0 + back_s)
    assert (act is not None) is again
    if act is not None:
        assert (act.change, act.holder, act.fence) == ("returned", ANN, 8)
        assert act.text == f"Ann is back after {back_s + 3:.0f} s and in control again: nobody else had taken it."


def test_with_somebody_in_between_it_does_not_return() -> None:
    control = held()
    control.advance(4.0, everybody)
    assert control.take(BEN, 5.0) is not None
    control.release(BEN, None, 6.0)
    control.advance(7.0, everybody)
    assert control.present(ANN, 7.0) is None
    assert control.holder is None


def test_nobody_returns_to_what_was_given_up() -> None:
    control = held()
    assert changes(control.release(ANN, 7, 1.0)) == ["released"]
    assert control.present(ANN, 2.0) is None


# -- take, take over ---------------------------------------------------------------------------------------------------


def test_what_somebody_has_is_not_taken_but_taken_over() -> None:
    control = held()
    with pytest.raises(NotInControl, match="Ann is in control: request control, or take it over"):
        control.take(BEN, 1.0)
    act = control.take_over(BEN, 1.0)
    assert act is not None
    assert (act.change, act.text, act.by, act.before) == (*("taken_over", "Ben took control over from Ann.", BEN, ANN),)
    with pytest.raises(NotInControl):
        control.admit(ANN, 7)
    control.admit(BEN, 8)


def test_after_a_lapse_anybody_takes_it_at_once() -> None:
    control = held()
    control.advance(3.1, everybody)
    act = control.take(BEN, 3.1)
    assert act is not None
    assert act.fence == 8


def test_to_take_what_one_has_is_nothing_new() -> None:
    control = held()
    assert control.take(ANN, 1.0) is None
    assert control.take_over(ANN, 1.0) is None
    assert control.request(ANN, 1.0) is None
    assert control.lease is not None
    assert control.lease.fence == 7


# -- requests ----------------------------------------------------------------------------------------------------------


def kept_alive(control: Control, until_s: float, holder: Operator = ANN) -> list[Act]:
    acts = []
    for tenth in range(int(until_s * 10) + 1):
        acts += control.advance(tenth / 10, everybody)
        if control.holder == holder:
            control.present(holder, tenth / 10)
    return acts


def test_silence_grants_after_10_s_and_not_before() -> None:
    control = held()
    requested = control.request(BEN, 0.0)
    assert requested is not None
    assert (requested.change, requested.text, requested.holder) == ("requested", "Ben requests control from Ann.", ANN)
    assert control.request(BEN, 1.0) is None  # once
    assert kept_alive(control, ANSWER_S - 0.1) == []
    (act,) = control.advance(ANSWER_S, everybody)
    assert (act.change, act.holder, act.before, act.fence) == ("granted", BEN, ANN, 8)
    assert act.text == "Ben is in control: Ann did not answer within 10 s."


def test_the_holder_keeps_it_and_the_request_is_over() -> None:
    control = held()
    control.request(BEN, 0.0)
    act = control.keep(ANN, 7, BEN.page)
    assert (act.change, act.text) == ("kept", "Ann keeps control; the request of Ben was declined.")
    assert kept_alive(control, 12.0) == []
    with pytest.raises(Refused, match="Nobody is requesting control now"):
        control.keep(ANN, 7, BEN.page)


def test_the_holder_hands_it_over_to_who_requested_it_or_to_another() -> None:
    control = held()
    control.request(BEN, 0.0)
    granted = control.hand_over(ANN, 7, BEN, 1.0)
    assert granted is not None
    assert (granted.change, granted.holder) == ("granted", BEN)
    given = control.hand_over(BEN, 8, CEM, 2.0)
    assert given is not None
    assert (given.change, given.text, given.fence) == ("handed_over", "Ben handed control over to Cem.", 9)


def test_a_request_ends_with_the_page_that_made_it_or_when_it_is_taken_back() -> None:
    control = held()
    control.request(BEN, 0.0)
    control.advance(1.0, nobody)
    assert control.requests == ()
    control.request(BEN, 1.0)
    act = control.withdraw(BEN)
    assert act is not None
    assert act.text == "Ben cancelled the request for control."
    assert control.withdraw(BEN) is None


@pytest.mark.parametrize("end", ["lapse", "release"])
def test_who_requested_it_has_it_where_the_holder_leaves(end: str) -> None:
    control = held()
    control.request(BEN, 2.0)
    control.request(CEM, 2.5)
    acts = control.advance(3.1, everybody) if end == "lapse" else control.release(ANN, 7, 3.1)
    assert changes(acts) == ["lapsed" if end == "lapse" else "released", "granted"]
    assert control.holder == BEN
    assert control.requests == ()  # Cem would have to ask Ben


def test_a_request_where_nobody_is_in_control_takes_it() -> None:
    act = Control().request(BEN, 0.0)
    assert act is not None
    assert act.change == "taken"


def test_so_many_ask_and_no_more() -> None:
    control = held()
    for number in range(MOST_REQUESTS):
        control.request(Operator(page=f"page-{number}", who="x", name="X"), 0.0)
    with pytest.raises(NotInControl, match="8 operators are already asking Ann"):
        control.request(BEN, 0.0)


@pytest.mark.parametrize("act", ["hand_over", "keep", "release"])
@pytest.mark.parametrize(("by", "fence"), [(BEN, 7), (BEN, None), (ANN, 6)])
def test_only_the_holder_gives(act: str, by: Operator, fence: int | None) -> None:
    control = held()
    control.request(BEN, 0.0)
    acts = {
        "hand_over": lambda: control.hand_over(by, fence, CEM, 1.0),
        "keep": lambda: control.keep(by, fence, BEN.page),
        "release": lambda: control.release(by, fence, 1.0),
    }
    with pytest.raises(NotInControl):
        acts[act]()


# -- any course of events ----------------------------------------------------------------------------------------------

people = st.sampled_from([ANN, BEN, CEM])


class AnyCourse(RuleBasedStateMachine):
    """A model that knows only when each page was last seen and which number was given to whom."""

    def __init__(self) -> None:
        super().__init__()
        self.now_s = 0.0
        self.control = Control(41)
        self.given: dict[int, Operator] = {}
        self.seen_s: dict[Operator, float] = {}
        self.asleep: set[Operator] = set()

    def note(self, act: Act | None) -> None:
        if act is None:
            return
        if act.holder is not None and act.fence not in self.given:
            assert act.fence is not None
            assert act.fence > max(self.given, default=41)  # numbers only grow
            self.given[act.fence] = act.holder
            self.seen_s[act.holder] = self.now_s
        if act.fence is not None:
            assert self.given[act.fence] == act.holder  # one number, one holder

    def is_here(self, one: Operator) -> bool:
        return one not in self.asleep

    @rule(seconds=st.sampled_from([0.0, 0.1, 0.5, 1.0, 2.9, 3.0, 3.1, 10.0, 29.0, 31.0]))
    def time_passes(self, seconds: float) -> None:
        self.now_s += seconds
        before = self.control.holder
        requested = [request.of for request in self.control.requests if self.is_here(request.of)]
        acts = self.control.advance(self.now_s, self.is_here)
        assert not acts or acts[-1].holder == self.control.holder
        for act in acts:
            self.note(act)
            assert act.change in ("lapsed", "granted")
            assert act.change != "granted" or act.holder == requested[0]
        if before is not None and self.control.holder == before:
            assert self.now_s - self.seen_s[before] <= LEASE_S

    @rule(one=people)
    def sleeps(self, one: Operator) -> None:
        self.asleep.add(one)

    @rule(one=people)
    def is_seen(self, one: Operator) -> None:
        self.asleep.discard(one)
        was, lapsed = self.control.holder, self.control.lapsed
        act = self.control.present(one, self.now_s)
        self.note(act)
        if act is not None:
            assert act.holder == self.control.holder == one
            assert was is None
            assert lapsed is not None
            assert lapsed.holder == one
            assert self.now_s - lapsed.at_s <= RETURN_S + 31.0  # since the last look at the time
        if one == self.control.holder:
            self.seen_s[one] = self.now_s

    @rule(one=people)
    def takes(self, one: Operator) -> None:
        was = self.control.holder
        try:
            self.note(self.control.take(one, self.now_s))
        except NotInControl:
            assert was not in (None, one)
        else:
            assert self.control.holder == one

    @rule(one=people)
    def takes_over(self, one: Operator) -> None:
        self.note(self.control.take_over(one, self.now_s))
        assert self.control.holder == one

    @rule(one=people)
    def requests(self, one: Operator) -> None:
        was = self.control.holder
        self.note(self.control.request(one, self.now_s))
        assert self.control.holder == (one if was is None else was)

    @rule(one=people, to=people, fence=st.one_of(st.none(), st.integers(40, 60)))
    def hands_over(self, one: Operator, to: Operator, fence: int | None) -> None:
        was = self.control.lease
        try:
            self.note(self.control.hand_over(one, fence, to, self.now_s))
        except NotInControl:
            assert was is None or was.holder != one or fence not in (None, was.fence)
            assert self.control.lease == was
        else:
            assert self.control.holder == to

    @rule(one=people, fence=st.one_of(st.none(), st.integers(40, 60)))
    def gives_up(self, one: Operator, fence: int | None) -> None:
        try:
            for act in self.control.release(one, fence, self.now_s):
                self.note(act)
        except NotInControl:
            pass
        else:
            assert self.control.holder != one or fence is None or self.control.lease is not None

    @rule(one=people, fence=st.one_of(st.none(), st.integers(40, 60)))
    def orders(self, one: Operator, fence: int | None) -> None:
        lease = self.control.lease
        try:
            self.control.admit(one, fence)
        except NotInControl:
            assert lease is not None or fence is not None
        else:
            assert lease is None or lease.holder == one
            assert fence is None or (lease is not None and lease.fence == fence and self.given[fence] == one)

    @invariant()
    def is_sound(self) -> None:
        control = self.control
        assert control.lease is None or control.lapsed is None
        assert control.lease is not None or control.requests == ()
        assert all(not request.of.is_same(control.holder) for request in control.requests)
        if control.lease is not None:
            assert self.given[control.lease.fence] == control.holder


AnyCourse.TestCase.settings = settings(max_examples=150, stateful_step_count=40, deadline=None)
TestAnyCourse = AnyCourse.TestCase
