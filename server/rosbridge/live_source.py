"""Where the messages of a car come from, as its session sees it, and what can go wrong there, as exceptions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from server.rosbridge.address import Address
from server.rosbridge.link_listener import LinkListener, Marks
from server.rosbridge.raw_frame import RawFrame
from server.rosbridge.subscription import Subscription


class LinkDown(ConnectionError):
    """Nothing was sent: there is no connection to the car. Nothing is kept to be sent later."""


class CallFailed(RuntimeError):
    """The bridge answered a service call with a failure, or not in time."""


class Refusal(CallFailed):
    """The bridge answered a service call with a failure, whose text only a rosbridge sends."""


class NoWebSocket(ConnectionError):
    """The connection was taken, and the handshake failed; `answer` is the beginning of the other side's answer."""

    def __init__(self, reason: str, answer: bytes) -> None:
        super().__init__(reason)
        self.answer = answer


class CommandChannel(Protocol):
    """The part of it over which the car is commanded."""

    @property
    def is_open(self) -> bool:
        """Whether messages can come, and commands go."""

    @property
    def heard_s(self) -> float | None:
        """When the other side last sent anything, on the session's clock."""

    @property
    def unanswered(self) -> int:
        """How many pings are not answered: so much of what was sent may not have arrived."""

    def send_now(self, operation: dict[str, Any]) -> None:
        """Send a rosbridge operation (a command). Raises LinkDown, NotAllowed."""

    def ping(self) -> None:
        """Request a sign of life, behind all that was sent before. Raises LinkDown."""

    def abort(self) -> None:
        """Drop the connection at once, so that nothing buffered is delivered later."""


class QuestionChannel(Protocol):
    """The part of it that answers a session's requests to rosapi."""

    @property
    def is_open(self) -> bool: ...

    @property
    def unanswered(self) -> int: ...

    def start(self) -> None: ...

    def stop(self) -> None: ...

    def ping(self) -> None: ...

    async def call(self, service: str, arguments: dict[str, Any] | None = None, *, timeout_s: float = 2.0) -> Any:
        """The values of a service, such as `/rosapi/topics`. Raises CallFailed where there is none, LinkDown."""


class LiveSource(CommandChannel, Protocol):
    """One car's source of messages for the life of its monitoring: `RosLink` (rosbridge) or `FoxgloveSource`.

    A new source has these methods, all called on one event loop, which return at once. It reports to its
    `LinkListener`: `link_opened` and `link_closed` at each opening and end, `dial_failed` after a failed attempt, and
    `message_received(topic, message, note)` for each message, a dict in rosbridge's JSON shape.
    The age of values is known by its `marks`: `open` at each opening, `subscribe` with each subscription, and every
    half second `sent` and `answered` of a ping.
    What is sent while nothing is open is refused with LinkDown, never queued.
    `Session(open_source=…)` takes the function that opens it.
    """

    @property
    def attempts(self) -> int:
        """How often it has dialled in vain since it was last open."""

    @property
    def frame_bytes(self) -> int:
        """The size of the message that is being reported."""

    @property
    def junk_count(self) -> int:
        """How much came on this connection that was no message."""

    @property
    def server_software(self) -> str:
        """The name of the other side's software; "" if unknown."""

    @property
    def keeps_types(self) -> bool:
        """Whether a subscription goes on with its type where its topic is offered with another one."""

    @property
    def command_problem(self) -> str | None:
        """Why no command can be sent over it, as a sentence; None: it can, or it is not known."""

    @property
    def subscriptions(self) -> tuple[Subscription, ...]:
        """What is subscribed to, kept over openings."""

    def start(self) -> None:
        """Dial, and dial again after each end, until it is stopped."""

    def retry_now(self) -> None:
        """Dial now, without the pause after a failed attempt."""

    def stop(self, *, is_flushed: bool = False) -> None:
        """End for good, and report nothing more. `is_flushed`: what was just sent leaves before."""

    def subscribe(self, wanted: Subscription) -> None:
        """Ask for a topic, now and at every opening; in place of an earlier subscription to it."""

    def unsubscribe(self, topic: str) -> None:
        """Ask for it no more."""

    def renew(self, topic: str) -> None:
        """Renew the subscription of a topic without messages: it ends and begins again; what comes between is lost."""

    def again(self, topic: str) -> bool:
        """Subscribe to a topic once more, without an end between: it is given what its publisher keeps. False: this
        source cannot, and has sent nothing."""

    async def call(self, service: str, arguments: dict[str, Any] | None = None, *, timeout_s: float = 2.0) -> Any:
        """The values of a service, such as `/rosapi/topics`. Raises CallFailed where there is none, LinkDown."""

    def beside(self, listener: LinkListener) -> QuestionChannel:
        """Another channel to the same car, not started, for calls that may be held up."""


class OpenSource(Protocol):
    """Makes the source of a car that is dialled; `open_source` does, by the address."""

    def __call__(
        self,
        address: Address,
        listener: LinkListener,
        *,
        now: Callable[[], float],
        take_unparsed: Callable[[RawFrame], bool],
        marks: Marks | None,
    ) -> LiveSource: ...
