"""What the server sends to one page as text besides states: hello, offers, events, replies, problems, replays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, NotRequired, cast

from pydantic import Field
from typing_extensions import TypedDict

from monitor.alarm_spec import Priority
from server.bus.bus import NotServed
from server.protocol.alarm_state import LogEvent
from server.protocol.cars_state import Cars
from server.protocol.doc import doc
from server.protocol.marks import DriveMark
from server.protocol.operator_state import HandoverState
from server.protocol.people import Duty
from server.protocol.state import ConnectionProblem, RecordedState, ReplayState, State

RoleName = Literal["viewer", "operator"]
FrameKind = Literal["state", "scan", "timeline", "cars", "beside"]


class Identity(TypedDict):
    """The device that a socket is of."""

    id: str
    name: str
    role: RoleName


class ServerHello(TypedDict):
    """The first message of a server, without the recipient."""

    kind: Literal["hello"]
    version: str
    boot: Annotated[str, doc("another one: another run of the server; numbers of events are of a run")]
    run: Annotated[str, doc("of the server that the page reached; times of another one may be of another clock")]
    vehicle: str
    vehicles: list[str]
    build: Annotated[str, doc('of the page that the server has now; "" for single modules')]
    time_ms: int
    last_event: int
    veil_after_s: Annotated[float, doc("without a message for so long a page covers its values")]
    resumes: NotRequired[Annotated[bool, doc("a page whose hello names another run gets `resumed`")]]
    signs: NotRequired[Annotated[bool, doc("of a web node: orders are signed, as agents require it")]]


class Hello(ServerHello):
    who: Identity
    ticket: Annotated[
        str,
        doc('for the next socket of this device, until 10 minutes after the end of its last one; "": none is needed'),
    ]


class Offer(TypedDict):
    """Something newer than the page has."""

    kind: Literal["offer"]
    seq: int
    of: list[FrameKind]
    took_ms: Annotated[int, doc("when the page's last take was received; before the first, when it connected")]
    took: NotRequired[Annotated[int, doc("its number `n`; 0: it had none, or there was none yet")]]


class Resumed(TypedDict):
    """How the log continues for a page that read it in another run."""

    common: Annotated[
        int, doc("up to this number it is the log that the page has; what the page has beyond is not in it")
    ]
    new_after: Annotated[int, doc("events after this number are new; those up to it may be known from another log")]


class Events(TypedDict):
    """Events of the log, at most 400."""

    kind: Literal["events"]
    events: list[LogEvent]
    last: Annotated[int, doc("the newest number there is")]
    resumed: NotRequired[
        Annotated[Resumed, doc("with the first ones for a page whose hello names another run; then there may be none")]
    ]


class RefusedAddress(ConnectionProblem):
    suggestion: Annotated[str | None, doc("an address that would do")]


class HandedOver(TypedDict):
    """For the web node: control was handed over, so who had it is not on duty there any more."""

    device: Annotated[str, doc("under which somebody was on duty")]
    to: str
    ago_s: NotRequired[Annotated[float, doc("of `outcome`: how long ago")]]


class Answer(TypedDict):
    """What became of a command."""

    ok: bool
    outcome: NotRequired[
        Annotated[
            Literal["refused", "not_delivered", "unknown"],
            doc("of one that is not ok: refused where left out; not_delivered: it never will be; unknown: it may be"),
        ]
    ]
    cut: NotRequired[
        Annotated[Literal["server-broker", "broker-agent", "agent-car"] | None, doc("where it was lost, where known")]
    ]
    became: NotRequired[
        Annotated[
            Literal["done", "refused", "never", "under_way", "not_known"], doc("of `outcome`; never: nor will it be")
        ]
    ]
    reason: NotRequired[Annotated[str, doc("one sentence")]]
    problem: NotRequired[Annotated[RefusedAddress, doc("of an address that cannot be dialled")]]
    field: NotRequired[Annotated[str | None, doc("the setting at fault")]]
    conflict: NotRequired[Annotated[bool, doc("the settings changed meanwhile")]]
    version: NotRequired[Annotated[int, doc("of the settings, once changed")]]
    fence: NotRequired[Annotated[int, doc("number of the lease that the page has")]]
    handover: NotRequired[Annotated[HandoverState | None, doc("what is in force now, where a read-back was refused")]]
    handed_over: NotRequired[Annotated[HandedOver, doc("not sent to pages")]]
    held_by: NotRequired[Annotated[str | None, doc("who is in control instead")]]


class Reply(Answer):
    """The answer to one command."""

    kind: Literal["reply"]
    id: Annotated[str, doc("of the command")]


class Problem(TypedDict):
    """A message of the page that could not be understood or was too much; it has no id."""

    kind: Literal["problem"]
    reason: str


class Unserved(TypedDict):
    """Of web nodes, twice a second while nothing comes from the vehicle's session; over with the next state."""

    kind: Literal["unserved"]
    why: Annotated[str, doc("one sentence")]


