"""The connection to one rosbridge: roslibpy on our own event loop, watched, and without its queues.

Only `websocket`, `dialer` and this module use the internals of roslibpy and autobahn. They are written against the
versions in `ASSUMPTIONS`, which lists each assumption; each has its own test. What is replaced, and why:

- its transport runs a loop in a thread: `OwnLoop` adopts the running one;
- its client queues what is sent while down and delivers it on reconnecting: `send_now` refuses instead;
- its topics register again with every failed attempt: here the table of subscriptions is sent once per opening;
- its factory (see `dialer`), its detection of silence and its message limit (see `websocket`).
"""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Callable
from typing import Any

from server.rosbridge import connection_errors
from server.rosbridge.address import Address
from server.rosbridge.connection_errors import Problem
from server.rosbridge.dialer import RosClient
from server.rosbridge.frame_reader import Answer, FrameReader, InvalidFrame, Publish, Status, TooLarge
from server.rosbridge.link_listener import LinkListener, Marks, SafeCalls
from server.rosbridge.live_source import CallFailed, LinkDown, NoWebSocket, Refusal
from server.rosbridge.outgoing import NotAllowed, Outgoing
from server.rosbridge.raw_frame import RawFrame, topic_of
from server.rosbridge.sent_rows import SentRows
from server.rosbridge.subscription import Subscription, operation_of
from server.rosbridge.websocket import MAX_MESSAGE_BYTES, BridgeProtocol
from server.system.clean_text import short_text

ASSUMPTIONS = {
    "roslibpy": "2.1.0",
    "manager": "the factory takes its loop from its manager; autobahn below it takes it from the argument `loop`",
    "factory": "it calls _schedule_reconnect when a connection is lost, and dials nowhere but in _connect_async",
    "protocol": "onOpen calls factory.ready, onClose factory.connection_lost; onClose comes once, opened or not",
    "frames": "a message is onMessageBegin, of each frame onMessageFrameBegin, Data and End, then onMessageEnd",
    "state": "state is STATE_OPEN from the handshake to the first close frame; sendMessage raises in any other",
    "unread": "during the handshake, what was received is in `data`",
    "ros": "Ros.__init__ sets _id_counter, factory and is_connecting and then calls connect()",
}

FLUSH_S = 0.2
MAX_PENDING_CALLS = 64


