"""Mail over HTTP: ordered, listed, cancelled, sent again; its settings without the password; a trial of them."""

from __future__ import annotations

import re
from dataclasses import asdict
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Body, Query, Request
from fastapi import Path as InPath
from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from server.control import display_name
from server.mail import address, compose
from server.mail.mail_folder import MailRefused
from server.mail.mailer import Mailer
from server.mail.order import Format, Letter, Order, State, TooLarge, Way
from server.mail.settings import BadMailSetting, MailSettings, Security
from server.mail.test_mail import MailTestFailed, Trial, try_out
from server.web.interface import OF_KEPT, raises
from server.web.middleware.errors import Problem
from server.web.routes.session_request import NAME_HEADER
from server.web.services import services

router = APIRouter(prefix="/api/mail", tags=["mail"], responses=raises(*OF_KEPT, 409, 507))
MAX_RECIPIENTS = 20
MAX_RECORDINGS = 20
_HOST = re.compile(r"[A-Za-z0-9.-]{1,253}(:\d{1,5})?|\[[0-9A-Fa-f:.]{2,45}\](:\d{1,5})?")
Number = Annotated[int, InPath(ge=1, le=2**53, description="The mail's `n` in the outbox")]
Line = Annotated[str, StringConstraints(max_length=400)]


class MailOrder(BaseModel):
    """Recordings, recipients and text of a mail."""

    model_config = ConfigDict(extra="forbid", strict=True)
    recordings: list[Annotated[str, StringConstraints(min_length=1, max_length=100)]] = Field(
        min_length=1, max_length=MAX_RECORDINGS, description="Ids of finished recordings"
    )
    format: Format = "mcap"
    to: list[Line] = Field(
        min_length=1, max_length=MAX_RECIPIENTS, examples=[["ann@example.org"]], description="One address each"
    )
    subject: str = Field("", max_length=200, description="One line; left empty: the name of the recording")
    text: str = Field("", max_length=20_000)
    too_large: TooLarge = Field(
        "split", description="What becomes of more than the size limit: numbered parts, or a link"
    )
    key: str | None = Field(
        None, pattern=r"^[A-Za-z0-9-]{8,64}$", description="A name for this request: sent twice, it is one mail"
    )


class RecipientOut(BaseModel):
    address: str
    state: Literal["waiting", "accepted", "refused"]
    reply: str = Field(serialization_alias="said", description="The server's reply")


class PartOut(BaseModel):
    """One mail of an order."""

    part: int
    parts: int
    message_id: str
    state: State
    reply: str = Field(serialization_alias="said")
    attempts: int
    next_ms: int | None = Field(description="When it is tried again; null: it does not wait")
    done_ms: int | None
    size_bytes: int = Field(description="As sent")
    recipients: list[RecipientOut]


class MailOut(BaseModel):
    """One order and its state."""

    n: int
    key: str
    ordered_ms: int
    by: str
    recordings: list[str]
    format: Format
    to: list[str] = Field(description="Domains in their own letters")
    subject: str
    too_large: TooLarge
    state: State
    reply: str = Field(
        serialization_alias="said", description="The server's reply, or why it waits or failed; may be empty"
    )
    is_ready: bool = Field(description="False: its mails are still being made")
    share: float | None = Field(description="How much is made, or sent of the mail on its way: 0 to 1; null: neither")
    way: Way | None = Field(description="attached, split or link; null: not made yet")
    size_bytes: int | None = Field(description="Of what is attached, all parts together")
    sha256: str | None
    parts: list[PartOut]


class OutboxOut(BaseModel):
    mails: list[MailOut]
    next: int | None = Field(description="Ask with `before` of this for older ones; null: there are none")
    trouble: str | None = Field(description="Why nothing is kept or sent now; null: nothing is wrong")


