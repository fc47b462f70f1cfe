"""What the server sends to one page as text besides states: hello, offers, events, replies, problems, replays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, NotRequired, cast

from pydantic import Field
from typing_extensions import TypedDict

from monitor.alarm_spec import Priority
from server.protocol.alarm_state import LogEvent
from server.protocol.cars_state import Cars
from server.protocol.doc import doc
from server.protocol.state import ConnectionProblem, RecordedState, ReplayState, State

RoleName = Literal["viewer", "operator"]
FrameKind = Literal["state", "scan", "timeline", "cars", "beside"]


class Identity(TypedDict):
    """The device that a socket is of."""

    id: str
    name: str
    role: RoleName


class ServerHello(TypedDict):
    """What a server says first, without who asks."""

    kind: Literal["hello"]
    version: str
    boot: Annotated[str, doc("another one: another run of the server")]
    vehicle: str
    vehicles: list[str]
    build: Annotated[str, doc('of the page that the server has now; "" for single modules')]
    time_ms: int
    last_event: int
    veil_after_s: Annotated[float, doc("without a message for so long a page covers its values")]


class Hello(ServerHello):
    who: Identity


class Offer(TypedDict):
    """Something newer than the page has."""

    kind: Literal["offer"]
    seq: int
    of: list[FrameKind]


class Events(TypedDict):
    """Events of the log, at most 100."""

    kind: Literal["events"]
    events: list[LogEvent]
    last: Annotated[int, doc("the newest number there is")]


class RefusedAddress(ConnectionProblem):
    suggestion: Annotated[str | None, doc("an address that would do")]


class Answer(TypedDict):
    """What became of a command."""

    ok: bool
    reason: NotRequired[Annotated[str, doc("one sentence")]]
    problem: NotRequired[Annotated[RefusedAddress, doc("of an address that cannot be dialled")]]
    field: NotRequired[Annotated[str | None, doc("the setting at fault")]]
    conflict: NotRequired[Annotated[bool, doc("the settings changed meanwhile")]]
    version: NotRequired[Annotated[int, doc("of the settings, once changed")]]
    fence: NotRequired[Annotated[int, doc("number of the lease that the page has")]]
    held_by: NotRequired[Annotated[str | None, doc("who is in control instead")]]


class Reply(Answer):
    """The answer to one command."""

    kind: Literal["reply"]
    id: Annotated[str, doc("of the command")]


class Problem(TypedDict):
    """A message of the page that could not be understood or was too much; it has no id."""

    kind: Literal["problem"]
    reason: str


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


class Timeline(IndexedTimeline):
    """The time line of a recording."""

    kind: Literal["timeline"]
    notes: Annotated[list[str], doc("what is to be said of the file")]


class Beside(TypedDict):
    """The recording that is shown beside the one that the page replays, at its own moment."""

    kind: Literal["beside"]
    replay: ReplayState
    state: RecordedState
    notes: Annotated[list[str], doc("what is to be said of the file")]


class BesideEnded(TypedDict):
    """The recording beside is not shown any more; the first one is."""

    kind: Literal["beside_ended"]
    ended: Annotated[str, doc("one sentence")]


class ReplayEnded(TypedDict):
    """The page's replay is over, or could not begin; what follows is live."""

    kind: Literal["replay"]
    ended: Annotated[str, doc("one sentence")]


ToPage = Reply | Problem | ReplayEnded | BesideEnded
Message = Annotated[
    Hello | Offer | State | Cars | Events | Reply | Problem | Timeline | Beside | BesideEnded | ReplayEnded,
    Field(discriminator="kind"),
]


def reply(identity: str, answer: Mapping[str, Any] | Answer) -> Reply:
    """An answer in its envelope. No key of the answer replaces one of the envelope."""
    return cast(Reply, {**answer, "ok": answer.get("ok") is True, "kind": "reply", "id": identity})


def refusal(identity: str, reason: str) -> Reply:
    """A command that is refused, with why as a sentence."""
    return reply(identity, {"ok": False, "reason": reason})


def beside_ended(why: str) -> BesideEnded:
    return {"kind": "beside_ended", "ended": why}


def problem(reason: str) -> Problem:
    return {"kind": "problem", "reason": reason}


def replay_ended(reason: str) -> ReplayEnded:
    return {"kind": "replay", "ended": reason}
