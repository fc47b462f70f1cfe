"""The connection to one Foxglove server: dialled and watched as that to a rosbridge is, by the same socket."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from server.recording.read.errors import Undecodable
from server.rosbridge import connection_errors
from server.rosbridge.address import Address
from server.rosbridge.connection_errors import Problem
from server.rosbridge.dialer import Dialer
from server.rosbridge.link_listener import NOTE, LinkListener, Marks, SafeCalls
from server.rosbridge.live_source import LinkDown, NoWebSocket
from server.rosbridge.raw_frame import RawFrame
from server.rosbridge.subscription import Subscription
from server.rosbridge.websocket import MAX_MESSAGE_BYTES, BridgeProtocol
from server.system.clean_text import short_text
from server.vehicle.foxglove import protocol
from server.vehicle.foxglove.delay import Delay
from server.vehicle.foxglove.readers import ReaderTable
from server.vehicle.foxglove.server_state import MAX_OFFERED, Answers, ServerState, Subscribed

FLUSH_S = 0.2


class FoxgloveSource:
    """A `LiveSource`: one vehicle's Foxglove server for the life of its session.

    Each message is given to the listener as it comes, decoded; nothing is queued here. The server has no throttle, so
    that of a subscription is not used: all that comes is given.
    """

    keeps_types = False  # of a topic with several types, that of its newest channel is received

    def __init__(
        self,
        address: Address,
        listener: LinkListener,
        *,
        now: Callable[[], float],
        take_unparsed: Callable[[RawFrame], bool] = lambda _: False,
        marks: Marks | None = None,
    ) -> None:
        """`take_unparsed` is not called: every message is read at once, by a compiled decoder."""
        self.address = address
        self.attempts = 0
        self.heard_s: float | None = None
        self.frame_bytes = self.junk_count = 0
        self.server_software = ""
        self._listener = listener
        self._now = now
        self._delay = Delay(marks, now)
        self._dialer = Dialer(address, self, protocols=protocol.SUBPROTOCOLS)
        self._socket: BridgeProtocol | None = None
        self._is_refused = False  # the newest socket speaks another protocol
        self._stopped = False
        self._calls = SafeCalls(address.shown)
        self._notify = self._calls.notify
        self._rows = Subscribed(self._send, self._delay.subscribed)
        self._readers = ReaderTable(self._sync, self._note_once, used=self._rows.channels.values)
        self._state = ServerState()

    def _forget(self) -> None:
        """Another connection: nothing is known of it."""
        self._state.end()
        self._state = ServerState()
        self._rows.closed()

    # -- for the session ---------------------------------------------------------------------------------------------

    @property
    def is_open(self) -> bool:
        return self._socket is not None and self._socket.state == self._socket.STATE_OPEN

    @property
    def subscriptions(self) -> tuple[Subscription, ...]:
        return tuple(self._rows.table.values())

    @property
    def unanswered(self) -> int:
        return 0 if self._socket is None else self._socket.pings - self._socket.pongs

    @property
    def command_problem(self) -> str | None:
        """Why no command can be sent; None: it can, or it is not known yet."""
        return self._state.command_problem

    def start(self) -> None:
        self._dialer.connect()

    def retry_now(self) -> None:
        self._dialer.retry_now()

    def stop(self, *, is_flushed: bool = False) -> None:
        self._stopped = self._calls.is_stopped = True
        self._dialer.stop()
        self._readers.end()
        self._state.end()
        if is_flushed and self._socket is not None:
            self._dialer.loop.call_later(FLUSH_S, self.abort)
        else:
            self.abort()

    def abort(self) -> None:
        if self._socket is not None:
            self._socket.dropConnection(abort=True)

    def subscribe(self, wanted: Subscription) -> None:
        self._rows.table[wanted.topic] = wanted
        self._sync(wanted.topic)

    def unsubscribe(self, topic: str) -> None:
        self._rows.table.pop(topic, None)
        self._end(topic)

    def renew(self, topic: str) -> None:
        self._end(topic)
        self._sync(topic)

    def again(self, topic: str) -> bool:
        """A server refuses a second subscription beside the first, and between two a message could be lost."""
        return False

    def send_now(self, operation: dict[str, Any]) -> None:
        if self._socket is None or not self.is_open:
            raise LinkDown("not sent: no connection to the car")
        frame, is_binary = self._state.command(operation)
        self._socket.sendMessage(frame, isBinary=is_binary)

    def ping(self) -> None:
        if self._socket is None or not self.is_open:
            raise LinkDown("not sent: no connection to the car")
        self._socket.pings += 1
        self._socket.sendPing(b"%d" % self._socket.pings)

    async def call(self, service: str, arguments: dict[str, Any] | None = None, *, timeout_s: float = 2.0) -> Any:
        """Answered here, from what the server has listed. Raises CallFailed, LinkDown."""
        if not self.is_open:
            raise LinkDown("not called: no connection to the car")
        return await self._state.answer(service, arguments or {}, timeout_s)

    def beside(self, listener: LinkListener) -> Answers:
        """The answers cost the server nothing: they need no connection of their own."""
        return Answers(self)

    # -- from the dialer and the socket ------------------------------------------------------------------------------

    def is_current(self, socket: BridgeProtocol) -> bool:
        return socket is self._socket

    def dial_failed(self, error: Exception) -> None:
        problem = _problem_of_dialling(error, self.address, is_refused=self._is_refused)
        self._is_refused = False
        self._notify(self._listener.dial_failed, problem)

    def received(self, socket: BridgeProtocol, size: int) -> None:
        if socket is self._socket:
            self.heard_s = self._now()
            self._delay.took(size)

    def opened(self, socket: BridgeProtocol) -> None:
        self._is_refused = socket.websocket_protocol_in_use not in protocol.SUBPROTOCOLS
        if self._stopped or self._socket is not None or self._is_refused:
            socket.dropConnection(abort=True)
            return
        self._socket = socket
        self._forget()
        self.junk_count = 0
        socket.was_accepted = True
        self.heard_s = self._now()
        self._delay.opened()
        self._notify(self._listener.link_opened)

    def closed(self, socket: BridgeProtocol) -> None:
        if socket is not self._socket:
            return
        self._socket = None
        self._forget()
        self._notify(self._listener.link_closed, _problem_of_end(socket, self.address))

    def send_mark(self, socket: BridgeProtocol) -> None:
        sent_s = self._now()
        is_followed = self._delay.is_followed and socket is self._socket
        socket.send_mark(sent_s, is_followed=is_followed)
        if is_followed:
            self._delay.ping_sent(sent_s)

    def mark_answered(self, socket: BridgeProtocol, payload: bytes) -> None:
        sent_s = socket.take_mark(payload) if socket is self._socket else None
        if sent_s is not None:
            self._delay.pong(sent_s, is_in_message=socket.is_in_message)

    def skipped(self, socket: BridgeProtocol, head: bytes, tail: bytes, size: int) -> None:
        if socket is self._socket:
            self._delay.skipped()
            subscription = protocol.subscription_of(head)
            channel = None if subscription is None else self._rows.channels.get(subscription)
            self._junk(f"a message of more than {MAX_MESSAGE_BYTES // 2**20} MB")
            self._notify(self._listener.large_skipped, None if channel is None else channel.topic, size)

    def frame(self, socket: BridgeProtocol, payload: bytes, is_binary: bool) -> None:
        if socket is not self._socket:
            return
        self.frame_bytes = len(payload)
        try:
            received = protocol.read(payload, is_binary)
        except protocol.BadFrame as why:
            self._junk(str(why))
            return
        match received:
            case protocol.MessageData():
                self._message(received)
            case protocol.ServerInfo():
                self.server_software = received.name
                if self._state.introduced(received):
                    self._send(protocol.subscribe_graph())
            case protocol.Advertise():
                self._advertised(received)
            case protocol.Unadvertise(ids):
                for channel in self._state.offered.unadvertised(ids):
                    self._delay.ended(self._rows.gone(channel))
                    self._sync(channel.topic)
            case protocol.GraphUpdate():
                self._state.offered.graph(received)
            case protocol.Status(level, text):
                self._notify(self._listener.status_received, level, text)

    # -- what the server sends ---------------------------------------------------------------------------------------

    def _advertised(self, received: protocol.Advertise) -> None:
        if received.invalid:
            self._junk("a channel that cannot be read")
        for channel in self._state.offered.advertised(received.channels):
            self._delay.ended(self._rows.gone(channel))  # where another one had this number
            self._sync(channel.topic)
        if received.too_many or self._state.offered.is_full:
            self._note_once(f"The Foxglove server has more than {MAX_OFFERED} channels: the others are not received.")
        self._state.advertised()

    def _sync(self, topic: str) -> None:
        """Subscribes to the channels of a topic that is wanted, as soon as their messages can be read."""
        if self.is_open and topic in self._rows.table:
            ready = [one for one in self._state.offered.of(topic) if self._readers.is_ready(one)]
            self._delay.ended(self._rows.begin(topic, ready))

    def _end(self, topic: str) -> None:
        self._delay.ended(self._rows.end(topic))

    def _message(self, data: protocol.MessageData) -> None:
        self._delay.message(data.subscription, data.sent_ns)
        channel = self._rows.channels.get(data.subscription)
        if channel is None:
            return  # of a subscription that was ended
        try:
            message = self._readers.read(channel, data.payload)
        except Undecodable as why:
            self._junk(f"{channel.topic}: {why}")
            self._note_once(f"{channel.topic} cannot be read: {why}.")
            return
        if not self._notify(self._listener.message_received, channel.topic, message, None):
            self._junk("a message that caused an internal error")

    # -- helpers -----------------------------------------------------------------------------------------------------

    def _send(self, frame: bytes) -> None:
        if self._socket is not None and self.is_open:
            self._socket.sendMessage(frame, isBinary=False)

    def _junk(self, why: str) -> None:
        self.junk_count += 1
        self._notify(self._listener.junk_received, why)

    def _note_once(self, text: str) -> None:
        if self._calls.is_new(text):
            self._notify(self._listener.status_received, NOTE, text)


def _problem_of_dialling(error: Exception, address: Address, *, is_refused: bool) -> Problem:
    """`is_refused`: it is a WebSocket of another protocol."""
    if is_refused:
        return connection_errors.not_proved(address, "", 0)
    if isinstance(error, NoWebSocket):
        return connection_errors.of_handshake(address, str(error), error.answer)
    return connection_errors.of_dial_error(error, address)


def _problem_of_end(socket: BridgeProtocol, address: Address) -> Problem:
    if socket.was_silent:
        return connection_errors.bridge_silent(address)
    why = socket.wasNotCleanReason if socket.failedByMe else short_text(socket.remoteCloseReason, 200)
    return connection_errors.closed_by_bridge(address, str(why))
