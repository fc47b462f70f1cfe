"""What an attempt came to: permanent and temporary refusals, each recipient by itself, pauses that grow, giving up."""

from __future__ import annotations

from typing import Any

import pytest

from server.mail import sender
from server.mail.order import Mail, Recipient
from server.mail.sender import answered, troubled
from server.mail.smtp_connection import Reply
from server.mail.smtp_dial import Trouble, clean
from tests.server.mail.mailing import START_MS as T

OK, LATER, NEVER = (
    Reply(code=250, message="OK"),
    Reply(code=450, message="greylisted"),
    Reply(code=550, message="no such user"),
)


def mail(*recipients: Recipient, attempts: int = 1) -> Mail:
    return Mail(
        n=1,
        letter=1,
        part=1,
        parts=1,
        message_id="<x@y>",
        file="x.eml",
        size_bytes=9,
        state="sending",
        attempts=attempts,
        next_ms=None,
        done_ms=None,
        detail="",
        recipients=recipients,
    )


ANN, BOB = Recipient(address="ann@x"), Recipient(address="bob@x")
CASES: dict[str, tuple[tuple[Recipient, ...], dict[str, Reply], Reply | None, str, str, str]] = {
    "taken": ((ANN,), {"ann@x": OK}, OK, "sent", "250 OK", "accepted"),
    "one refused for good": ((ANN,), {"ann@x": NEVER}, None, "failed", "550 no such user", "refused"),
    "one refused for now": ((ANN,), {"ann@x": LATER}, None, "queued", "450 greylisted", "waiting"),
    "the mail refused for good": ((ANN,), {"ann@x": OK}, NEVER, "failed", "550 no such user", "refused"),
    "the mail refused for now": ((ANN,), {"ann@x": OK}, LATER, "queued", "450 greylisted", "waiting"),
    "one of two refused for good": (
        (ANN, BOB),
        {"ann@x": OK, "bob@x": NEVER},
        OK,
        "failed",
        "bob@x: 550 no such user; 1 of 2 recipients have it",
        "accepted refused",
    ),
    "one of two refused for now": (
        (ANN, BOB),
        {"ann@x": OK, "bob@x": LATER},
        OK,
        "queued",
        "bob@x: 450 greylisted; 1 of 2 recipients have it",
        "accepted waiting",
    ),
    "one for good, one for now": (
        (ANN, BOB),
        {"ann@x": NEVER, "bob@x": LATER},
        None,
        "queued",
        "bob@x: 450 greylisted; 0 of 2 recipients have it",
        "refused waiting",
    ),
    "the other had it before": (
        (Recipient(address="ann@x", state="accepted", detail="250"), BOB),
        {"bob@x": OK},
        OK,
        "sent",
        "250 OK",
        "accepted accepted",
    ),
    "the other was refused before": (
        (Recipient(address="ann@x", state="refused", detail="550 no"), BOB),
        {"bob@x": OK},
        OK,
        "failed",
        "ann@x: 550 no; 1 of 2 recipients have it",
        "refused accepted",
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_what_the_answers_come_to(name: str) -> None:
    recipients, answers, of_mail, state, detail, states = CASES[name]
    outcome = answered(mail(*recipients), answers, of_mail, T, sender.pause_s)
    assert (outcome.state, outcome.detail) == (state, detail)
    assert " ".join(one.state for one in outcome.recipients) == states
    assert (outcome.next_ms == T + 10_000) is (state == "queued")


@pytest.mark.parametrize(
    ("facts", "is_doubtful", "state", "detail"),
    [
        ({}, False, "queued", "gone"),
        ({}, True, "queued", "gone It may have arrived; it is sent again under the same Message-ID."),
        ({"is_permanent": True}, False, "failed", "gone"),
        ({"is_permanent": True, "is_of_account": True}, False, "failed", "gone"),
    ],
)
def test_the_outcome_of_a_failure(facts: dict[str, Any], is_doubtful: bool, state: str, detail: str) -> None:
    outcome = troubled(mail(ANN), Trouble("gone", **facts), is_doubtful=is_doubtful, now_ms=T, pause_s=sender.pause_s)
    assert (outcome.state, outcome.detail) == (state, detail)
    assert outcome.of_account is bool(facts.get("is_of_account"))
    assert outcome.recipients == (ANN,)


def test_pauses_grow_to_an_hour_and_end_after_three_days() -> None:
    all_s = [sender.pause_s(attempt) for attempt in range(1, sender.MAX_ATTEMPTS)]
    assert all_s == sorted(all_s)
    assert all_s[0] == 10
    assert max(all_s) == sender.LONGEST_S == 3600
    assert 3.0 <= sum(all_s) / 86_400 <= 3.2


@pytest.mark.parametrize(("attempts", "state"), [(sender.MAX_ATTEMPTS - 1, "queued"), (sender.MAX_ATTEMPTS, "failed")])
def test_a_mail_fails_after_the_last_attempt_with_a_reason(attempts: int, state: str) -> None:
    outcome = answered(mail(ANN, attempts=attempts), {"ann@x": LATER}, None, T, sender.pause_s)
    assert outcome.state == state
    assert outcome.detail == (
        "450 greylisted" if state == "queued" else f"Given up after {attempts} attempts: 450 greylisted"
    )


@pytest.mark.parametrize(
    ("reply", "shown"),
    [
        ("5.1.1 no such user", "5.1.1 no such user"),
        ("two\nlines\r\n\x00here", "two lines here"),
        ("\x1b[31mred\u202egnp", "[31mred gnp"),
        ("bad \udcff bytes", "bad bytes"),
        ("x" * 1000, "x" * 300),
        ("wrong password hunter2!", "wrong password •••!"),
        ("AUTH PLAIN AGNhcgBodW50ZXIy failed", "AUTH PLAIN ••• failed"),
        ("aHVudGVyMg==", "•••"),
        ("abcdefgh", "abcdefgh"),
    ],
)
def test_a_reply_is_shown_on_one_line_without_the_password(reply: str, shown: str) -> None:
    assert clean(reply, "hunter2") == shown