class MailSettingsIn(BaseModel):
    """All of the settings; the password may be left out and stays what it is."""

    model_config = ConfigDict(extra="forbid", strict=True)
    host: str = Field("", max_length=253, examples=["smtp.example.org"], description="Empty: no mail is sent")
    port: int = Field(587, ge=1, le=65535)
    security: Security = "starttls"
    user: str = Field("", max_length=320, description="Empty: no login")
    password: str | None = Field(
        None,
        max_length=500,
        description="Never returned. Left out: unchanged, but another host, port or user needs it again. Empty: none",
        json_schema_extra={"writeOnly": True, "format": "password"},
    )
    sender: str = Field("", max_length=320, examples=["car@example.org"])
    sender_name: str = Field("", max_length=100)
    allowed: list[Line] = Field(
        default_factory=list,
        max_length=200,
        examples=[["example.org", "*.example.org", "ann@example.com"]],
        description="Who may be written to: addresses, domains, all below a domain; empty: everyone",
    )
    report_to: list[Line] = Field(
        default_factory=list, max_length=20, description="Who gets the report of each drive by itself; empty: nobody"
    )
    limit_mb: float = Field(18.0, description="What is attached to one mail at most [10⁶ bytes], before it is encoded")
    link_base: str = Field(
        "", max_length=300, description="This server as who gets a link reaches it; empty: as the page"
    )
    ca: str = Field("", max_length=32_768, description="PEM; where given, only servers that it certifies are trusted")


class MailSettingsOut(BaseModel):
    """The settings in force. The password is not among them."""

    host: str
    port: int
    security: Security
    user: str
    has_password: bool
    sender: str
    sender_name: str
    allowed: list[str]
    report_to: list[str]
    limit_mb: float
    link_base: str
    ca: str
    is_complete: bool = Field(description="Whether anything can be sent")
    complaints: list[str] = Field(description="What was found wrong with what was kept, when the server started")


class MailTestIn(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)
    to: str | None = Field(
        None, max_length=400, description="Where a short mail is sent; left out: only the login is tried"
    )


class MailTestOut(BaseModel):
    """The server took it."""

    sentence: str
    reply: str = Field(serialization_alias="said", description="The server's last reply")
    is_encrypted: bool
    largest_bytes: int | None = Field(
        description="The largest mail that the server accepts, as it states; null: it does not state it"
    )


@router.post("", status_code=202, summary="Mail recordings; they wait in the outbox until they are sent")
async def order(request: Request, body: Annotated[MailOrder, Body()]) -> MailOut:
    mailer = _mailer(request)
    try:
        to = address.parse_all(body.to)
    except address.BadAddress as why:
        raise Problem(422, str(why), field="to") from None
    if not compose.is_one_line(body.subject):
        raise Problem(422, "A subject is one line of printable characters.", field="subject")
    if any((ord(letter) < 32 and letter not in "\t\r\n") or letter == "\x7f" for letter in body.text):
        raise Problem(422, "The message holds signs that are no text.", field="text")
    recordings = tuple(dict.fromkeys(body.recordings))
    placed = Order(
        recordings=recordings,
        format=body.format,
        to=tuple(one.text for one in to),
        subject=body.subject.strip() or f"Recording {recordings[0]}",
        text=body.text,
        too_large=body.too_large,
        by=display_name.clean(request.headers.get(NAME_HEADER))
        or display_name.of_program(request.headers.get("user-agent")),
        base=_base(request),
    )
    try:
        return _out(mailer, await mailer.order(body.key or mailer.new_key(), placed))
    except MailRefused as why:
        raise _problem(why) from None


@router.get("", summary="The outbox, newest first")
async def outbox(
    request: Request,
    before: Annotated[int | None, Query(ge=1, le=2**53, description="Only mails with smaller numbers")] = None,
    limit: Annotated[int, Query(ge=1, le=200)] = 50,
) -> OutboxOut:
    mailer = _mailer(request)
    trouble = None
    letters: list[Letter] = []
    try:
        letters = await mailer.letters(before, limit)
    except MailRefused as why:
        trouble = str(why)
    return OutboxOut(
        mails=[_out(mailer, letter) for letter in letters],
        next=letters[-1].n if len(letters) == limit else None,
        trouble=trouble or mailer.trouble,
    )


@router.get("/settings", summary="How mail is sent; without the password")
async def settings(request: Request) -> MailSettingsOut:
    mailer = _mailer(request)
    return _settings_out(mailer.settings, mailer.complaints)


