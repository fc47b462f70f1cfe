"""What holds of an alarm whatever happens to it: nothing is lost, nothing unseen vanishes, UNKNOWN decides nothing."""

from __future__ import annotations

from dataclasses import dataclass

from hypothesis import given
from hypothesis import strategies as st

from monitor.alarm import Alarm, AlarmState, Refused, Transition
from monitor.alarm_life import advance
from monitor.alarm_spec import AlarmSpec, Place, Priority, Sound
from monitor.check import OK, Finding, Verdict, fault, unknown
from monitor.response import acknowledge, shelve, silence, unshelve

SPECS = st.builds(
    AlarmSpec,
    title=st.just("Too hot"),
    priority=st.just(Priority.WARNING),
    place=st.just(Place.SNACKBAR),
    sound=st.just(Sound.LOW),
    needs_ack=st.booleans(),
    on_delay_s=st.sampled_from([0.0, 0.3, 2.0]),
    off_delay_s=st.sampled_from([0.0, 1.0, 3.0]),
    latches=st.booleans(),
)
FINDINGS = st.one_of(
    st.just(OK),
    st.just(unknown("cannot tell")),
    st.builds(
        lambda causes, level: fault("bad", causes=tuple(sorted(causes)), level=level),
        st.sets(st.sampled_from("ab")),
        st.integers(0, 2),
    ),
)


@dataclass(frozen=True)
class Judge:
    finding: Finding
    inhibited: bool


@dataclass(frozen=True)
class Tap:
    kind: str
    off_by: int  # from the occurrence there is


EVENTS = st.one_of(
    st.builds(Judge, FINDINGS, st.sampled_from([False, False, False, True])),
    st.builds(Judge, FINDINGS, st.just(False)),
    st.builds(
        Tap, st.sampled_from(["acknowledge", "silence", "shelve", "unshelve"]), st.sampled_from([0, 0, 0, -1, 1])
    ),
)
DAY = st.lists(st.tuples(st.sampled_from([0.0, 0.1, 0.5, 1.0, 2.0, 90.0]), EVENTS), max_size=40)


def happen(alarm: Alarm, event: Judge | Tap, now_s: float) -> tuple[Alarm, tuple[Transition, ...]]:
    match event:
        case Judge():
            return advance(alarm, event.finding, now_s, ("link_lost",) if event.inhibited else ())
        case Tap(kind="acknowledge"):
            return acknowledge(alarm, alarm.occurrence + event.off_by, "Ann", now_s)
        case Tap(kind="silence"):
            return silence(alarm, alarm.occurrence + event.off_by, "Ann", now_s)
        case Tap(kind="shelve"):
            return shelve(alarm, alarm.occurrence + event.off_by, 1.0, "Ann", now_s, is_inhibitor=False)
        case _:
            return unshelve(alarm, "Ann", now_s)


@given(SPECS, DAY)
def test_no_transition_is_lost(spec: AlarmSpec, day: list[tuple[float, Judge | Tap]]) -> None:
    """The journal alone gives the state of the alarm: a restart needs that."""
    alarm, now_s = Alarm(id="hot", spec=spec), 0.0
    active, acknowledged, shelved, suppressed, occurrence = False, True, False, False, 0
    for wait_s, event in day:
        now_s += wait_s
        try:
            alarm, transitions = happen(alarm, event, now_s)
        except Refused:
            continue
        for transition in transitions:
            match transition.change:
                case "raised":
                    assert not active, "raised twice"
                    active, acknowledged, suppressed = True, False, False
                    occurrence += 1
                case "recaused":
                    assert active
                    acknowledged = False
                    occurrence += 1
                case "cleared":
                    assert active, "cleared twice"
                    active = False
                    acknowledged = acknowledged or not spec.needs_ack
                case "acknowledged":
                    assert not acknowledged
                    acknowledged = True
                case "shelved":
                    shelved = True
                case "unshelved":
                    assert shelved
                    shelved = False
                    if active:
                        acknowledged = False
                        occurrence += 1
                case "suppressed":
                    suppressed = True
                case "unsuppressed":
                    assert suppressed
                    suppressed = False
            assert transition.occurrence == occurrence
            assert not (transition.announces and (shelved or suppressed))
        assert (alarm.active, alarm.acknowledged, alarm.occurrence) == (active, acknowledged, occurrence)
        assert (alarm.shelved_until_s is not None) == shelved
        if alarm.is_standing:
            assert bool(alarm.suppressed_by) == suppressed


@given(SPECS, DAY)
def test_no_unacknowledged_alarm_vanishes(spec: AlarmSpec, day: list[tuple[float, Judge | Tap]]) -> None:
    alarm, now_s = Alarm(id="hot", spec=spec), 0.0
    for wait_s, event in day:
        now_s += wait_s
        before = alarm
        try:
            alarm, transitions = happen(alarm, event, now_s)
        except Refused:
            assert isinstance(event, Tap)
            continue
        if before.acknowledged or not alarm.acknowledged:
            continue
        changes = [transition.change for transition in transitions]
        seen = isinstance(event, Tap) and event.kind == "acknowledge" and event.off_by == 0
        gone_by_itself = not spec.needs_ack and "cleared" in changes
        assert seen or gone_by_itself


