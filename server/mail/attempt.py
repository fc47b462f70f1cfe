"""What one attempt to send a mail came to: who has it, who is refused, and whether and when it is tried again."""

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
    """The server has answered: for each recipient, and for the mail where it took any."""
    recipients = tuple(_settled(one, answers.get(one.address), of_mail) for one in mail.recipients)
    waiting = [one for one in recipients if one.state == "waiting"]
    refused = [one for one in recipients if one.state == "refused"]
    if waiting:
        said = waiting[0].said
        if len(recipients) > 1:
            said = f"{_named(waiting)}; {_count(recipients)}"
        return _again(mail, recipients, said, now_ms, pause_s)
    if refused:
        said = refused[0].said if len(recipients) == 1 else f"{_named(refused)}; {_count(recipients)}"
        return Outcome(state="failed", said=said, recipients=recipients)
    said = recipients[-1].said if recipients else ""
    return Outcome(state="sent", said=said, recipients=recipients)


def troubled(
    mail: Mail, trouble: Trouble, *, is_doubtful: bool, now_ms: int, pause_s: Callable[[int], float]
) -> Outcome:
    """Nothing was settled."""
    said = str(trouble)
    if is_doubtful:
        said = f"{said} It may have arrived; it is sent again under the same Message-ID."
    if trouble.is_permanent:
        return Outcome(state="failed", said=said, recipients=mail.recipients, of_account=trouble.is_of_account)
    return _again(mail, mail.recipients, said, now_ms, pause_s)


def _settled(one: Recipient, answer: Reply | None, of_mail: Reply | None) -> Recipient:
    if one.state != "waiting" or answer is None:
        return one  # it has it, or was refused before
    if answer.code >= 300:
        return replace(one, state="refused" if answer.is_permanent else "waiting", said=answer.text)
    if of_mail is None:
        return one
    if of_mail.code < 300:
        return replace(one, state="accepted", said=of_mail.text)
    return replace(one, state="refused" if of_mail.is_permanent else "waiting", said=of_mail.text)


def _again(
    mail: Mail, recipients: tuple[Recipient, ...], said: str, now_ms: int, pause_s: Callable[[int], float]
) -> Outcome:
    if mail.attempts >= MAX_ATTEMPTS:
        return Outcome(state="failed", said=f"Given up after {mail.attempts} attempts: {said}", recipients=recipients)
    next_ms = now_ms + round(1000 * pause_s(mail.attempts))
    return Outcome(state="queued", said=said, recipients=recipients, next_ms=next_ms)


def _named(some: Sequence[Recipient]) -> str:
    listed = ", ".join(f"{one.address}: {one.said}" if one.said else one.address for one in some[:_MOST_NAMED])
    return listed + (f" and {len(some) - _MOST_NAMED} more" if len(some) > _MOST_NAMED else "")


def _count(recipients: Sequence[Recipient]) -> str:
    accepted = sum(one.state == "accepted" for one in recipients)
    return f"{accepted} of {len(recipients)} recipients have it"
