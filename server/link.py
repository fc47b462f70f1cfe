"""The connection to one rosbridge: roslibpy on our own event loop, watched, and without its queues.

The only file that imports roslibpy, or knows its inside. Written against roslibpy 2.1.0; each thing assumed of it
is named
in `ASSUMPTIONS` and held by a test of its own. What is replaced, and why:

- its transport runs a loop in a thread: `_OwnLoop` adopts the running one;
- its client queues what is sent while down and delivers it on reconnecting: `send_now` refuses instead;
- its topics register anew with every failed attempt: the table of subscriptions here is sent once an opening;
- its back-off grows to an hour, its dialling has no time-out and cannot be abandoned: `_Dialler` does both;
- a half-open link goes unseen: pings, and a watch on the time since the bridge was last heard.
"""

from __future__ import annotations

import asyncio
import itertools
import logging
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

os.environ.setdefault("ROSLIBPY_TRANSPORT", "asyncio")  # before anything lets txaio choose Twisted for the process

import roslibpy
from roslibpy.comm.comm_asyncio import AsyncioRosBridgeClientFactory, AsyncioRosBridgeProtocol

from server import frames, problems
from server.address import Address, refuse_forbidden
from server.problems import Problem

log = logging.getLogger("catgraph.link")

ASSUMPTIONS = {
    "roslibpy": "2.1.0",
    "factory": "AsyncioRosBridgeClientFactory dials in _connect_async; _schedule_reconnect and _open_connection repeat it",
    "manager": "the factory takes its loop from `manager.loop` and asks a manager only for run()",
    "protocol": "onOpen calls factory.ready(self), onClose factory.connection_lost(self), frames arrive in onMessage",
    "ros": "Ros.__init__ sets _id_counter, factory and is_connecting and then calls connect()",
}

PING_EVERY_S = 0.5
PING_ANSWER_WITHIN_S = 1.1  # with the interval and autobahn's 0.2 s timer buckets: a dead link is dropped in ≤ 2.0 s
DIAL_TIMEOUT_S = 4.0
HANDSHAKE_TIMEOUT_S = 3.0
FIRST_RETRY_S = 0.2
LAST_RETRY_S = 2.0
RETRY_GROWTH = 1.7
MAX_MESSAGE_BYTES = 16 * 1024 * 1024  # a 100 000-beam cloud fits; a 40 MB message would stop the loop for a second
MAX_PENDING_CALLS = 64


class LinkDown(ConnectionError):
    """Nothing was sent: there is no connection to the car. Nothing is kept to be sent later."""


class CallFailed(RuntimeError):
    """The bridge answered a service call with a failure, or not in time."""


class LinkListener(Protocol):
    """Who is told what happens on the link; every method returns at once."""

    def link_opened(self) -> None: ...
    def link_closed(self, problem: Problem) -> None: ...
    def dial_failed(self, problem: Problem) -> None: ...
    def message_received(self, topic: str, message: Any, note: str | None) -> None: ...
    def status_received(self, level: str, text: str) -> None: ...
    def junk_received(self, why: str) -> None: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Subscription:
    """One row of the subscription table; `type` None leaves it to the bridge to know."""

    topic: str
    type: str | None
    compression: str = "none"  # or "cbor"
    throttle_ms: int = 0
    queue_length: int = 0


@dataclass(slots=True)
class _Call:
    future: asyncio.Future[Any]
    timer: asyncio.TimerHandle | None = field(default=None)


class _OwnLoop:
    """What roslibpy calls an event loop manager, around the loop that already runs."""

    def __init__(self) -> None:
        self.loop = asyncio.get_running_loop()

    def run(self) -> None:
        """The loop runs already."""


class _BridgeProtocol(AsyncioRosBridgeProtocol):  # type: ignore[misc]
    """One WebSocket to the bridge; hands whole frames to the link that owns it."""

    def onOpen(self) -> None:
        self._manual_disconnect = False
        self.factory.ready(self)
        self.factory.link._opened(self)

    def onMessage(self, payload: bytes, isBinary: bool) -> None:
        self.factory.link._frame(payload, isBinary)

    def _dataReceived(self, data: bytes) -> None:
        self.factory.link._heard()
        super()._dataReceived(data)

    def onClose(self, wasClean: bool, code: int | None, reason: str | None) -> None:
        self.factory.link._closed(self, code, reason or "")
        super().onClose(wasClean, code, reason)


