"""What became of a command whose answer was lost."""

from __future__ import annotations

from typing import Any

import pytest

from server.bus.bus import NotServed
from server.protocol.messages import MAYBE, not_served
from server.vehicle.outcomes import KEPT_S, MOST, Outcomes
from tests.tree import PROJECT

PAGE = "0123abcd"


def command(id: str = "a-1", page: str | None = PAGE, kind: str = "pause") -> dict[str, Any]:
    return {"kind": kind, "id": id, "page": page}


def test_a_command_is_under_way_and_then_done_or_refused() -> None:
    outcomes = Outcomes(lambda: 0.0)
    assert outcomes.may_begin(command(), 1.0)
    assert outcomes.ask(PAGE, "a-1", 1.0, 2.0) == {"ok": True, "became": "under_way"}
    outcomes.end(command(), {"ok": True}, 2.0)
    assert outcomes.ask(PAGE, "a-1", 1.0, 3.0) == {"ok": True, "became": "done"}
    assert outcomes.may_begin(command("a-2"), 3.0)
    outcomes.end(command("a-2"), {"ok": False, "reason": "Not now."}, 3.0)
    assert outcomes.ask(PAGE, "a-2", 1.0, 4.0) == {"ok": True, "became": "refused", "reason": "Not now."}
    assert outcomes.may_begin(command("a-3"), 3.0)
    outcomes.interrupt(command("a-3"), 3.0)
    assert outcomes.ask(PAGE, "a-3", 1.0, 4.0) == {"ok": True, "became": "not_known"}


def test_who_handed_over_gets_the_answer_again_where_it_was_lost() -> None:
    outcomes = Outcomes(lambda: 0.0)
    outcomes.end(command(kind="accept_control"), {"ok": True, "handed_over": {"device": "dev-a", "to": "Ben"}}, 2.0)
    answer = outcomes.ask(PAGE, "a-1", 1.0, 5.0)
    assert answer == {"ok": True, "became": "done", "handed_over": {"device": "dev-a", "to": "Ben", "ago_s": 3.0}}


def test_what_was_given_up_is_not_carried_out_when_it_comes() -> None:
    outcomes = Outcomes(lambda: 0.0)
    assert outcomes.ask(PAGE, "a-1", 1.0, 5.0) == {"ok": True, "became": "never"}
    assert not outcomes.may_begin(command(), 6.0)
    assert outcomes.may_begin(command(page="another1"), 6.0), "each page counts for itself"


def test_of_before_the_session_began_nothing_is_known() -> None:
    outcomes = Outcomes(lambda: 100.0)
    assert outcomes.ask(PAGE, "a-1", 5.0, 103.0) == {"ok": True, "became": "not_known"}
    assert outcomes.ask(None, "a-1", 1.0, 103.0) == {"ok": True, "became": "not_known"}


def test_so_many_are_remembered_for_so_long() -> None:
    outcomes = Outcomes(lambda: 0.0)
    for number in range(MOST + 5):
        assert outcomes.may_begin(command(f"a-{number}"), 10.0 + number / 1000)
    assert len(outcomes._known) == MOST
    assert outcomes.ask(PAGE, "a-0", 2.0, 12.0)["became"] == "not_known", "it was dropped: it may have been carried out"
    assert outcomes.may_begin(command("b"), 12.0 + KEPT_S)
    assert len(outcomes._known) < 5


@pytest.mark.parametrize("message", [command(page=None), command(kind="position"), {"kind": "pause", "page": PAGE}])
def test_programs_and_positions_are_not_remembered(message: dict[str, Any]) -> None:
    outcomes = Outcomes(lambda: 0.0)
    assert outcomes.may_begin(message, 1.0)
    outcomes.end(message, {"ok": True}, 1.0)
    outcomes.interrupt(message, 1.0)
    assert outcomes._known == {}


def test_a_sentence_states_whether_it_may_have_been_carried_out() -> None:
    lost = NotServed("the agent of ocelot did not answer within 3.0 s", outcome="unknown", cut="broker-agent")
    assert not_served(lost) == {
        "ok": False,
        "reason": f"The agent of ocelot did not answer within 3.0 s. {MAYBE}",
        "outcome": "unknown",
        "cut": "broker-agent",
    }
    assert not_served(NotServed("ocelot"), "The broker is gone.")["reason"] == "Not delivered: the broker is gone."
    assert f"'{MAYBE}'" in (PROJECT / "static/js/core/outcome.js").read_text(), "by it the page knows such a sentence"