class RosLink:
    """One vehicle's rosbridge for the life of its session: dialled, watched, resubscribed, never queued for.

    `now` is the session's monotonic clock in seconds. All methods are called on the loop it was made on.
    """

    keeps_types = True

    def __init__(
        self,
        address: Address,
        listener: LinkListener,
        *,
        now: Callable[[], float],
        take_unparsed: Callable[[RawFrame], bool] = lambda _: False,
        marks: Marks | None = None,
    ) -> None:
        """`take_unparsed` gets each publish first, unparsed; True: it needs no parsing, and no listener is called.
        `marks` measures the link's delay; None: it is not measured."""
        self.address = address
        self.attempts = 0
        self.heard_s: float | None = None  # when the bridge last sent anything, pongs included
        self._listener = listener
        self._safe = SafeCalls(address.shown)
        self._notify = self._safe.notify
        self._take_unparsed = take_unparsed
        self._now = now
        self._marks = marks
        self._ros = RosClient(address, self)
        self._socket: BridgeProtocol | None = None  # the open one
        self._rows = SentRows(self.send_now, lambda: self.is_open, marks)
        self._calls = ServiceCalls(self.send_now)
        self._stopped = False
        self._outgoing = Outgoing()
        self._reader = FrameReader(self._takes_unparsed)
        self._has_sent = False  # anything, on this connection
        self.junk_count = 0  # frames that were no operations, on this connection
        self.server_software = ""  # what the other side called itself in its newest handshake

    # -- for the session -----------------------------------------------------------------------------------------------

    @property
    def is_open(self) -> bool:
        return self._socket is not None and self._socket.state == self._socket.STATE_OPEN

    @property
    def frame_bytes(self) -> int:
        """The size of the current frame."""
        return self._reader.frame_bytes

    def start(self) -> None:
        self._ros.factory.connect()

    def retry_now(self) -> None:
        self._ros.factory.retry_now()

    def stop(self, *, is_flushed: bool = False) -> None:
        """Close the link finally, without further listener calls. Unsent data is dropped, except, with
        `is_flushed`, what was written just now, which gets a moment to arrive."""
        self._stopped = self._safe.is_stopped = True
        self._ros.factory.stop()
        self._calls.fail_all("the link was ended")
        if is_flushed and self._socket is not None:
            self._ros.factory.loop.call_later(FLUSH_S, self.abort)
        else:
            self.abort()

    def abort(self) -> None:
        """Drops the connection without a closing handshake, so that nothing buffered is delivered."""
        if self._socket is not None:
            self._socket.dropConnection(abort=True)

    def subscribe(self, wanted: Subscription) -> None:
        """Puts a row into the table; sent now if the link is open, and once at every opening."""
        if self._rows.table.get(wanted.topic) == wanted:
            return
        try:
            Outgoing().frame(operation_of("subscribe", wanted))
        except NotAllowed as why:  # a name that only a hostile or broken bridge offers
            self._safe.log_once(f"not subscribed: {why}")
            return
        self._rows.subscribe(wanted)

    def unsubscribe(self, topic: str) -> None:
        self._rows.unsubscribe(topic)

    def renew(self, topic: str) -> None:
        """Renew the subscription of a topic without messages."""
        self._rows.renew(topic)

    def again(self, topic: str) -> bool:
        """As `SentRows.again`."""
        return self._rows.again(topic)

    @property
    def subscriptions(self) -> tuple[Subscription, ...]:
        return tuple(self._rows.table.values())

    def send_now(self, operation: dict[str, Any]) -> None:
        """Writes one rosbridge operation to the open connection. Raises LinkDown when there is none, NotAllowed where
        it could do harm."""
        if self._socket is None or not self.is_open:
            raise LinkDown("not sent: no connection to the car")
        try:
            frame = self._outgoing.frame(operation)
        except NotAllowed as why:
            self._safe.log_once(f"not sent: {why}")
            raise
        self._has_sent = True
        self._socket.sendMessage(frame, isBinary=False)

    async def call(self, service: str, arguments: dict[str, Any] | None = None, *, timeout_s: float = 2.0) -> Any:
        """As `ServiceCalls.call`."""
        return await self._calls.call(service, arguments, timeout_s=timeout_s)

    def beside(self, listener: LinkListener) -> RosLink:
        """Another connection to the same bridge, not started, for calls that may be held up."""
        return RosLink(self.address, listener, now=self._now)

    def ping(self) -> None:
        """Send a ping behind all data sent before. Raises LinkDown."""
        if self._socket is None or not self.is_open:
            raise LinkDown("not sent: no connection to the car")
        self._socket.pings += 1
        self._socket.sendPing(b"%d" % self._socket.pings)

    @property
    def unanswered(self) -> int:
        """How many of these pings the bridge has not answered: so much of what was sent it may not have read."""
        return 0 if self._socket is None else self._socket.pings - self._socket.pongs

    @property
    def command_problem(self) -> str | None:
        """Every rosbridge takes messages."""
        return None

    def is_current(self, socket: BridgeProtocol) -> bool:
        """Whether this is the open connection."""
        return socket is self._socket

    def dial_failed(self, error: Exception) -> None:
        self._notify(self._listener.dial_failed, _problem_of_dialling(error, self.address))

    # -- from the protocol ---------------------------------------------------------------------------------------------

    def received(self, socket: BridgeProtocol, size: int) -> None:
        if socket is self._socket:
            self.heard_s = self._now()
            if self._marks is not None:
                self._marks.took(size)

    def opened(self, socket: BridgeProtocol) -> None:
        if self._stopped or self._socket is not None:
            socket.dropConnection(abort=True)
            return
        self._socket = socket
        self._reader = FrameReader(self._takes_unparsed)
        self._outgoing.reset()
        self._has_sent, self.junk_count = False, 0
        self.server_software = str((getattr(socket, "http_headers", None) or {}).get("server", ""))[:60]
        socket.was_accepted = True
        self.heard_s = self._now()
        if self._marks is not None:
            self._marks.open(self._now())
        self._rows.opened()
        self._notify(self._listener.link_opened)

    def send_mark(self, socket: BridgeProtocol) -> None:
        sent_s = self._now()
        is_followed = self._marks is not None and socket is self._socket
        socket.send_mark(sent_s, is_followed=is_followed)
        if self._marks is not None and is_followed:
            self._marks.sent(sent_s)

    def mark_answered(self, socket: BridgeProtocol, payload: bytes) -> None:
        if self._marks is None or socket is not self._socket:
            return
        sent_s = socket.take_mark(payload)
        if sent_s is not None:
            self._marks.answered(sent_s, self._now())

    def closed(self, socket: BridgeProtocol) -> None:
        if socket is not self._socket:
            return  # it never opened: the dialer reports it
        self._socket = None
        self._rows.closed()
        self._calls.fail_all("the connection to the bridge was lost")
        problem = _problem_of_end(socket, self.address, has_sent=self._has_sent)
        self._notify(self._listener.link_closed, problem)

    def _junk(self, socket: BridgeProtocol, why: str) -> None:
        if socket is self._socket:
            self.junk_count += 1
            self._notify(self._listener.junk_received, why)

    def skipped(self, socket: BridgeProtocol, head: bytes, tail: bytes, size: int) -> None:
        self._skipped(socket, topic_of(head, tail, is_binary=socket.message_is_binary), size)

    def _skipped(self, socket: BridgeProtocol, topic: str | None, size: int) -> None:
        if socket is self._socket:
            self._junk(socket, f"a message of more than {MAX_MESSAGE_BYTES // 2**20} MB")
            self._notify(self._listener.large_skipped, topic, size)

    def frame(self, socket: BridgeProtocol, payload: bytes, is_binary: bool) -> None:
        if socket is not self._socket:
            return  # stopped, or dropped: what is still in the pipe is no news
        match self._reader.read(payload, is_binary):
            case Publish(topic, message, note):
                if not self._notify(self._listener.message_received, topic, message, note):
                    self._junk(socket, "a message that caused an internal error")
            case Answer(operation):
                self._calls.answered(operation)
            case Status(level, text):
                self._notify(self._listener.status_received, level, text)
            case InvalidFrame(why):
                self._junk(socket, why)
            case TooLarge() as large:
                self._skipped(socket, large.topic, large.size)

    def _takes_unparsed(self, raw: RawFrame) -> bool:
        """Whether nothing more is to be done with a frame; it is parsed where this fails."""
        taken = False

        def take(frame: RawFrame) -> None:
            nonlocal taken
            taken = self._take_unparsed(frame)

        return self._notify(take, raw) and taken and not self._stopped


