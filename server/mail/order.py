"""Mail orders and their state, for each mail and each recipient."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

State = Literal["queued", "sending", "sent", "failed", "cancelled"]
Format = Literal["mcap", "bag", "csv", "html"]
TooLarge = Literal["split", "link"]
Way = Literal["attached", "split", "link"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """The order as given; immutable."""

    recordings: tuple[str, ...]
    format: Format
    to: tuple[str, ...]  # addresses as transmitted
    subject: str
    text: str
    too_large: TooLarge
    by: str = ""  # who ordered it
    base: str = ""  # the address by which the page reached this server, for links


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipient:
    """One address of one mail."""

    address: str
    state: Literal["waiting", "accepted", "refused"] = "waiting"
    detail: str = ""  # the server's reply


@dataclass(frozen=True, slots=True, kw_only=True)
class Mail:
    """One mail of an order: all of it, or one part."""

    n: int
    letter: int
    part: int
    parts: int
    message_id: str
    file: str  # in the folder of the outbox
    size_bytes: int  # of the file
    state: State
    attempts: int
    next_ms: int | None  # when it is tried again
    done_ms: int | None
    detail: str
    recipients: tuple[Recipient, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Letter:
    """One order and its mails."""

    n: int
    key: str  # identifies it over restarts, and on the page that ordered it
    ordered_ms: int
    order: Order
    is_ready: bool  # its mails are composed
    state: State
    detail: str
    sender: str = ""  # address the mails were composed for
    way: Way | None = None
    size_bytes: int | None = None  # of what is attached, all parts together
    sha256: str | None = None
    mails: tuple[Mail, ...] = field(default=())


@dataclass(frozen=True, slots=True, kw_only=True)
class Composed:
    """One mail on the disk, before it is in the outbox."""

    part: int
    parts: int
    message_id: str
    file: str
    size_bytes: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Prepared:
    """All mails of a letter."""

    mails: tuple[Composed, ...]
    sender: str
    way: Way
    size_bytes: int
    sha256: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """The outcome of one attempt to send a mail."""

    state: State
    detail: str
    recipients: tuple[Recipient, ...]
    next_ms: int | None = None
    of_account: bool = False


def state_of(mails: tuple[Mail, ...]) -> State:
    """The state of a letter whose mails are composed."""
    states = {mail.state for mail in mails}
    for state in ("sending", "queued", "failed", "cancelled"):
        if state in states:
            return state
    return "sent"


def detail_of(mails: tuple[Mail, ...]) -> str:
    """The status text of a letter: the newest reply for the mail that determines its state."""
    state = state_of(mails)
    with_reply = [mail for mail in mails if mail.state == state and mail.detail]
    if not with_reply:
        return ""
    mail = with_reply[0]
    return f"Part {mail.part} of {mail.parts}: {mail.detail}" if mail.parts > 1 else mail.detail
