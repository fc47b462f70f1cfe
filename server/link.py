"""The connection to one rosbridge: roslibpy on our own event loop, watched, and without its queues.

The only file that imports roslibpy, or knows its inside and that of autobahn below it. Written against the versions in
`ASSUMPTIONS`; each thing assumed of them is named there and held by a test of its own. What is replaced, and why:

- its transport runs a loop in a thread: `_OwnLoop` adopts the running one;
- its client queues what is sent while down and delivers it on reconnecting: `send_now` refuses instead;
- its topics register anew with every failed attempt: the table of subscriptions here is sent once an opening;
- its back-off grows to an hour, its dialling has no time-out, takes the first address that accepts and cannot be
  abandoned: `_Dialler` is one task that does all of it;
- a half-open link goes unseen, and autobahn's own pings come by the thousand or give up after 0.1 s, because its timers
  round to whole seconds: `_BridgeProtocol` pings and watches by itself;
- a message beyond the limit ends the connection, to come again with the next: it is skipped here.
"""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import itertools
import logging
import os
import socket as sockets
import ssl
import struct
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

os.environ.setdefault("ROSLIBPY_TRANSPORT", "asyncio")  # before anything lets txaio choose Twisted for the process

import roslibpy
from roslibpy.comm.comm_asyncio import AsyncioRosBridgeClientFactory, AsyncioRosBridgeProtocol

from server import frames, problems
from server.address import Address, BadAddress, refuse_forbidden
from server.clean_text import clean
from server.fragments import Fragments, TooLarge, is_fragment
from server.large_message import ENDS_BYTES, topic_of
from server.outgoing import NotAllowed, Outgoing
from server.problems import Problem
from server.raw_frame import RawFrame, raw_frame
from server.supervision import Supervisor

log = logging.getLogger("catgraph.link")
for _name in ("autobahn", "txaio", "roslibpy"):  # they tell each dropped connection; the operator hears it from us
    logging.getLogger(_name).addHandler(logging.NullHandler())
    logging.getLogger(_name).propagate = False

ASSUMPTIONS = {
    "roslibpy": "2.1.0",
    "manager": "the factory takes its loop from its manager; autobahn below it takes it from the argument `loop`",
    "factory": "it calls _schedule_reconnect when a connection is lost, and dials nowhere but in _connect_async",
    "protocol": "onOpen tells factory.ready, onClose factory.connection_lost; onClose comes once, opened or not",
    "frames": "a message is onMessageBegin, of each frame onMessageFrameBegin, Data and End, then onMessageEnd",
    "state": "state is STATE_OPEN from the handshake to the first close frame; sendMessage raises in any other",
    "unread": "while shaking hands, what was received stands in `data`",
    "ros": "Ros.__init__ sets _id_counter, factory and is_connecting and then calls connect()",
}

PING_EVERY_S = 0.1  # each answer bounds how old what comes after it can be
SILENT_AFTER_S = 1.6  # the answer to a ping may take 1.3 s; a dead link is dropped, and said, within 2 s
LATE_S = 0.1  # a look later than this says that we were held up ourselves
LOOKUP_TIMEOUT_S = 4.0
DIAL_TIMEOUT_S = 4.0  # over all addresses of a host, but at least a second for each
HANDSHAKE_TIMEOUT_S = 3.0
GOODBYE_S = 0.5
LAST_WORD_S = 0.2
FIRST_RETRY_S = 0.2
LAST_RETRY_S = 2.0
RETRY_GROWTH = 1.7
STEADY_S = 2.0  # a connection that held this long was one; the next is tried for at once
MAX_ADDRESSES = 4
MAX_HANDSHAKE_BYTES = 64 * 1024
MAX_MESSAGE_BYTES = (
    16 * 1024 * 1024
)  # a 100 000-beam cloud fits; reading a 40 MB message would stop the loop for a second
MAX_SKIPPED_BYTES = 256 * 1024 * 1024  # a frame that claims more is no message, and would swallow all that follows
MAX_PENDING_CALLS = 64
MAX_FAULTS = 200  # different ones that are logged
MARK = b"t"  # how the payload of such a ping begins
MAX_MARKS = 600


class LinkDown(ConnectionError):
    """Nothing was sent: there is no connection to the car. Nothing is kept to be sent later."""


class CallFailed(RuntimeError):
    """The bridge answered a service call with a failure, or not in time."""


