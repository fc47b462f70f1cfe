"""The authorization of a vehicle's commands: pages, programs, this machine's console, and its log lines."""

from __future__ import annotations

from typing import Any

import pytest

from monitor.runner import Refused
from server.control.authorization import Authorization, Caller
from server.control.lease import NotInControl
from server.protocol import commands

READY = {"kind": "present", "visible": True, "sound": "ready", "awake": "ready"}
PAUSE = commands.read({"kind": "pause"})
SEE = commands.read({"kind": "acknowledge", "alarm": "speed_limit", "occurrence": 1})


class Vehicle:
    """A gate with its log."""

    def __init__(self) -> None:
        self.log: list[dict[str, Any]] = []
        self.gate = Authorization(self._note, fence=100)

    def _note(self, change: str, text: str, *, by: str | None = None, **more: Any) -> None:
        assert change == "control"
        self.log.append({"text": text, "by": by} | more)

    @property
    def acts(self) -> list[str]:
        return [event["act"] for event in self.log]

    def see(self, *pages: Caller, now_s: float, **more: Any) -> None:
        for page in pages:
            status = commands.read(READY | more)
            assert isinstance(status, commands.PresentWord)
            self.gate.update_status(status, page, now_s)

    def do(self, page: Caller, what: str, now_s: float, **more: Any) -> int | None:
        command = commands.read({"kind": "control", "do": what} | more)
        assert isinstance(command, commands.TakeControl)
        return self.gate.execute(command, page, now_s)

    def shown(self, now_s: float) -> dict[str, Any]:
        found: dict[str, Any] = self.gate.as_json(now_s, 1_700_000_000_000)["control"]
        return found


def page(name: str, fence: int | None = None, **more: Any) -> Caller:
    return Caller(name=name, who=f"device-{name.lower()}", page=f"page-{name.lower()}", fence=fence, **more)


ANN, BEN = page("Ann"), page("Ben")
PROGRAM = Caller(name="api · curl", who="program")
CONSOLE = Caller(name="api · curl", who="local", is_console=True)


def test_the_first_order_of_a_page_that_is_seen_takes_control_and_is_logged() -> None:
    car = Vehicle()
    car.see(ANN, BEN, now_s=0.0)
    car.gate.admit(PAUSE, ANN, 0.5)
    assert car.log == [
        {"text": "Ann is in control.", "by": "Ann", "act": "taken", "by_page": "page-ann", "holder": "Ann",
         "page": "page-ann", "before": None, "before_page": None, "fence": 101},
    ]  # fmt: skip
    car.gate.admit(PAUSE, page("Ann", 101), 0.6)
    with pytest.raises(NotInControl, match="Ann is in control"):
        car.gate.admit(PAUSE, BEN, 0.6)
    assert car.acts == ["taken"]
    assert car.gate.fence_of(ANN) == 101
    assert car.gate.fence_of(BEN) is None


def test_a_page_that_nobody_sees_is_served_and_has_no_lease() -> None:
    car = Vehicle()
    car.gate.admit(PAUSE, ANN, 0.0)
    car.see(ANN, now_s=0.0, visible=False)
    car.gate.admit(PAUSE, ANN, 1.0)
    assert car.log == []
    with pytest.raises(Refused, match="Only a visible page can be in control"):
        car.do(ANN, "take", 1.0)


@pytest.mark.parametrize("what", ["take", "take_over", "request"])
def test_a_press_counts_although_the_page_could_not_report_for_some_seconds(what: str) -> None:
    car = Vehicle()
    car.see(ANN, BEN, now_s=0.0)
    car.do(BEN, "take", 0.0)
    for second in range(1, 9):
        car.see(BEN, now_s=second)
    if what == "take":
        car.do(page("Ben", 101), "release", 8.0)
    car.do(ANN, what, 8.0)  # nothing came from Ann for 8 s: a slow link, a busy phone
    car.gate.tick(8.1)
    assert car.acts[-1] == {"take": "taken", "take_over": "taken_over", "request": "requested"}[what]
    assert len(car.shown(8.1)["requests"]) == (what == "request")