def _problem_of_dialling(error: Exception, address: Address) -> Problem:
    if isinstance(error, NoWebSocket):
        return connection_errors.of_handshake(address, str(error), error.answer)
    return connection_errors.of_dial_error(error, address)


def _problem_of_end(socket: BridgeProtocol, address: Address, *, has_sent: bool) -> Problem:
    """Why an open connection ended; `has_sent`: something was sent on it."""
    if socket.was_silent:
        return connection_errors.bridge_silent(address)
    if socket.failedByMe:
        return connection_errors.closed_by_bridge(address, str(socket.wasNotCleanReason))
    if socket.is_dismissed and not socket.has_spoken and has_sent:
        return connection_errors.login_wanted(address)
    return connection_errors.closed_by_bridge(address, short_text(socket.remoteCloseReason, 200))


class ServiceCalls:
    """Calls of services whose answers come on the same connection; of one link.

    `send` writes an operation at once; raises LinkDown, NotAllowed.
    """

    def __init__(self, send: Callable[[dict[str, Any]], None]) -> None:
        self._send = send
        self._pending: dict[str, asyncio.Future[Any]] = {}
        self._ids = itertools.count(1)

    async def call(self, service: str, arguments: dict[str, Any] | None = None, *, timeout_s: float = 2.0) -> Any:
        """The values a service answers. Raises LinkDown, also where the link breaks before the answer, or CallFailed
        with the bridge's text."""
        if len(self._pending) >= MAX_PENDING_CALLS:
            raise CallFailed("too many calls are unanswered")
        identity = f"call:{service}:{next(self._ids)}"
        answer: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        try:
            self._send({"op": "call_service", "id": identity, "service": service, "args": arguments or {}})
        except NotAllowed as why:
            raise CallFailed(f"not sent: {why}") from None
        self._pending[identity] = answer
        try:
            async with asyncio.timeout(timeout_s):
                return await answer
        except TimeoutError:
            raise CallFailed(f"{service} did not answer within {timeout_s:g} s") from None
        finally:
            self._pending.pop(identity, None)

    def answered(self, operation: dict[str, Any]) -> None:
        """Resolve the call that a `service_response` belongs to."""
        identity = operation.get("id")
        answer = self._pending.get(identity) if isinstance(identity, str) else None
        if answer is None or answer.done():
            return  # late: the caller has given up
        if operation.get("result") is False:
            answer.set_exception(Refusal(short_text(operation.get("values"), 300)))
        else:
            answer.set_result(operation.get("values"))

    def fail_all(self, why: str) -> None:
        """No answer comes any more."""
        for answer in list(self._pending.values()):
            if not answer.done():
                answer.set_exception(LinkDown(why))