class Refusal(CallFailed):
    """The bridge answered a service call with a failure: in its own words, which only a rosbridge sends."""


class NoWebSocket(ConnectionError):
    """The connection was taken, and the handshake failed; `answer` is how the other side's words began."""

    def __init__(self, reason: str, answer: bytes) -> None:
        super().__init__(reason)
        self.answer = answer


class Marks(Protocol):
    """Who follows how late the link is."""

    def open(self, at_s: float) -> None: ...
    def sent(self, at_s: float) -> None: ...
    def answered(self, sent_s: float, at_s: float) -> None: ...
    def subscribe(self, topic: str, queue_length: int, throttle_s: float = 0.0) -> None: ...


class LinkListener(Protocol):
    """Who is told what happens on the link; every method returns at once."""

    def link_opened(self) -> None: ...
    def link_closed(self, problem: Problem) -> None: ...
    def dial_failed(self, problem: Problem) -> None: ...
    def message_received(self, topic: str, message: Any, note: str | None) -> None: ...
    def status_received(self, level: str, text: str) -> None: ...
    def junk_received(self, why: str) -> None: ...
    def large_skipped(self, topic: str | None, size: int) -> None: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Subscription:
    """One row of the subscription table; `type` None leaves it to the bridge to know."""

    topic: str
    type: str | None
    compression: str = "none"  # or "cbor"
    throttle_ms: int = 0
    queue_length: int = 0

    def is_like(self, other: Subscription) -> bool:
        """The same but for how often: the bridge takes that over without an end and a beginning."""
        return (self.topic, self.type, self.compression) == (other.topic, other.type, other.compression)


class _OwnLoop:
    """What roslibpy calls an event loop manager, around the loop that already runs."""

    def __init__(self) -> None:
        self.loop = asyncio.get_running_loop()

    def run(self) -> None:
        """The loop runs already."""