@given(SPECS, DAY)
def test_unknown_decides_nothing(spec: AlarmSpec, day: list[tuple[float, Judge | Tap]]) -> None:
    alarm, now_s = Alarm(id="hot", spec=spec), 0.0
    for wait_s, event in day:
        now_s += wait_s
        before = alarm
        try:
            alarm, transitions = happen(alarm, event, now_s)
        except Refused:
            continue
        if isinstance(event, Judge) and event.finding.verdict is Verdict.UNKNOWN:
            assert alarm.active == before.active
            assert {transition.change for transition in transitions} <= {
                "unshelved",
                "unsilenced",
                "suppressed",
                "unsuppressed",
            }


@given(SPECS, DAY)
def test_an_acknowledgement_covers_only_what_was_shown(spec: AlarmSpec, day: list[tuple[float, Judge | Tap]]) -> None:
    alarm, now_s = Alarm(id="hot", spec=spec), 0.0
    announced: set[str] = set()  # the causes announced to the operator since the alarm was raised
    for wait_s, event in day:
        now_s += wait_s
        before = alarm
        try:
            alarm, transitions = happen(alarm, event, now_s)
        except Refused:
            assert alarm is before
            continue
        if isinstance(event, Tap):
            assert event.kind == "unshelve" or event.off_by == 0
            continue
        announcing = [t for t in transitions if t.change in ("raised", "recaused")]
        assert len(announcing) <= 1
        if announcing:
            announced = (set() if announcing[0].change == "raised" else announced) | set(event.finding.causes)
        if alarm.state is AlarmState.ACKED and event.finding.verdict is Verdict.FAULT:
            assert set(event.finding.causes) <= announced


@given(SPECS, DAY)
def test_nothing_is_raised_or_cleared_while_explained_away(
    spec: AlarmSpec, day: list[tuple[float, Judge | Tap]]
) -> None:
    alarm, now_s = Alarm(id="hot", spec=spec), 0.0
    for wait_s, event in day:
        now_s += wait_s
        try:
            alarm, transitions = happen(alarm, event, now_s)
        except Refused:
            continue
        if isinstance(event, Judge) and event.inhibited:
            assert {t.change for t in transitions} <= {"suppressed", "unshelved", "unsilenced"}
            assert not any(t.announces for t in transitions)


@given(SPECS, DAY, st.integers(0, 39), st.sampled_from([1.0, 3600.0, 1e9]))
def test_time_going_back_is_harmless(
    spec: AlarmSpec, day: list[tuple[float, Judge | Tap]], at: int, back_s: float
) -> None:
    """The same day on a clock that once goes back by an hour: the same story, with no wait at that moment."""
    if at >= len(day):
        return
    straight, bent = Alarm(id="hot", spec=spec), Alarm(id="hot", spec=spec)
    now_s, offset_s = 0.0, 0.0
    # The alarm notices the time when it is judged, so that is when the clock goes back.
    day = [*day[:at], (0.0, Judge(fault("bad"), False)), (0.0, Judge(fault("bad"), False)), *day[at:]]
    for number, (wait_s, event) in enumerate(day):
        now_s += wait_s
        if number == at + 1:
            offset_s = -back_s
        stories = []
        for alarm, clock_s in ((straight, now_s), (bent, now_s + offset_s)):
            try:
                stories.append(happen(alarm, event, clock_s))
            except Refused as refused:
                stories.append((alarm, (refused.reason,)))  # type: ignore[arg-type]
        (straight, changes), (bent, bent_changes) = stories
        assert [getattr(t, "change", t) for t in changes] == [getattr(t, "change", t) for t in bent_changes]
        assert straight.state is bent.state


@given(st.lists(st.tuples(st.floats(0.01, 1.0), FINDINGS), max_size=60), st.sampled_from([0.0, 0.3, 2.0]))
def test_the_delays_are_what_they_say(day: list[tuple[float, Finding]], delay_s: float) -> None:
    """Raised no earlier than a whole delay of fault, and no later where nothing but fault is found."""
    spec = AlarmSpec(
        title="Too hot",
        priority=Priority.WARNING,
        place=Place.LIST,
        sound=Sound.NONE,
        needs_ack=False,
        on_delay_s=delay_s,
        off_delay_s=delay_s,
    )
    alarm, now_s, since_s = Alarm(id="hot", spec=spec), 0.0, 0.0
    last: Verdict | None = None
    for wait_s, finding in day:
        now_s += wait_s
        if finding.verdict is not last:
            last, since_s = finding.verdict, now_s
        was_active = alarm.active
        alarm, _ = advance(alarm, finding._replace(causes=(), level=0), now_s)
        if finding.verdict is Verdict.FAULT and now_s - since_s >= delay_s:
            assert alarm.active
        if finding.verdict is Verdict.OK:
            assert (
                alarm.active == (was_active and now_s - since_s < delay_s - 1e-9)
                or abs(now_s - since_s - delay_s) < 1e-3
            )