def test_the_first_order_takes_control_although_the_page_could_not_report_for_some_seconds() -> None:
    car = Vehicle()
    car.see(ANN, now_s=0.0)
    car.gate.admit(PAUSE, ANN, 8.0)
    assert car.acts == ["taken"]
    car.gate.tick(11.1)  # and nothing came since
    assert car.acts == ["taken", "lapsed"]


def test_what_any_operator_may_do_needs_no_control() -> None:
    car = Vehicle()
    car.see(ANN, now_s=0.0)
    car.do(ANN, "take", 0.0)
    car.gate.admit(SEE, BEN, 1.0)
    car.gate.admit(SEE, PROGRAM, 1.0)


@pytest.mark.parametrize(
    ("caller", "is_let_in"),
    [
        (PROGRAM, False),
        (Caller(name="Ann", who="device-ann", fence=101), True),  # the holder's own page over HTTP, with its number
        (Caller(name="Ann", who="device-ann"), False),
        (Caller(name="Ann", who="device-ann", fence=100), False),
        (Caller(name="Ben", who="device-ben", fence=101), False),  # a number is no secret, and no proof
        (CONSOLE, True),
        (Caller(name="x", who="local", fence=1, is_console=True), True),
    ],
)
def test_a_program_while_a_page_is_in_control(caller: Caller, is_let_in: bool) -> None:
    car = Vehicle()
    car.see(ANN, now_s=0.0)
    assert car.do(ANN, "take", 0.0) == 101
    if is_let_in:
        car.gate.admit(PAUSE, caller, 1.0)
    else:
        with pytest.raises(NotInControl):
            car.gate.admit(PAUSE, caller, 1.0)


def test_a_program_is_served_while_nobody_is_in_control_and_gets_no_lease() -> None:
    car = Vehicle()
    car.gate.admit(PAUSE, PROGRAM, 0.0)
    assert (car.log, car.shown(0.0)["holder"]) == ([], None)
    with pytest.raises(NotInControl):
        car.gate.admit(PAUSE, Caller(name="Ann", who="device-ann", fence=100), 0.0)  # of a lease that is over
    with pytest.raises(Refused, match="Only a page can be in control"):
        car.do(PROGRAM, "take", 0.0)


def test_lost_by_sleep_taken_by_another_and_the_sleeper_s_order_is_refused() -> None:
    car = Vehicle()
    car.see(ANN, BEN, now_s=0.0)
    car.do(ANN, "take", 0.0)
    car.see(BEN, now_s=3.0)
    assert car.gate.tick(3.1)
    assert car.log[-1] | {"text": ""} == {
        "text": "", "by": None, "act": "lapsed", "by_page": None, "holder": None, "page": None, "before": "Ann",
        "before_page": "page-ann", "fence": None,
    }  # fmt: skip
    assert car.shown(8.1)["former"] == {"name": "Ann", "page": "page-ann", "may_return_s": 25.0}
    car.see(BEN, now_s=8.0)
    assert car.do(BEN, "take", 8.0) == 102
    car.see(ANN, now_s=9.0)  # she wakes
    with pytest.raises(NotInControl, match="Ben is in control"):
        car.gate.admit(PAUSE, page("Ann", 101), 9.0)
    assert car.acts == ["taken", "lapsed", "taken"]


def test_back_within_30_s_it_is_the_same_page_s_again_and_that_is_logged() -> None:
    car = Vehicle()
    car.see(ANN, now_s=0.0)
    car.do(ANN, "take", 0.0)
    car.see(ANN, now_s=20.0, visible=False)
    assert car.shown(20.0)["holder"] is None
    car.see(ANN, now_s=25.0)
    assert car.acts == ["taken", "lapsed", "returned"]
    assert car.log[-1]["text"] == "Ann is back after 8 s and in control again: nobody else had taken it."
    with pytest.raises(NotInControl):
        car.gate.admit(PAUSE, page("Ann", 101), 25.1)  # ordered before she slept
    car.gate.admit(PAUSE, page("Ann", 102), 25.1)


