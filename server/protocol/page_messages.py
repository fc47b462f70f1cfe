"""What a page sends: its hello, its answers to offers and events, commands, and orders to its own replay."""

from __future__ import annotations

from typing import Annotated, Literal, NotRequired

from pydantic import Field
from typing_extensions import TypedDict

from server.protocol.commands import Command
from server.protocol.doc import doc
from server.protocol.replay_commands import ReplayOrder


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