class _BridgeProtocol(AsyncioRosBridgeProtocol):  # type: ignore[misc]
    """One WebSocket to the bridge: watched for silence, and handing whole messages to the link that owns it."""

    def connection_made(self, transport: asyncio.Transport) -> None:
        self.settled = asyncio.Event()  # opened, or closed without
        self.gone = asyncio.Event()
        self.was_accepted = False  # by the link, when it opened
        self.was_silent = False
        self.is_dismissed = False  # the bridge said goodbye without a code
        self.has_spoken = False  # a message came
        self.message_data: list[bytes] = []
        self.message_head = self.message_tail = b""  # of one that is skipped
        self.pings = self.pongs = 0  # of `RosLink.ping`: sent, and the newest that was answered
        self.marks_sent: deque[tuple[bytes, float]] = deque(maxlen=MAX_MARKS)  # payload of a ping, when it was sent
        self.mark_numbers = itertools.count(1)
        self.heard_s = self.factory.loop.time()
        self._timer: asyncio.TimerHandle | None = None
        super().connection_made(transport)

    def data_received(self, data: bytes) -> None:
        self.heard_s = self.factory.loop.time()
        self.factory.link._heard(self)
        super().data_received(data)

    def _dataReceived(self, data: bytes) -> None:
        super()._dataReceived(data)
        if self.state == self.STATE_CONNECTING and len(self.data) > MAX_HANDSHAKE_BYTES:
            self.failHandshake("it talks without end")

    def onOpen(self) -> None:
        super().onOpen()
        self._look(self.factory.loop.time())
        self.factory.link._opened(self)
        self.settled.set()

    def onPong(self, payload: bytes) -> None:
        if payload.startswith(MARK):
            self.factory.link._mark_answered(self, bytes(payload))
            return
        if payload.isdigit() and self.pongs < int(payload) <= self.pings:
            self.pongs = int(payload)

    def onClose(self, wasClean: bool, code: int | None, reason: str | None) -> None:
        if self._timer is not None:
            self._timer.cancel()
        super().onClose(wasClean, code, reason)
        self.factory.link._closed(self)
        self.settled.set()
        self.gone.set()

    def onCloseFrame(self, code: int | None, reasonRaw: bytes | None) -> bool | None:
        """The bridge says goodbye: it is answered, and not waited for."""
        self.is_dismissed = code in (None, 1005)
        done: bool | None = super().onCloseFrame(code, reasonRaw)
        if self._timer is not None and self.transport is not None:
            self._timer.cancel()
            self._timer = self.factory.loop.call_later(GOODBYE_S, self._closeConnection, True)
            self.transport.close()
        return done

    def _closeConnection(self, abort: bool = False) -> None:
        if self.transport is None:
            return
        if abort:  # else the system would go on delivering what it holds, long after it was true
            with contextlib.suppress(OSError, TypeError, AttributeError):
                self.transport.get_extra_info("socket").setsockopt(
                    sockets.SOL_SOCKET, sockets.SO_LINGER, struct.pack("ii", 1, 0)
                )
        super()._closeConnection(abort)

    def _look(self, due_s: float) -> None:
        """Is the other side still there, and how late is the link? Pings, and drops what does not answer."""
        loop = self.factory.loop
        now_s = loop.time()
        quiet_s = now_s - self.heard_s
        is_late = now_s - due_s > LATE_S  # what was heard meanwhile may still wait to be read
        if quiet_s >= SILENT_AFTER_S and not is_late:
            self.was_silent = True
            self.dropConnection(abort=True)
            return
        self.factory.link._send_mark(self)
        next_s = max(min(now_s + PING_EVERY_S, self.heard_s + SILENT_AFTER_S + 0.001), now_s + LATE_S)
        self._timer = loop.call_at(next_s, self._look, next_s)

    # A message is gathered here, so that one beyond the limit can be skipped where autobahn would hang up.

    def onMessageFrameBegin(self, length: int) -> None:
        super().onMessageFrameBegin(length)
        if self.message_data_total_length > MAX_SKIPPED_BYTES:
            self._fail_connection(1009, f"a message of {self.message_data_total_length // 2**20} MB")
        elif self._is_too_large:
            self._keep_ends(b"".join(self.message_data))
            self.message_data.clear()

    def onMessageFrameData(self, payload: bytes) -> None:
        if self._is_too_large:
            self._keep_ends(payload)
        else:
            super().onMessageFrameData(payload)

    def _keep_ends(self, payload: bytes) -> None:
        if len(self.message_head) < ENDS_BYTES:
            self.message_head += payload[: ENDS_BYTES - len(self.message_head)]
        self.message_tail = (self.message_tail + payload[-ENDS_BYTES:])[-ENDS_BYTES:]

    def onMessageEnd(self) -> None:
        data, self.message_data = self.message_data, []
        head, tail, self.message_head, self.message_tail = self.message_head, self.message_tail, b"", b""
        self.has_spoken = True
        if self.failedByMe:
            return
        if self._is_too_large:
            size = int(self.message_data_total_length)
            self.factory.link._skipped(self, topic_of(head, tail, is_binary=self.message_is_binary), size)
        else:
            self.factory.link._frame(self, b"".join(data), self.message_is_binary)

    @property
    def _is_too_large(self) -> bool:
        return bool(self.message_data_total_length > MAX_MESSAGE_BYTES)


class _Dialler(AsyncioRosBridgeClientFactory):  # type: ignore[misc]
    """Dials one address for ever, on our loop, until it is stopped: one task, so that there is never a second one."""

    protocol = _BridgeProtocol

    def __init__(self, url: str, *, link: RosLink) -> None:
        self._manager = _OwnLoop()
        super(AsyncioRosBridgeClientFactory, self).__init__(url, loop=self._manager.loop)
        self._proto = None
        self._proto_lock = contextlib.nullcontext()  # one loop, one thread: nothing to lock
        self._stop = False
        self._retry_count = 0
        self._reconnect_delay = FIRST_RETRY_S
        self.link = link
        self._supervisor = Supervisor(f"link to {url}")
        self._hurry = asyncio.Event()
        # No permessage-deflate is offered: it would cost the car's computer more than it saves the network.
        self.setProtocolOptions(
            openHandshakeTimeout=0,  # 0: not by autobahn's timers
            closeHandshakeTimeout=0,
            serverConnectionDropTimeout=0,
            tcpNoDelay=True,
            utf8validateIncoming=False,  # orjson refuses what is not UTF-8
            failByDrop=True,
        )

    def connect(self) -> None:
        if not self._stop and not self._supervisor.keeps("dial"):
            self._supervisor.keep("dial", self._connect_async)

    async def _connect_async(self) -> None:
        delay_s = FIRST_RETRY_S
        while True:
            try:
                connection = await self.link._dial(self)
            except Exception as error:  # whatever it was, the next try must come
                if not isinstance(error, (OSError, ValueError)):
                    log.exception("dialling %s failed in an unforeseen way", self.url)
                self.link._dial_failed(error)
            else:
                opened_s = self._manager.loop.time()
                await connection.gone.wait()
                if self._manager.loop.time() - opened_s >= STEADY_S:
                    delay_s = FIRST_RETRY_S
            self._hurry.clear()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(delay_s):
                    await self._hurry.wait()
            delay_s = FIRST_RETRY_S if self._hurry.is_set() else min(delay_s * RETRY_GROWTH, LAST_RETRY_S)

    def _schedule_reconnect(self) -> None:
        """Not by a timer: `_connect_async` goes round."""

    def retry_now(self) -> None:
        """Dials at once if it is waiting for its next try."""
        self._hurry.set()

    def stop(self) -> None:
        """No further try, nothing left behind."""
        self._stop = True
        self._supervisor.end("dial")


