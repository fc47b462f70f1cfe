"""The item of a car that needs a person: by table, and by any course of events at all."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from monitor.instruments import AttentionLimits
from monitor.runner import Refused
from server.control.attention import Attention, ItemAct, Need
from server.control.lease import Operator

ANN, BEN, CEM = (
    Operator(page=f"page-{letter}", who=f"phone-{letter}", name=name)
    for letter, name in (("a", "Ann"), ("b", "Ben"), ("c", "Cem"))
)
CRITICAL = Need(title="Speed limit", is_critical=True)
WARNING = Need(title="GPS fix", is_critical=False)
LIMITS = AttentionLimits()
ESCALATES_S, UNHEARD_S = LIMITS.escalates_s, LIMITS.unheard_s
NOBODY = "This car needs nobody now."


def begun(need: Need = CRITICAL, *, at_s: float = 0.0) -> Attention:
    attention = Attention(lambda: LIMITS)
    assert attention.advance(need, at_s) == []
    return attention


def changes(acts: list[ItemAct]) -> list[str]:
    return [act.change for act in acts]


def test_the_limits_are_those_of_the_design() -> None:
    assert (ESCALATES_S, UNHEARD_S) == (30.0, 10.0)


# -- begin and end -----------------------------------------------------------------------------------------------------


def test_it_begins_and_ends_with_the_need_and_the_assignment_is_forgotten() -> None:
    attention = begun(at_s=5.0)
    assert attention.item is not None
    assert attention.item.since_s == 5.0
    attention.take(ANN, 6.0)
    assert attention.advance(WARNING, 7.0) == []
    assert attention.item.since_s == 5.0, "without a break"
    assert attention.advance(None, 8.0) == []
    assert attention.item is None
    assert attention.advance(CRITICAL, 9.0) == []
    assert (attention.item.since_s, attention.holder) == (9.0, None)


ACTS: dict[str, Callable[[Attention], ItemAct | None]] = {
    "take": lambda one: one.take(ANN, 1.0),
    "take over": lambda one: one.take(ANN, 1.0, over=True),
    "release": lambda one: one.release(ANN),
    "offer": lambda one: one.offer(ANN, BEN, 1.0),
    "accept": lambda one: one.answer(BEN, 1.0, accept=True),
    "decline": lambda one: one.answer(BEN, 1.0, accept=False),
    "withdraw": lambda one: one.withdraw(ANN),
}


@pytest.mark.parametrize("act", ACTS.values(), ids=ACTS)
def test_a_car_that_needs_nobody_has_no_item(act: Callable[[Attention], ItemAct | None]) -> None:
    with pytest.raises(Refused, match=NOBODY):
        act(Attention(lambda: LIMITS))


@pytest.mark.parametrize(
    ("act", "why"),
    [
        ("release", "This car is unassigned"),
        ("offer", "This car is unassigned"),
        ("withdraw", "This car is unassigned"),
        ("accept", "You have no offer to take over"),
        ("decline", "You have no offer to take over"),
    ],
)
def test_what_only_a_holder_or_who_has_an_offer_may_do(act: str, why: str) -> None:
    with pytest.raises(Refused, match=why):
        ACTS[act](begun())


# -- take, release, hand over ------------------------------------------------------------------------------------------


def test_it_is_taken_by_one_and_refused_to_the_next() -> None:
    attention = begun()
    act = attention.take(ANN, 1.0)
    assert act == ItemAct(change="taken", text="Assigned to Ann.", by=ANN, holder=ANN)
    with pytest.raises(Refused, match="This car is assigned to Ann: take it over, or ask"):
        attention.take(BEN, 2.0)
    assert attention.take(ANN, 2.0) is None, "it is hers"
    assert attention.holder == ANN


def test_taking_over_names_both() -> None:
    attention = begun()
    attention.take(ANN, 1.0)
    act = attention.take(BEN, 2.0, over=True)
    assert act is not None
    assert (act.change, act.text, act.by, act.holder, act.before) == (
        "taken_over", "Assigned to Ben, who took it over from Ann.", BEN, BEN, ANN,
    )  # fmt: skip
    with pytest.raises(Refused, match="This car is assigned to Ben"):
        attention.release(ANN)


def test_the_same_page_of_another_device_is_another_person() -> None:
    attention = begun()
    attention.take(ANN, 1.0)
    with pytest.raises(Refused):
        attention.release(Operator(page=ANN.page, who="stranger", name="Ann"))


def test_an_offer_leaves_it_where_it_is_until_it_is_accepted() -> None:
    attention = begun()
    attention.take(ANN, 1.0)
    offered = attention.offer(ANN, BEN, 2.0)
    assert offered is not None
    assert (offered.change, offered.text, offered.holder) == ("offered", "Ann offered it to Ben.", ANN)
    assert attention.offer(ANN, BEN, 2.5) is None, "offered already"
    with pytest.raises(Refused, match="You have no offer"):
        attention.answer(CEM, 3.0, accept=True)
    accepted = attention.answer(BEN, 3.0, accept=True)
    assert (accepted.text, accepted.holder, accepted.before) == ("Assigned to Ben: Ann had offered it.", BEN, ANN)
    assert attention.item is not None
    assert attention.item.offered is None


@pytest.mark.parametrize("how", ["decline", "withdraw", "release", "take over", "ask another"])
def test_an_offer_ends(how: str) -> None:
    attention = begun()
    attention.take(ANN, 1.0)
    attention.offer(ANN, BEN, 2.0)
    match how:
        case "decline":
            assert attention.answer(BEN, 3.0, accept=False).text == "Ben declined: still assigned to Ann."
        case "withdraw":
            act = attention.withdraw(ANN)
            assert act is not None
            assert act.text == "Ann withdrew the offer to Ben."
            assert attention.withdraw(ANN) is None
        case "release":
            assert attention.release(ANN).text == "Ann gave it back: unassigned."
        case "take over":
            attention.take(CEM, 3.0, over=True)
        case _:
            attention.offer(ANN, CEM, 3.0)
    assert attention.item is not None
    assert attention.item.offered is None or attention.item.offered.to == CEM
    with pytest.raises(Refused):
        attention.answer(BEN, 4.0, accept=True)


def test_who_has_an_offer_may_simply_take_it() -> None:
    attention = begun()
    attention.take(ANN, 1.0)
    attention.offer(ANN, BEN, 2.0)
    act = attention.take(BEN, 3.0)
    assert act is not None
    assert (act.change, act.holder) == ("accepted", BEN)


def test_nobody_makes_an_offer_to_himself() -> None:
    attention = begun()
    attention.take(ANN, 1.0)
    with pytest.raises(Refused, match="This car is assigned to you: ask another person"):
        attention.offer(ANN, ANN, 2.0)


# -- time --------------------------------------------------------------------------------------------------------------


def test_a_critical_item_that_nobody_takes_is_escalated_once() -> None:
    attention = begun(at_s=100.0)
    assert attention.escalates_s == 130.0
    assert attention.advance(CRITICAL, 129.9) == []
    acts = attention.advance(CRITICAL, 130.0)
    assert changes(acts) == ["escalated"]
    assert acts[0].text == "Nobody took “Speed limit” within 30 s: escalated to the supervisor."
    assert acts[0].by is None
    assert attention.escalates_s is None
    assert attention.item is not None
    assert attention.item.escalated_s == 130.0
    assert attention.advance(CRITICAL, 500.0) == []
    attention.take(ANN, 501.0)
    assert attention.item.escalated_s is None, "somebody has it now"


def test_a_warning_is_never_escalated_and_the_timer_begins_when_it_becomes_critical() -> None:
    attention = begun(WARNING)
    assert attention.advance(WARNING, 1000.0) == []
    assert attention.escalates_s is None
    attention.advance(CRITICAL, 1000.0)
    assert attention.escalates_s == 1030.0
    attention.advance(WARNING, 1020.0)
    assert attention.escalates_s is None
    attention.advance(CRITICAL, 1025.0)
    assert attention.escalates_s == 1055.0


def test_taking_stops_the_timer_and_releasing_begins_it_anew() -> None:
    attention = begun()
    attention.take(ANN, 29.0)
    assert attention.escalates_s is None
    attention.release(ANN)
    assert attention.advance(CRITICAL, 31.0) == []
    assert attention.escalates_s == 61.0
    assert changes(attention.advance(CRITICAL, 61.0)) == ["escalated"]


def test_a_silent_page_loses_it_and_the_timer_begins_anew() -> None:
    attention = begun()
    attention.take(ANN, 1.0)
    attention.mark_present(BEN, 9.0)  # another's page keeps nothing
    attention.mark_present(ANN, 5.0)
    assert attention.advance(CRITICAL, 5.0 + UNHEARD_S) == []
    acts = attention.advance(CRITICAL, 15.1)
    assert [(act.change, act.text, act.by, act.holder, act.before) for act in acts] == [
        ("unassigned", "The page of Ann is silent for 10 s: unassigned again.", None, None, ANN)
    ]
    assert attention.escalates_s == 15.1 + ESCALATES_S


def test_after_a_stall_a_silent_page_loses_it_and_nothing_is_escalated_at_once() -> None:
    attention = begun()
    attention.take(ANN, 1.0)
    assert changes(attention.advance(CRITICAL, 1000.0)) == ["unassigned"]
    assert changes(attention.advance(CRITICAL, 1000.0 + ESCALATES_S)) == ["escalated"]


def test_a_page_that_reports_keeps_it_for_hours() -> None:
    attention = begun()
    attention.take(ANN, 0.0)
    for second in range(1, 7200):
        attention.mark_present(ANN, float(second))
        assert attention.advance(CRITICAL, second + 0.5) == []
    assert attention.holder == ANN


def test_an_offer_to_a_page_that_is_gone_ends() -> None:
    attention = begun()
    attention.take(ANN, 0.0)
    attention.offer(ANN, BEN, 1.0)
    attention.mark_present(ANN, 11.0)
    acts = attention.advance(CRITICAL, 11.1)
    assert [(act.change, act.text, act.holder) for act in acts] == [
        ("withdrawn", "The page of Ben is silent: the offer of Ann has ended.", ANN)
    ]


def test_the_name_that_a_page_gives_itself_later_is_shown() -> None:
    attention = begun()
    attention.take(ANN, 0.0)
    attention.mark_present(Operator(page=ANN.page, who=ANN.who, name="Anna"), 1.0)
    assert attention.holder is not None
    assert attention.holder.name == "Anna"


# -- any course of events ----------------------------------------------------------------------------------------------

people = st.sampled_from([ANN, BEN, CEM])


class AnyCourse(RuleBasedStateMachine):
    """Whatever happens: the log explains every assignment, and an unassigned critical item is escalated in time."""

    def __init__(self) -> None:
        super().__init__()
        self.now_s = 0.0
        self.need: Need | None = None
        self.attention = Attention(lambda: LIMITS)
        self.holder: Operator | None = None  # as the acts say
        self.heard_s = 0.0
        self.alone_s: float | None = None  # unassigned and critical since, and not escalated
        self.is_escalated = False

    def note(self, acts: list[ItemAct]) -> None:
        for act in acts:
            assert act.before is None or act.before == self.holder or act.change == "released"
            if act.change == "escalated":
                assert self.alone_s is not None
                assert self.now_s - self.alone_s >= ESCALATES_S
                self.is_escalated = True
            if act.change == "unassigned":
                assert self.now_s - self.heard_s > UNHEARD_S
            if act.holder != self.holder and act.holder is not None:
                self.heard_s, self.is_escalated = self.now_s, False
            self.holder = act.holder
        self.follow()

    def follow(self) -> None:
        if self.need is None:
            self.holder, self.is_escalated = None, False
        is_alone = self.need is not None and self.need.is_critical and self.holder is None
        if not is_alone or self.is_escalated:
            self.alone_s = None
        elif self.alone_s is None:
            self.alone_s = self.now_s

    @rule(seconds=st.floats(min_value=0.05, max_value=40.0))
    def time_passes(self, seconds: float) -> None:
        self.now_s += seconds
        self.note(self.attention.advance(self.need, self.now_s))

    @rule(need=st.sampled_from([None, WARNING, CRITICAL]))
    def alarms_change(self, need: Need | None) -> None:
        self.need = need
        self.note(self.attention.advance(need, self.now_s))

    @rule(who=people)
    def page_reports(self, who: Operator) -> None:
        self.attention.mark_present(who, self.now_s)
        if who == self.holder:
            self.heard_s = self.now_s

    @rule(
        act=st.sampled_from(["take", "over", "release", "offer", "accept", "decline", "withdraw"]), by=people, to=people
    )
    def acts(self, act: str, by: Operator, to: Operator) -> None:
        one, had = self.attention, self.holder
        try:
            match act:
                case "take" | "over":
                    done = one.take(by, self.now_s, over=act == "over")
                    assert had in (None, by) or act == "over" or (done is not None and done.change == "accepted")
                    if by == had:
                        self.heard_s = self.now_s
                case "release":
                    done = one.release(by)
                case "offer":
                    done = one.offer(by, to, self.now_s)
                case "withdraw":
                    done = one.withdraw(by)
                case _:
                    done = one.answer(by, self.now_s, accept=act == "accept")
        except Refused:
            return
        assert self.need is not None
        if act in ("release", "offer", "withdraw"):
            assert by == had
        self.note([done] if done is not None else [])
        self.note(one.advance(self.need, self.now_s))

    @invariant()
    def the_acts_say_who_has_it(self) -> None:
        assert self.attention.holder == self.holder
        assert (self.attention.item is None) == (self.need is None)

    @invariant()
    def an_offer_is_of_who_has_it_to_another(self) -> None:
        item = self.attention.item
        if item is not None and item.offered is not None:
            assert item.offered.by == self.holder
            assert item.offered.to != self.holder

    @invariant()
    def the_timer_runs_exactly_while_nobody_has_a_critical_item(self) -> None:
        due_s = self.attention.escalates_s
        assert (due_s is None) == (self.alone_s is None)
        if due_s is not None and self.alone_s is not None:
            assert due_s == pytest.approx(self.alone_s + ESCALATES_S)


TestAnyCourse = AnyCourse.TestCase
TestAnyCourse.settings = settings(max_examples=150, stateful_step_count=40, deadline=None)
