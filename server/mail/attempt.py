"""The outcome of one attempt to send a mail: accepted and refused recipients, and the time of the next attempt."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from server.mail.order import Mail, Outcome, Recipient
from server.mail.replies import Trouble
from server.mail.retry_backoff import MAX_ATTEMPTS
from server.mail.smtp_connection import Reply

_MOST_NAMED = 5  # recipients named in a sentence


def answered(
    mail: Mail,
    answers: Mapping[str, Reply],
    of_mail: Reply | None,
    now_ms: int,
    pause_s: Callable[[int], float],
) -> Outcome:
    """Return the outcome of the server's replies: one for each recipient, and one for the mail if any was accepted."""
    recipients = tuple(_settled(one, answers.get(one.address), of_mail) for one in mail.recipients)
    waiting = [one for one in recipients if one.state == "waiting"]
    refused = [one for one in recipients if one.state == "refused"]
    if waiting:
        detail = waiting[0].detail
        if len(recipients) > 1:
            detail = f"{_named(waiting)}; {_count(recipients)}"
        return _again(mail, recipients, detail, now_ms, pause_s)
    if refused:
        detail = refused[0].detail if len(recipients) == 1 else f"{_named(refused)}; {_count(recipients)}"
        return Outcome(state="failed", detail=detail, recipients=recipients)
    detail = recipients[-1].detail if recipients else ""
    return Outcome(state="sent", detail=detail, recipients=recipients)


def troubled(
    mail: Mail, trouble: Trouble, *, is_doubtful: bool, now_ms: int, pause_s: Callable[[int], float]
) -> Outcome:
    """Return the outcome of an attempt that failed before the server's final reply."""
    detail = str(trouble)
    if is_doubtful:
        detail = f"{detail} It may have arrived; it is sent again under the same Message-ID."
    if trouble.is_permanent:
        return Outcome(state="failed", detail=detail, recipients=mail.recipients, of_account=trouble.is_of_account)
    return _again(mail, mail.recipients, detail, now_ms, pause_s)


def _settled(one: Recipient, answer: Reply | None, of_mail: Reply | None) -> Recipient:
    if one.state != "waiting" or answer is None:
        return one  # already accepted or refused
    if answer.code >= 300:
        return replace(one, state="refused" if answer.is_permanent else "waiting", detail=answer.text)
    if of_mail is None:
        return one
    if of_mail.code < 300:
        return replace(one, state="accepted", detail=of_mail.text)
    return replace(one, state="refused" if of_mail.is_permanent else "waiting", detail=of_mail.text)


def _again(
    mail: Mail, recipients: tuple[Recipient, ...], detail: str, now_ms: int, pause_s: Callable[[int], float]
) -> Outcome:
    if mail.attempts >= MAX_ATTEMPTS:
        return Outcome(
            state="failed", detail=f"Given up after {mail.attempts} attempts: {detail}", recipients=recipients
        )
    next_ms = now_ms + round(1000 * pause_s(mail.attempts))
    return Outcome(state="queued", detail=detail, recipients=recipients, next_ms=next_ms)


def _named(some: Sequence[Recipient]) -> str:
    listed = ", ".join(f"{one.address}: {one.detail}" if one.detail else one.address for one in some[:_MOST_NAMED])
    return listed + (f" and {len(some) - _MOST_NAMED} more" if len(some) > _MOST_NAMED else "")


def _count(recipients: Sequence[Recipient]) -> str:
    accepted = sum(one.state == "accepted" for one in recipients)
    return f"{accepted} of {len(recipients)} recipients have it"