@router.put("/settings", summary="Set how mail is sent; what waits is tried with it at once")
async def change_settings(request: Request, body: Annotated[MailSettingsIn, Body()]) -> MailSettingsOut:
    mailer = _mailer(request)
    try:
        return _settings_out(await mailer.change(body.model_dump()), [])
    except BadMailSetting as why:
        raise Problem(422, str(why), field=why.field) from None
    except MailRefused as why:
        raise _problem(why) from None


@router.post("/test", summary="Dial the mail server with the settings in force, log in, send a short mail")
async def test(request: Request, body: Annotated[MailTestIn, Body()]) -> MailTestOut:
    mailer = _mailer(request)
    if not mailer.settings.is_complete:
        raise Problem(409, "Give SMTP host and sender first.", field="host" if not mailer.settings.host else "sender")
    to = None
    if body.to:
        try:
            to = address.parse(body.to)
        except address.BadAddress as why:
            raise Problem(422, str(why), field="to") from None
        if not address.is_allowed(to, mailer.settings.allowed):
            raise Problem(422, f"{to.shown} is not among the allowed recipients.", field="to")
    try:
        found: Trial = await try_out(mailer.settings, to, services(request).wall_ms())
    except MailTestFailed as why:
        raise Problem(502, str(why)) from None
    return MailTestOut(**asdict(found))


@router.get("/{n}", summary="One mail of the outbox")
async def one(request: Request, n: Number) -> MailOut:
    mailer = _mailer(request)
    try:
        return _out(mailer, await mailer.letter(n))
    except MailRefused as why:
        raise _problem(why) from None


@router.post("/{n}/cancel", summary="Send nothing more of it")
async def cancel(request: Request, n: Number) -> MailOut:
    mailer = _mailer(request)
    try:
        return _out(mailer, await mailer.cancel(n))
    except MailRefused as why:
        raise _problem(why) from None


@router.post("/{n}/resend", summary="Try what has not arrived again now; what was sent is sent once more as a whole")
async def resend(request: Request, n: Number) -> MailOut:
    mailer = _mailer(request)
    try:
        return _out(mailer, await mailer.resend(n))
    except MailRefused as why:
        raise _problem(why) from None


def _mailer(request: Request) -> Mailer:
    found: Mailer | None = services(request).mailer
    if found is None:
        raise Problem(404, services(request).where_kept("to send mail"))
    return found


def _problem(why: MailRefused) -> Problem:
    return Problem(why.status, str(why), **({"field": why.field} if why.field else {}))


def _base(request: Request) -> str:
    """The server's address in the request, for links; empty if it is not valid. At a web node that of the agent."""
    host, before = request.headers.get("host", ""), request.scope.get("root_path", "")
    return f"{request.url.scheme}://{host}{before}" if _HOST.fullmatch(host) else ""


def _settings_out(settings: MailSettings, complaints: list[str]) -> MailSettingsOut:
    lists = {"allowed": list(settings.allowed), "report_to": list(settings.report_to)}
    body: dict[str, Any] = {name: value for name, value in asdict(settings).items() if name != "password"} | lists
    return MailSettingsOut(
        **body, has_password=bool(settings.password), is_complete=settings.is_complete, complaints=complaints
    )


def _out(mailer: Mailer, letter: Letter) -> MailOut:
    order = letter.order
    return MailOut(
        n=letter.n,
        key=letter.key,
        ordered_ms=letter.ordered_ms,
        by=order.by,
        recordings=list(order.recordings),
        format=order.format,
        to=[address.parse(one).shown for one in order.to],
        subject=order.subject,
        too_large=order.too_large,
        state=letter.state,
        reply=letter.detail,
        is_ready=letter.is_ready,
        share=mailer.share_of(letter),
        way=letter.way,
        size_bytes=letter.size_bytes,
        sha256=letter.sha256,
        parts=[
            PartOut(
                part=mail.part,
                parts=mail.parts,
                message_id=mail.message_id,
                state=mail.state,
                reply=mail.detail,
                attempts=mail.attempts,
                next_ms=mail.next_ms if mail.state == "queued" else None,
                done_ms=mail.done_ms,
                size_bytes=mail.size_bytes,
                recipients=[
                    RecipientOut(address=address.parse(one.address).shown, state=one.state, reply=one.detail)
                    for one in mail.recipients
                ],
            )
            for mail in letter.mails
        ],
    )