class _Ros(roslibpy.Ros):  # type: ignore[misc]
    """roslibpy's client around our dialler."""

    def __init__(self, url: str, *, link: RosLink) -> None:
        self._id_counter = 0
        self.factory = _Dialler(url, link=link)
        self.is_connecting = False


class RosLink:
    """One vehicle's rosbridge for the life of its session: dialled, watched, resubscribed, never queued for.

    `now` is the session's monotonic clock in seconds. All methods are called on the loop it was made on.
    """

    def __init__(
        self,
        address: Address,
        listener: LinkListener,
        *,
        now: Callable[[], float],
        take_unparsed: Callable[[RawFrame], bool] = lambda _: False,
        marks: Marks | None = None,
    ) -> None:
        """`take_unparsed` gets each publish first, as it came; True: it needs no parsing, and no listener is called.
        `marks` follows how late the link is; None: nobody does."""
        self.address = address
        self.attempts = 0
        self.heard_s: float | None = None  # when the bridge last sent anything, pongs included
        self.frame_bytes = 0  # of the frame that is being told
        self._listener = listener
        self._take_unparsed = take_unparsed
        self._now = now
        self._marks = marks
        self._ros = _Ros(address.url, link=self)
        self._socket: _BridgeProtocol | None = None  # the open one
        self._table: dict[str, Subscription] = {}
        self._calls: dict[str, asyncio.Future[Any]] = {}
        self._ids = itertools.count(1)
        self._stopped = False
        self._outgoing = Outgoing()
        self._fragments = Fragments(MAX_MESSAGE_BYTES)
        self._was_asked = False  # anything, on this connection
        self.junk_count = 0  # frames that were no operations, on this connection
        self.server_software = ""  # what the other side called itself in its newest handshake
        self._faults: set[str] = set()  # told already
        self._lookup: asyncio.Task[Any] | None = None
        self._tls: ssl.SSLContext | None = None

    # -- for the session ---------------------------------------------------------------------------------------------

    @property
    def is_open(self) -> bool:
        return self._socket is not None and self._socket.state == self._socket.STATE_OPEN

    def start(self) -> None:
        self._ros.factory.connect()

    def retry_now(self) -> None:
        self._ros.factory.retry_now()

    def stop(self, *, has_last_word: bool = False) -> None:
        """Ends the link for good, and tells the listener nothing more. What was not yet sent is not sent;
        `has_last_word`: but for what was written just now, which gets a moment to arrive."""
        self._stopped = True
        self._ros.factory.stop()
        if self._lookup is not None:
            self._lookup.cancel()
        self._fail_calls("the link was ended")
        if has_last_word and self._socket is not None:
            self._ros.factory.loop.call_later(LAST_WORD_S, self.abort)
        else:
            self.abort()

    def abort(self) -> None:
        """Drops the connection without a closing handshake, so that nothing buffered is delivered."""
        if self._socket is not None:
            self._socket.dropConnection(abort=True)

    def subscribe(self, wanted: Subscription) -> None:
        """Puts a row into the table; sent now if the link is open, and once at every opening."""
        previous = self._table.get(wanted.topic)
        if previous == wanted:
            return
        try:
            Outgoing().frame(_row("subscribe", wanted))
        except NotAllowed as why:  # a name that only a hostile or broken bridge offers
            self._log_once(f"not subscribed: {why}")
            return
        self._table[wanted.topic] = wanted
        if self.is_open:
            if previous is not None and not previous.is_like(wanted):
                self._send_row("unsubscribe", previous)
            self._send_row("subscribe", wanted)  # under the same id: throttle and queue take the place of the old ones

    def unsubscribe(self, topic: str) -> None:
        row = self._table.pop(topic, None)
        if row is not None and self.is_open:
            self._send_row("unsubscribe", row)

    def renew(self, topic: str) -> None:
        """Subscribes to a topic of the table anew, where nothing comes on it."""
        row = self._table.get(topic)
        if row is not None and self.is_open:
            self._send_row("unsubscribe", row)
            self._send_row("subscribe", row)

    def unsubscribe_all(self) -> None:
        for topic in list(self._table):
            self.unsubscribe(topic)

    @property
    def subscriptions(self) -> tuple[Subscription, ...]:
        return tuple(self._table.values())

    def send_now(self, operation: dict[str, Any]) -> None:
        """Writes one rosbridge operation to the open connection. Raises LinkDown when there is none, NotAllowed where
        it could do harm."""
        if self._socket is None or not self.is_open:
            raise LinkDown("not sent: no connection to the car")
        try:
            frame = self._outgoing.frame(operation)
        except NotAllowed as why:
            self._log_once(f"not sent: {why}")
            raise
        self._was_asked = True
        self._socket.sendMessage(frame, isBinary=False)

    def ping(self) -> None:
        """Asks the bridge for a sign of life, behind all that was sent before. Raises LinkDown."""
        if self._socket is None or not self.is_open:
            raise LinkDown("not sent: no connection to the car")
        self._socket.pings += 1
        self._socket.sendPing(b"%d" % self._socket.pings)

    @property
    def unanswered(self) -> int:
        """How many of these pings the bridge has not answered: so much of what was sent it may not have read."""
        return 0 if self._socket is None else self._socket.pings - self._socket.pongs

    async def call(self, service: str, arguments: dict[str, Any] | None = None, *, timeout_s: float = 2.0) -> Any:
        """The values a service answers. Raises LinkDown, also where the link breaks before the answer, or CallFailed
        with the bridge's words."""
        if len(self._calls) >= MAX_PENDING_CALLS:
            raise CallFailed("too many calls are unanswered")
        identity = f"call:{service}:{next(self._ids)}"
        answer: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        try:
            self.send_now({"op": "call_service", "id": identity, "service": service, "args": arguments or {}})
        except NotAllowed as why:
            raise CallFailed(f"not sent: {why}") from None
        self._calls[identity] = answer
        try:
            async with asyncio.timeout(timeout_s):
                return await answer
        except TimeoutError:
            raise CallFailed(f"{service} did not answer within {timeout_s:g} s") from None
        finally:
            self._calls.pop(identity, None)

    # -- dialling ----------------------------------------------------------------------------------------------------

    async def _dial(self, factory: _Dialler) -> _BridgeProtocol:
        """Resolves, refuses what is never dialled, and dials exactly the addresses that were looked at, in turn, until
        one of them shakes hands. Raises what tells most of why none did."""
        self.attempts += 1
        found = await self._addresses()
        failures: list[Exception] = []
        for ip in found:
            try:
                refuse_forbidden(ip)
                return await self._dial_one(factory, ip, max(DIAL_TIMEOUT_S / len(found), 1.0))
            except (OSError, ValueError) as error:
                failures.append(error)
        raise min(failures, key=_says_little, default=OSError("the host has no address"))

    async def _addresses(self) -> list[str]:
        host = self.address.host
        with contextlib.suppress(ValueError):
            return [str(ipaddress.ip_address(host))]
        if self._lookup is None:  # one that takes longer is waited for again at the next try, not started again
            self._lookup = asyncio.ensure_future(_look_up(host, self.address.port))
            self._lookup.add_done_callback(lambda task: task.cancelled() or task.exception())
        try:
            async with asyncio.timeout(LOOKUP_TIMEOUT_S):
                found = await asyncio.shield(self._lookup)
        except TimeoutError:
            raise sockets.gaierror(sockets.EAI_AGAIN, "no name server answers") from None
        finally:
            if self._lookup.done():
                self._lookup = None
        return list(dict.fromkeys(str(sockaddr[0]) for *_, sockaddr in found))[:MAX_ADDRESSES]

    async def _dial_one(self, factory: _Dialler, ip: str, within_s: float) -> _BridgeProtocol:
        loop = asyncio.get_running_loop()
        secure: dict[str, Any] = {}
        if self.address.secure:
            self._tls = self._tls or ssl.create_default_context()
            secure = {"ssl": self._tls, "server_hostname": self.address.host}
        async with asyncio.timeout(within_s):
            _, connection = await loop.create_connection(factory, ip, self.address.port, **secure)
        assert isinstance(connection, _BridgeProtocol)
        reason = "timeout"
        try:
            async with asyncio.timeout(HANDSHAKE_TIMEOUT_S):
                await connection.settled.wait()
            reason = str(connection.wasNotCleanReason)
        except TimeoutError:
            pass
        finally:
            if connection is not self._socket:
                connection.dropConnection(abort=True)
        if not connection.was_accepted:
            raise NoWebSocket(reason, bytes(connection.data[:2000]))
        return connection

    def _dial_failed(self, error: Exception) -> None:
        if isinstance(error, NoWebSocket):
            problem = problems.of_handshake(self.address, str(error), error.answer)
        else:
            problem = problems.of_dial_error(error, self.address)
        self._tell(self._listener.dial_failed, problem)

    # -- from the protocol -------------------------------------------------------------------------------------------

    def _heard(self, socket: _BridgeProtocol) -> None:
        if socket is self._socket:
            self.heard_s = self._now()

    def _opened(self, socket: _BridgeProtocol) -> None:
        if self._stopped or self._socket is not None:
            socket.dropConnection(abort=True)
            return
        self._socket = socket
        self._fragments = Fragments(MAX_MESSAGE_BYTES)
        self._outgoing.reset()
        self._was_asked, self.junk_count = False, 0
        self.server_software = str((getattr(socket, "http_headers", None) or {}).get("server", ""))[:60]
        socket.was_accepted = True
        self.heard_s = self._now()
        if self._marks is not None:
            self._marks.open(self._now())
        for row in self._table.values():
            self._send_row("subscribe", row)
        self._tell(self._listener.link_opened)

    def _send_mark(self, socket: _BridgeProtocol) -> None:
        payload = MARK + b"%d" % next(socket.mark_numbers)
        sent_s = self._now()
        socket.sendPing(payload)
        if self._marks is not None and socket is self._socket:
            socket.marks_sent.append((payload, sent_s))
            self._marks.sent(sent_s)

    def _mark_answered(self, socket: _BridgeProtocol, payload: bytes) -> None:
        """An answer also answers the pings before it."""
        if self._marks is None or socket is not self._socket or all(sent != payload for sent, _ in socket.marks_sent):
            return
        while socket.marks_sent:
            sent, sent_s = socket.marks_sent.popleft()
            if sent == payload:
                self._marks.answered(sent_s, self._now())
                return

    def _closed(self, socket: _BridgeProtocol) -> None:
        if socket is not self._socket:
            return  # it never opened: whoever dialled it says so
        self._socket = None
        self._fail_calls("the connection to the bridge was lost")
        if socket.was_silent:
            problem = problems.bridge_silent(self.address)
        elif socket.failedByMe:
            problem = problems.closed_by_bridge(self.address, str(socket.wasNotCleanReason))
        elif socket.is_dismissed and not socket.has_spoken and self._was_asked:
            problem = problems.login_wanted(self.address)
        else:
            problem = problems.closed_by_bridge(self.address, _words(socket.remoteCloseReason, 200))
        self._tell(self._listener.link_closed, problem)

    def _junk(self, socket: _BridgeProtocol, why: str) -> None:
        if socket is self._socket:
            self.junk_count += 1
            self._tell(self._listener.junk_received, why)

    def _skipped(self, socket: _BridgeProtocol, topic: str | None, size: int) -> None:
        if socket is self._socket:
            self._junk(socket, f"a message of more than {MAX_MESSAGE_BYTES // 2**20} MB")
            self._tell(self._listener.large_skipped, topic, size)

    def _frame(self, socket: _BridgeProtocol, payload: bytes, is_binary: bool) -> None:
        if socket is not self._socket:
            return  # stopped, or dropped: what is still in the pipe is no news
        self.frame_bytes = len(payload)
        if is_fragment(payload, is_binary):
            self._fragment(socket, payload)
            return
        raw = raw_frame(payload, is_binary)
        if raw is not None and self._takes_unparsed(raw):
            return
        try:
            operation, note = frames.decode(payload, is_binary)
        except frames.Unreadable as error:
            self._junk(socket, str(error))
            return
        match operation.get("op"):
            case "publish":
                topic = operation.get("topic")
                if not isinstance(topic, str) or "msg" not in operation:
                    self._junk(socket, "a publish without topic or msg")
                elif not self._tell(self._listener.message_received, topic, operation["msg"], note):
                    self._junk(socket, "a message on which catgraph itself stumbled")
            case "service_response":
                self._answered(operation)
            case "status":
                level, text = _words(operation.get("level"), 20), _words(operation.get("msg"), 500)
                self._tell(self._listener.status_received, level, text)
            case "fragment":
                self._junk(socket, "a fragment that cannot be put together")
            case _:
                self._junk(socket, "an operation that rosbridge does not have")

    def _fragment(self, socket: _BridgeProtocol, payload: bytes) -> None:
        try:
            whole = self._fragments.add(payload)
        except frames.Unreadable as error:
            self._junk(socket, str(error))
            return
        if isinstance(whole, TooLarge):
            self._skipped(socket, whole.topic, whole.size)
        elif whole is not None:
            if is_fragment(whole, False):
                self._junk(socket, "fragments that hold a fragment")
            else:
                self._frame(socket, whole, False)

    def _takes_unparsed(self, raw: RawFrame) -> bool:
        """Whether nothing more is to be done with a frame; it is parsed where this fails."""
        taken = False

        def take(frame: RawFrame) -> None:
            nonlocal taken
            taken = self._take_unparsed(frame)

        return self._tell(take, raw) and taken and not self._stopped

    def _answered(self, operation: dict[str, Any]) -> None:
        identity = operation.get("id")
        answer = self._calls.get(identity) if isinstance(identity, str) else None
        if answer is None or answer.done():
            return  # late: the caller has given up
        if operation.get("result") is False:
            answer.set_exception(Refusal(_words(operation.get("values"), 300)))
        else:
            answer.set_result(operation.get("values"))

    def _tell(self, listener: Callable[..., None], *what: Any) -> bool:
        """Tells the listener, unless stopped; False where it stumbled.

        A fault of its own costs this one message and not the link: the next message of the kind would find the same
        fault, and the operator would be blind to all the others.
        """
        if self._stopped:
            return True
        try:
            listener(*what)
        except Exception as error:
            fault = f"{listener.__name__}: {type(error).__name__}"
            if fault not in self._faults:
                self._faults.add(fault)
                log.exception("%s, told once, on what came from %s", fault, self.address.shown)
            return False
        return True

    def _fail_calls(self, why: str) -> None:
        for answer in list(self._calls.values()):
            if not answer.done():
                answer.set_exception(LinkDown(why))

    def _send_row(self, operation: str, row: Subscription) -> None:
        if operation == "subscribe" and self._marks is not None:
            self._marks.subscribe(row.topic, row.queue_length, row.throttle_ms / 1000)
        self.send_now(_row(operation, row))

    def _log_once(self, text: str) -> None:
        if text not in self._faults and len(self._faults) < MAX_FAULTS:
            self._faults.add(text)
            log.error("%s (%s)", text, self.address.shown)