class _Dialler(AsyncioRosBridgeClientFactory):  # type: ignore[misc]
    """Dials one address for ever, on our loop, with a time-out, until it is stopped."""

    protocol = _BridgeProtocol
    initialDelay = FIRST_RETRY_S
    maxDelay = LAST_RETRY_S
    factor = RETRY_GROWTH

    def __init__(self, url: str, *, link: RosLink) -> None:
        self._manager = _OwnLoop()
        super(AsyncioRosBridgeClientFactory, self).__init__(url, loop=self._manager.loop)
        self._proto = None
        self._proto_lock = _NoLock()  # one loop, one thread: nothing to lock
        self._stop = False
        self._retry_count = 0
        self._reconnect_delay = self.initialDelay
        self.link = link
        self._dialling: asyncio.Task[None] | None = None
        self._waiting: asyncio.TimerHandle | None = None
        # no permessage-deflate is offered: it would cost the car's computer more than the network
        self.setProtocolOptions(
            autoPingInterval=PING_EVERY_S,
            autoPingTimeout=PING_ANSWER_WITHIN_S,
            maxMessagePayloadSize=MAX_MESSAGE_BYTES,
            maxFramePayloadSize=MAX_MESSAGE_BYTES,
            openHandshakeTimeout=HANDSHAKE_TIMEOUT_S,
            closeHandshakeTimeout=1,
            tcpNoDelay=True,
            utf8validateIncoming=False,  # orjson refuses what is not UTF-8
            failByDrop=True,
        )

    def connect(self) -> None:
        self._stop = False
        self._open_connection()

    def _open_connection(self) -> None:
        self._waiting = None
        if not self._stop and (self._dialling is None or self._dialling.done()):
            self._dialling = self._manager.loop.create_task(self._connect_async(), name=f"dial {self.url}")

    async def _connect_async(self) -> None:
        try:
            async with asyncio.timeout(DIAL_TIMEOUT_S):
                await self.link._dial(self)
        except (OSError, TimeoutError, ValueError) as error:
            self.link._dial_failed(error)
            self._schedule_reconnect()

    def _schedule_reconnect(self) -> None:
        if self._stop:
            return
        delay = self._reconnect_delay
        self._reconnect_delay = min(delay * self.factor, self.maxDelay)
        self._waiting = self._manager.loop.call_later(delay, self._open_connection)

    def retry_now(self) -> None:
        """Dials at once if it is waiting for its next try."""
        self._reconnect_delay = self.initialDelay
        if self._waiting is not None:
            self._waiting.cancel()
            self._open_connection()

    def stop(self) -> None:
        """No further try, nothing left behind."""
        self._stop = True
        if self._waiting is not None:
            self._waiting.cancel()
            self._waiting = None
        if self._dialling is not None:
            self._dialling.cancel()
            self._dialling = None