class Mark(TypedDict):
    """An announcement of an alarm in a recording."""

    at_s: float
    alarm: str
    title: str
    priority: Priority
    text: str
    duration_s: Annotated[float | None, doc("until it returned to normal; null: not yet, as far as `done_s`")]


class IndexedTimeline(TypedDict):
    """What one reading of a recording finds."""

    length_s: float
    done_s: Annotated[float, doc("how far it is made")]
    is_done: bool
    bucket_s: float
    speed_mps: Annotated[list[float | None], doc("the highest of each bucket, a sketch beyond `done_s`; null: none")]
    gaps: Annotated[list[tuple[float, float]], doc("where nothing at all was recorded for more than a second")]
    marks: Annotated[list[Mark], doc("at most 400, the most urgent")]
    marks_left_out: int


class ReplayIntervention(TypedDict):
    """An intervention in a recording."""

    at_s: float
    kind_of: Annotated[str, doc("as of the event; of another version it may be another value")]
    category: str | None
    what: Annotated[str, doc('its description, also one that came later; "" and no category: nobody described it')]


class DrivenSpan(TypedDict):
    """A time in one mode."""

    mode: Annotated[str, doc("autonomous · manual · unknown")]
    from_s: float
    to_s: float


class Timeline(IndexedTimeline):
    """The time line of a recording."""

    kind: Literal["timeline"]
    flags: Annotated[list[DriveMark], doc("moments that somebody marked, oldest first; at most 400, texts shortened")]
    interventions: Annotated[list[ReplayIntervention], doc("oldest first, at most 400")]
    modes: Annotated[list[DrivenSpan], doc("who drove when, without a gap, at most 400; empty: not recorded")]
    notes: Annotated[list[str], doc("remarks on the file")]


class Beside(TypedDict):
    """The recording that is shown beside the one that the page replays, at its own moment."""

    kind: Literal["beside"]
    replay: ReplayState
    state: RecordedState
    notes: Annotated[list[str], doc("remarks on the file")]


class BesideEnded(TypedDict):
    """The recording beside is not shown any more; the first one is."""

    kind: Literal["beside_ended"]
    ended: Annotated[str, doc("one sentence")]


class ReplayEnded(TypedDict):
    """The page's replay is over, or could not begin; what follows is live."""

    kind: Literal["replay"]
    ended: Annotated[str, doc("one sentence")]


class FleetEvent(TypedDict):
    """To a page of all cars: what happened to the item of one, the newest 20 first, then each new one."""

    kind: Literal["fleet_event"]
    vehicle: str
    n: Annotated[int, doc("its number in the log of the car")]
    time_ms: int
    text: str
    by: Annotated[str | None, doc("who did it, where a person did")]


ToPage = Reply | Problem | ReplayEnded | BesideEnded | Unserved | Duty
Message = Annotated[
    Hello
    | Offer
    | State
    | Cars
    | Events
    | Reply
    | Problem
    | Timeline
    | Beside
    | BesideEnded
    | ReplayEnded
    | Unserved
    | FleetEvent
    | Duty,
    Field(discriminator="kind"),
]


def reply(identity: str, answer: Mapping[str, Any] | Answer) -> Reply:
    """An answer in its envelope. No key of the answer replaces one of the envelope."""
    return cast(Reply, {**answer, "ok": answer.get("ok") is True, "kind": "reply", "id": identity})


def refusal(identity: str, reason: str) -> Reply:
    """A command that is refused, with why as a sentence."""
    return reply(identity, {"ok": False, "reason": reason})


MAYBE = "It may have been carried out."  # core/outcome.js has it too


def not_served(why: NotServed, trouble: str | None = None) -> Answer:
    """A command that no session answered; `trouble`: a better sentence than the one in `why`."""
    text = (trouble or str(why)).rstrip(".")
    if why.outcome == "unknown":
        reason = f"{text[:1].upper()}{text[1:]}. {MAYBE}"
    else:
        reason = f"Not delivered: {text[:1].lower()}{text[1:]}."
    return {"ok": False, "reason": reason, "outcome": why.outcome, "cut": why.cut}


def beside_ended(why: str) -> BesideEnded:
    return {"kind": "beside_ended", "ended": why}


def problem(reason: str) -> Problem:
    return {"kind": "problem", "reason": reason}


def replay_ended(reason: str) -> ReplayEnded:
    return {"kind": "replay", "ended": reason}