def test_a_request_is_seen_counts_down_and_is_granted_by_silence() -> None:
    car = Vehicle()
    car.see(ANN, BEN, now_s=0.0)
    car.do(ANN, "take", 0.0)
    assert car.do(BEN, "request", 0.0) is None
    for second in range(1, 10):
        car.see(ANN, BEN, now_s=float(second))
    assert car.shown(9.5)["requests"] == [{"page": "page-ben", "name": "Ben", "left_s": 0.5}]
    car.gate.tick(10.0)
    assert (car.shown(10.0)["holder"], car.shown(10.0)["requests"]) == ("Ben", [])
    assert car.acts == ["taken", "requested", "granted"]


def test_control_is_handed_only_to_a_page_that_is_seen() -> None:
    car = Vehicle()
    car.see(ANN, BEN, now_s=0.0)
    car.do(ANN, "take", 0.0)
    with pytest.raises(Refused, match="That page is closed or not visible"):
        car.do(ANN, "hand_over", 1.0, to="page-nobody")
    assert car.do(page("Ann", 101), "hand_over", 1.0, to="page-ben") is None
    assert car.shown(1.0)["holder"] == "Ben"


def test_a_page_that_is_closed_keeps_nobody_waiting_and_one_that_is_loaded_anew_has_control_again() -> None:
    car = Vehicle()
    car.see(ANN, BEN, now_s=0.0)
    car.do(ANN, "take", 0.0)
    car.see(ANN, now_s=1.0, leaves=True)
    assert car.gate.facts(1.0).of == 1
    assert car.shown(1.0)["holder"] is None
    car.see(ANN, now_s=2.5)
    assert car.shown(2.5)["holder"] == "Ann"
    assert car.acts == ["taken", "lapsed", "returned"]
    car.see(BEN, now_s=2.9)
    car.see(ANN, now_s=3.0, leaves=True)
    car.gate.admit(PAUSE, BEN, 3.1)
    car.see(ANN, now_s=3.2)
    assert car.shown(3.2)["holder"] == "Ben"
    car.see(ANN, now_s=3.3, leaves=True)  # it holds nothing
    assert car.shown(3.3)["holder"] == "Ben"


def test_who_requested_it_has_control_as_soon_as_the_holder_has_left() -> None:
    car = Vehicle()
    car.see(ANN, BEN, now_s=0.0)
    car.do(ANN, "take", 0.0)
    car.do(BEN, "request", 1.0)
    car.see(ANN, now_s=2.0, leaves=True)
    assert car.shown(2.0)["holder"] == "Ben"


def test_a_page_that_shows_a_replay_keeps_control_and_sounds_no_alarm() -> None:
    car = Vehicle()
    car.see(page("Ann", is_replaying=True), now_s=0.0)
    assert (car.gate.facts(0.0).can, car.gate.facts(0.0).why) == (0, "shows a replay")
    assert car.do(ANN, "take", 0.0) == 101


@pytest.mark.parametrize(
    ("message", "caller"),
    [
        ({}, Caller(name="operator")),
        (
            {"by": "Ann\x1b", "who": "x", "page": "page-a", "fence": 7},
            Caller(name="Ann", device="Ann", who="x", page="page-a", fence=7),
        ),
        ({"fence": True}, Caller(name="operator")),
        ({"fence": -1}, Caller(name="operator")),
        ({"fence": 2**60}, Caller(name="operator")),
        ({"fence": "7", "page": 9, "console": "yes", "replaying": 1}, Caller(name="operator")),
    ],
)
def test_who_calls(message: dict[str, Any], caller: Caller) -> None:
    assert Caller.of(message) == caller


@pytest.mark.parametrize(
    "command",
    [
        {"kind": "control", "do": "seize"},
        {"kind": "control", "do": "hand_over"},
        {"kind": "control", "do": "take", "to": "page-ben"},
        {"kind": "control", "do": "keep", "to": "<b>"},
        {"kind": "ride", "phone": "X"},
        {"kind": "ride"},
        READY | {"sound": "loud"},
        READY | {"battery": 1.1},
        READY | {"battery": float("nan")},
        READY | {"lag_s": float("inf")},
        READY | {"visible": 1},
    ],
)
def test_what_makes_no_sense_is_refused(command: dict[str, Any]) -> None:
    with pytest.raises(commands.NotUnderstood):
        commands.read(command)