class _NoLock:
    def __enter__(self) -> None:
        pass

    def __exit__(self, *_: object) -> None:
        pass


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

    def __init__(self, address: Address, listener: LinkListener, *, now: Callable[[], float]) -> None:
        self.address = address
        self.attempts = 0
        self.heard_s: float | None = None  # when the bridge last sent anything, pongs included
        self._listener = listener
        self._now = now
        self._ros = _Ros(address.url, link=self)
        self._socket: _BridgeProtocol | None = None
        self._table: dict[str, Subscription] = {}
        self._calls: dict[str, _Call] = {}
        self._ids = itertools.count(1)
        self._stopped = False

    # -- for the session ---------------------------------------------------------------------------------------------

    @property
    def is_open(self) -> bool:
        return self._socket is not None

    def start(self) -> None:
        self._ros.factory.connect()

    def retry_now(self) -> None:
        self._ros.factory.retry_now()

    def stop(self) -> None:
        """Ends the link for good. What was not yet sent is not sent."""
        self._stopped = True
        self._ros.factory.stop()
        self._fail_calls("the link was ended")
        if self._socket is not None:
            self._socket._manual_disconnect = True
            self.abort()

    def abort(self) -> None:
        """Drops the connection without a closing handshake, so that nothing buffered is delivered."""
        if self._socket is not None and self._socket.transport is not None:
            self._socket.transport.abort()

    def subscribe(self, wanted: Subscription) -> None:
        """Puts a row into the table; sent now if the link is open, and once at every opening."""
        previous = self._table.get(wanted.topic)
        if previous == wanted:
            return
        if previous is not None and self.is_open:
            self._send_row("unsubscribe", previous)
        self._table[wanted.topic] = wanted
        if self.is_open:
            self._send_row("subscribe", wanted)

    def unsubscribe(self, topic: str) -> None:
        row = self._table.pop(topic, None)
        if row is not None and self.is_open:
            self._send_row("unsubscribe", row)

    def unsubscribe_all(self) -> None:
        for topic in list(self._table):
            self.unsubscribe(topic)

    @property
    def subscriptions(self) -> tuple[Subscription, ...]:
        return tuple(self._table.values())

    def send_now(self, operation: dict[str, Any]) -> None:
        """Writes one rosbridge operation to the open connection. Raises LinkDown when there is none."""
        if self._socket is None:
            raise LinkDown("not sent: no connection to the car")
        self._socket.sendMessage(frames.encode(operation), isBinary=False)

    async def call(self, service: str, arguments: dict[str, Any] | None = None, *, timeout_s: float = 2.0) -> Any:
        """The values a service answers. Raises LinkDown, or CallFailed with the bridge's words."""
        if len(self._calls) >= MAX_PENDING_CALLS:
            raise CallFailed("too many calls are unanswered")
        identity = f"call:{service}:{next(self._ids)}"
        loop = asyncio.get_running_loop()
        call = _Call(loop.create_future())
        self.send_now({"op": "call_service", "id": identity, "service": service, "args": arguments or {}})
        self._calls[identity] = call
        try:
            async with asyncio.timeout(timeout_s):
                return await call.future
        except TimeoutError:
            raise CallFailed(f"{service} did not answer within {timeout_s:g} s") from None
        finally:
            self._calls.pop(identity, None)

    # -- from the protocol -------------------------------------------------------------------------------------------

    async def _dial(self, factory: _Dialler) -> None:
        """Resolves, refuses what is never dialled, and dials exactly the addresses that were looked at."""
        self.attempts += 1
        loop = asyncio.get_running_loop()
        found = await loop.getaddrinfo(self.address.host, self.address.port, type=1)
        last: Exception = OSError("no address")
        for _, _, _, _, sockaddr in dict.fromkeys(found):
            try:
                refuse_forbidden(str(sockaddr[0]))
                tls: dict[str, Any] = {}
                if self.address.secure:
                    import ssl

                    tls = {"ssl": ssl.create_default_context(), "server_hostname": self.address.host}
                await loop.create_connection(factory, str(sockaddr[0]), self.address.port, **tls)
                return
            except (OSError, ValueError) as error:
                last = error
        raise last

    def _dial_failed(self, error: BaseException) -> None:
        if not self._stopped:
            self._listener.dial_failed(problems.of_dial_error(error, self.address))

    def _heard(self) -> None:
        self.heard_s = self._now()

    def _opened(self, socket: _BridgeProtocol) -> None:
        if self._stopped:
            socket.transport.abort()
            return
        self._socket = socket
        for row in self._table.values():
            self._send_row("subscribe", row)
        self._listener.link_opened()

    def _closed(self, socket: _BridgeProtocol, code: int | None, reason: str) -> None:
        was_open = self._socket is socket
        if was_open:
            self._socket = None
        self._fail_calls("the connection to the bridge was lost")
        if self._stopped:
            return
        if not was_open:
            self._listener.dial_failed(self._handshake_problem(reason))
        elif "ping timeout" in reason:
            self._listener.link_closed(problems.bridge_silent(self.address))
        else:
            self._listener.link_closed(problems.closed_by_bridge(self.address, reason))

    def _handshake_problem(self, reason: str) -> Problem:
        if "upgrade failed" in reason or "invalid" in reason.lower() or "HTTP" in reason:
            return problems.not_rosbridge(self.address, "It answers, but not as a WebSocket.")
        if "timeout" in reason:
            return problems.not_rosbridge(self.address, "It accepts the connection and then says nothing.")
        return problems.not_rosbridge(self.address, "It closes the connection at once; a secure one wants wss://.")

    def _frame(self, payload: bytes, is_binary: bool) -> None:
        try:
            operation, note = frames.decode(payload, is_binary)
        except frames.Unreadable as error:
            self._listener.junk_received(str(error))
            return
        match operation.get("op"):
            case "publish":
                topic = operation.get("topic")
                if isinstance(topic, str) and "msg" in operation:
                    self._listener.message_received(topic, operation["msg"], note)
                else:
                    self._listener.junk_received("a publish without topic or msg")
            case "service_response":
                self._answered(operation)
            case "status":
                self._listener.status_received(str(operation.get("level"))[:20], str(operation.get("msg"))[:500])
            case "fragment":
                self._listener.junk_received("a fragment, which was not asked for")
            case _:
                self._listener.junk_received("an operation that rosbridge does not have")

    def _answered(self, operation: dict[str, Any]) -> None:
        call = self._calls.get(str(operation.get("id")))
        if call is None or call.future.done():
            return  # late: the caller has given up
        if operation.get("result") is False:
            call.future.set_exception(CallFailed(str(operation.get("values"))[:300]))
        else:
            call.future.set_result(operation.get("values"))

    def _fail_calls(self, why: str) -> None:
        for call in list(self._calls.values()):
            if not call.future.done():
                call.future.set_exception(CallFailed(why))

    def _send_row(self, operation: str, row: Subscription) -> None:
        message: dict[str, Any] = {"op": operation, "id": f"{operation}:{row.topic}", "topic": row.topic}
        message["id"] = f"subscribe:{row.topic}"  # the same at both ends: unsubscribing names the subscription
        if operation == "subscribe":
            if row.type is not None:
                message["type"] = row.type
            message |= {
                "compression": row.compression,
                "throttle_rate": row.throttle_ms,
                "queue_length": row.queue_length,
            }
        self.send_now(message)
