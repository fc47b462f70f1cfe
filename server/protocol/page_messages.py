"""What a page sends: its hello, its answers to offers and events, commands, and orders to its own replay."""

from __future__ import annotations

from typing import Annotated, Any, Literal, NotRequired

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError
from typing_extensions import TypedDict

from server.protocol.commands import Command, NotUnderstood
from server.protocol.doc import doc

Moment = Annotated[float, Field(allow_inf_nan=False, ge=-1e9, le=1e9)]

ShortText = Annotated[str, Field(max_length=300)]


class _ReplayOrder(BaseModel):
    model_config = ConfigDict(extra="ignore", strict=True, frozen=True)
    kind: Literal["replay"]
    id: Annotated[str, Field(max_length=80)] | None = None


class OpenReplay(_ReplayOrder):
    """Opens a recording by its id, at a moment [s since its beginning]. `topics` (signal → topic) and `units` (signal →
    name) are chosen for this replay, before those that were recorded."""

    do: Literal["open"]
    recording: Annotated[str, Field(min_length=1, max_length=120)]
    at_s: Moment = 0.0
    topics: dict[ShortText, ShortText] = Field(default_factory=dict, max_length=50)
    units: dict[ShortText, ShortText] = Field(default_factory=dict, max_length=50)


class OpenBeside(_ReplayOrder):
    """Opens a second recording beside the one that is replayed, to compare both."""

    do: Literal["beside"]
    recording: Annotated[str, Field(min_length=1, max_length=120)]
    at_s: Moment = 0.0


class CloseBeside(_ReplayOrder):
    """Closes the second recording; the first one stays."""

    do: Literal["alone"]


class _LedReplay(_ReplayOrder):
    beside: bool = False  # for the second recording, not the first


class LeaveReplay(_ReplayOrder):
    """Back to live."""

    do: Literal["leave"]


class SeekReplay(_LedReplay):
    """To a moment; beyond an end is that end."""

    do: Literal["seek"]
    at_s: Moment


class PlayReplay(_LedReplay):
    """Resumes; from the beginning where it is at the end."""

    do: Literal["play"]


class PauseReplay(_LedReplay):
    """Stands still."""

    do: Literal["pause"]


class SetReplayRate(_LedReplay):
    """The pace: 0.25, 0.5, 1, 2, 4, 8 or 16."""

    do: Literal["rate"]
    rate: Annotated[float, Field(allow_inf_nan=False, gt=0, le=100)]


class SeekReplayAlarm(_ReplayOrder):
    """To the alarm after (1) or before (−1) this moment."""

    do: Literal["alarm"]
    direction: Literal[-1, 1]


ReplayOrder = (
    OpenReplay
    | OpenBeside
    | CloseBeside
    | LeaveReplay
    | SeekReplay
    | PlayReplay
    | PauseReplay
    | SetReplayRate
    | SeekReplayAlarm
)
_REPLAY_ORDERS: TypeAdapter[ReplayOrder] = TypeAdapter(Annotated[ReplayOrder, Field(discriminator="do")])


def read_replay_order(message: Any) -> ReplayOrder:
    """The order in a decoded JSON value. Raises NotUnderstood."""
    try:
        return _REPLAY_ORDERS.validate_python(message)
    except ValidationError as error:
        raise NotUnderstood.of(error, whole="the order", no_such="A replay has no such command.") from None


def opening(recording: str | None, moment: str | None) -> OpenReplay | None:
    """From an address: a moment that is none is the beginning, and what cannot be a recording's id is looked for like
    any other, so that its page reports that there is none."""
    if recording is None:
        return None
    try:
        at_s = float(moment) if moment is not None else 0.0
    except ValueError:
        at_s = 0.0
    at_s = min(max(at_s, 0.0), 1e9) if at_s == at_s else 0.0
    return OpenReplay(kind="replay", do="open", recording=recording[:120] or "?", at_s=at_s)


class PageHello(TypedDict):
    """Before everything else but `take`: the server then sends what the page missed, and no event before it (or 10 s
    after the connection, where none comes). A command that comes before it is refused, also that of a client which
    sends no hello; a `present` that comes before it does not count."""

    kind: Literal["hello"]
    have_event: NotRequired[Annotated[int | None, doc("number of the newest event that the page has")]]
    boot: NotRequired[Annotated[str | None, doc("of the run that it is of")]]
    name: NotRequired[Annotated[str, doc("what its operator calls it")]]
    build: NotRequired[
        Annotated[
            str,
            doc('which page it is; "" for single modules. With `page` and without it: former names of phases'),
        ]
    ]
    page: NotRequired[
        Annotated[str, doc("what it calls itself, kept over reloads; without it the server gives it one")]
    ]


class Take(TypedDict):
    """Takes what was offered, or states that a state came which was sent ahead."""

    kind: Literal["take"]
    seq: Annotated[int, doc("of the offer; 0: of none")]
    n: NotRequired[Annotated[int, doc("counts the takes of a connection from 1 on")]]
    ahead: NotRequired[Annotated[int, doc("so many states may be under way, sent without an offer; at most 12")]]
    got: NotRequired[Annotated[int, doc("with `ahead`: how many states this connection has brought")]]


class Have(TypedDict):
    """The page has the events that were sent."""

    kind: Literal["have"]
    event: Annotated[int, doc("number of the newest of them")]


class Watch(TypedDict):
    """Whether the page shows scans: they are sent to no other."""

    kind: Literal["watch"]
    scan: bool


PageMessage = Annotated[
    PageHello | Take | Have | Watch | Annotated[ReplayOrder, Field(discriminator="do")] | Command,
    Field(discriminator="kind"),
]