def _row(operation: str, row: Subscription) -> dict[str, Any]:
    # The same id at both ends: unsubscribing names the subscription.
    message: dict[str, Any] = {"op": operation, "id": f"subscribe:{row.topic}", "topic": row.topic}
    if operation == "subscribe":
        if row.type is not None:
            message["type"] = row.type
        message |= {
            "compression": row.compression,
            # ROS 2's rosbridge sends what is left in a queue without a throttle for ever once its client has gone,
            # and takes no connection any more.
            "throttle_rate": max(row.throttle_ms, 1 if row.queue_length else 0),
            "queue_length": row.queue_length,
        }
    return message


async def _look_up(host: str, port: int) -> Any:
    return await asyncio.get_running_loop().getaddrinfo(host, port, type=sockets.SOCK_STREAM)


def _says_little(error: Exception) -> int:
    """Of several failures the most telling is told: the farther a dial came, the more it tells."""
    kinds = (NoWebSocket, ssl.SSLError, ConnectionRefusedError, ConnectionError, TimeoutError, OSError, BadAddress)
    return next((rank for rank, kind in enumerate(kinds) if isinstance(error, kind)), len(kinds))


def _words(value: Any, limit: int) -> str:
    return clean(value[:limit]) if isinstance(value, str) else "" if value is None else f"({type(value).__name__})"
