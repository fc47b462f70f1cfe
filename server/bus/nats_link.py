"""The connection of one program to a NATS broker: who it is, and that it is there again after any loss."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import secrets
import ssl
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import nkeys
from nats.aio.client import Client
from nats.errors import NoServersError

from server.bus import nats_wire as wire
from server.bus.broker import Broker, BrokerRefused
from server.bus.nats_spares import Spares
from server.system.supervision import Supervisor

log = logging.getLogger("catgraph.bus")

SPARES = 4  # of an agent, which a radio may be before: one is taken, two have copies of states, one is pinged or unused
RETRY_S = 1.0
MOST_AT_ONCE = 4  # connections in a row that are taken without a pause, though none worked for long
WORKS_S = 2.0
AGAIN_S = 0.3  # between the two tries of a dial: a broker may just have started
TRIES = 1  # of a dial, beside the first
CONNECTS_WITHIN_S = 3
PING_EVERY_S = 2.0
PING_ANSWERED_WITHIN_S = 4  # else the broker is gone
SILENT_S = 1 << 30  # clients send no pings of their own: of a spare one none is to be under way when the radio is lost
LOOKS_EVERY_S = 0.1  # whether the connection is lost: the callbacks of a client come only once its socket is closed
NEWER_AFTER_S = 0.8  # a connection that was taken gives way to a new one: no sooner than over a bad radio it answers
ANSWERS_WITHIN_S = 1.5  # it does, where there is another idle one
ANSWERS_AT_LAST_S = 10
LOG_AGAIN_S = 60.0  # the same complaint is logged no more often
MOST_REFUSED = 20  # subjects that are named
MOST_LOGGED = 20  # complaints in that time
NO_RIGHT = "permissions violation"  # as a broker words it; the connection stays


class Part(Protocol):
    """What works by a connection."""

    def open(self) -> None:
        """Before the first connection is tried."""

    def close(self) -> None:
        """No connection is tried any more."""

    async def start(self, client: Client) -> None:
        """Begin by a client that is connected, or go on by it: the one before is closed. Raises the client's errors and
        TimeoutError."""

    async def stop(self) -> None:
        """End."""


class BrokerLink:
    """Connects, and connects again, until it is stopped; its parts work whenever there is a connection."""

    def __init__(
        self,
        broker: Broker,
        *parts: Part,
        name: str,
        unsent: Callable[[], str | None] = lambda: None,
        spares: int = 0,
    ) -> None:
        """`name`: of this program in the broker's own lists; `unsent`: what was too large for the broker, as a
        sentence; `spares`: connections that are idle until the one that works is lost. Raises BrokerRefused."""
        self._broker = broker
        self._unsent = unsent
        self._parts = parts
        self._name = name
        self._seed = _seed(broker.key)
        self._context = _context(broker)
        self._spares = Spares(self._dial, broker.address, spares)
        self._client: Client | None = None
        self._pinging: asyncio.Task[Any] | None = None  # by that client
        self._supervisor: Supervisor | None = None
        self._is_started = False
        self._why = "it was not reached yet"
        self._logged: dict[str, float] = {}  # when each complaint was logged
        self._refused: dict[str, None] = {}  # what the broker refused by this connection, in its order

    @property
    def refused(self) -> str | None:
        """What the broker does not allow this program, as a sentence; None: it refused nothing by this connection.

        Nothing else shows it: subscriptions deliver nothing, and what is published does not arrive.
        """
        if not self._refused or not self._is_connected:
            return None
        what = "; ".join(self._refused)
        return f"The broker {self._broker.address} refuses a part of what this program needs: {what}."

    @property
    def unsent(self) -> str | None:
        """What of late was too large for the broker, in sentences; None: nothing."""
        return self._unsent()

    @property
    def complaint(self) -> str | None:
        """Why there is no connection, as a sentence; None: there is one."""
        if self._is_started and self._is_connected:
            return None
        return f"The broker {self._broker.address} is not connected: {self._why}."

    def beside(self) -> list[Client]:
        """As `Spares.beside`."""
        return self._spares.beside()

    @property
    def _is_connected(self) -> bool:
        return self._client is not None and self._client.is_connected

    def start(self) -> None:
        """Begin to connect, in the background, because everything else works without a broker."""
        for part in self._parts:
            part.open()
        self._supervisor = Supervisor("broker")
        self._supervisor.keep("link", self._run)
        self._supervisor.keep("spare connections", self._spares.run)

    async def stop(self) -> None:
        if self._supervisor is None:
            return
        for part in self._parts:
            part.close()
        await self._supervisor.stop()
        self._supervisor = None
        self._is_started = False
        for part in self._parts:
            await part.stop()
        await self._give_up()
        await self._spares.close()

    async def _run(self) -> None:
        now = asyncio.get_running_loop().time
        failed = 0  # in a row
        await self._give_up()
        while True:
            self._client = client = await self._spares.take()
            long_enough_s = math.inf
            self._refused.clear()  # its rights may be others
            try:
                for part in self._parts:
                    await part.start(client)
                await self._answers(client)
                self._spares.works()
                self._is_started = True
                long_enough_s = now() + WORKS_S
                log.info("broker_connected address=%s", self._broker.address)
                self._pinging = asyncio.create_task(_ping(client), name="ping the broker")
                while client.is_connected and not self._pinging.done():
                    await asyncio.wait({self._pinging}, timeout=LOOKS_EVERY_S)
                if client.is_connected:
                    await self._on_error(TimeoutError("it does not answer"))
            except Exception as why:  # whatever it was: without a link a car would be lost for good
                await self._on_error(why)
            is_lost, self._is_started = self._is_started, False
            failed = 0 if now() >= long_enough_s else failed + 1
            await self._give_up()
            if failed > MOST_AT_ONCE or (failed and not is_lost and not self._spares.is_any):
                await asyncio.sleep(RETRY_S)

    async def _give_up(self) -> None:
        """Nothing comes by this client any more: what the next one is to answer must not be answered twice."""
        if self._client is not None:
            await self._spares.give_up(self._client)
        if self._pinging is not None:
            self._pinging.cancel()
            self._pinging = None

    async def _answers(self, client: Client) -> None:
        """Return once the broker has processed the subscriptions. Raises TimeoutError, early where there is another
        connection to take."""
        await asyncio.sleep(0)  # its writing task is first: the PING would go ahead of them, and might be lost
        self._pinging = asyncio.create_task(client.rtt(timeout=ANSWERS_AT_LAST_S))
        now = asyncio.get_running_loop().time
        began_s = now()
        while not self._pinging.done():
            await asyncio.wait({self._pinging}, timeout=LOOKS_EVERY_S)
            waited_s = now() - began_s
            is_newer = waited_s >= NEWER_AFTER_S and self._spares.is_newer
            is_late = is_newer or (waited_s >= ANSWERS_WITHIN_S and self._spares.is_any)
            if not self._pinging.done() and not client.is_connected:
                raise client.last_error or ConnectionResetError("it ended the connection")
            if not self._pinging.done() and is_late:
                raise TimeoutError("it does not answer")
        self._pinging.result()

    async def _dial(self) -> Client:
        """A new connection. Raises what went wrong, once it was reported."""
        client = Client()
        try:
            await client.connect(
                self._broker.address,
                name=self._name,
                error_cb=self._on_error,
                nkeys_seed_str=self._seed,
                tls=self._context,
                inbox_prefix=f"_INBOX.{secrets.token_hex(8)}",
                connect_timeout=CONNECTS_WITHIN_S,
                ping_interval=SILENT_S,
                allow_reconnect=False,  # it would subscribe again by itself, beside a spare that was taken
                reconnect_time_wait=AGAIN_S,  # type: ignore[arg-type]
                max_reconnect_attempts=TRIES,
                pending_size=0,  # what cannot be sent now is not kept: it would come late
            )
            if not client.is_connected:  # what accepted it ended it before the first answer
                raise ConnectionResetError("it ended the connection")
            _check_size(client)
        except BaseException as why:
            await self._spares.give_up(client)
            if isinstance(why, Exception) and not isinstance(why, NoServersError):  # each try was reported
                await self._on_error(why)
            raise
        return client

    async def _on_error(self, why: Exception) -> None:
        self._why = _reason(why)
        if NO_RIGHT in self._why.lower() and len(self._refused) < MOST_REFUSED:
            self._refused[self._why] = None
        now_s = asyncio.get_running_loop().time()
        self._logged = {text: at_s for text, at_s in self._logged.items() if now_s - at_s <= LOG_AGAIN_S}
        if self._why not in self._logged and len(self._logged) < MOST_LOGGED:
            self._logged[self._why] = now_s
            log.warning("broker_error address=%s why=%s", self._broker.address, self._why)


async def _ping(client: Client) -> None:
    """Return once the broker has not answered. Not to be cancelled while the client is used: it cannot take the answer
    to a ping that nobody waits for."""
    with contextlib.suppress(Exception):  # whatever it was: the client has ended
        while True:
            await client.rtt(timeout=PING_ANSWERED_WITHIN_S)  # a flush returns at once where nothing reads the answer
            await asyncio.sleep(PING_EVERY_S)


def _check_size(client: Client) -> None:
    """Raises BrokerRefused where the broker takes less than each part must be able to send."""
    if client.max_payload < wire.SMALLEST:
        takes, needed = client.max_payload // 1000, wire.SMALLEST // 1000
        raise BrokerRefused(f"it takes messages of {takes} kB at most, and {needed} kB are needed (max_payload)")


def _reason(why: Exception) -> str:
    text = (getattr(why, "strerror", None) or str(why) or type(why).__name__).removeprefix("nats: ").strip("'. ")
    return "it does not know this program's key" if "authorization" in text.lower() else text


def _seed(path: Path | None) -> str | None:
    """Raises BrokerRefused."""
    if path is None:
        return None
    try:
        text = path.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError) as why:
        raise BrokerRefused(f"The key {path} cannot be read: {getattr(why, 'strerror', None) or 'not text'}.") from None
    try:
        if text.startswith("SU"):
            nkeys.from_seed(bytearray(text.encode()))
            return text
    except (nkeys.NkeysError, ValueError):
        pass
    raise BrokerRefused(f"{path} is no key of catgraph fleet, which begins with SU and has 58 letters.")


def _context(broker: Broker) -> ssl.SSLContext | None:
    """Raises BrokerRefused."""
    if not broker.address.startswith("tls://"):
        return None
    try:
        context = ssl.create_default_context(cafile=broker.authority)
    except OSError as why:
        raise BrokerRefused(f"The certificate {broker.authority} cannot be used: {why}.") from None
    context.sslobject_class = _EndsAtOnce
    return context


class _EndsAtOnce(ssl.SSLObject):
    """TLS that ends without the broker's reply: behind a gap none comes, asyncio waits 30 s for it, and nats-py dials
    only after that. Messages of NATS have lengths, so that nothing depends on how TLS ends."""

    def unwrap(self) -> None: ...


async def processed(client: Client, *, within_s: int = 10) -> None:
    """Return once the broker has processed all that was sent before. Raises the errors of the client and TimeoutError.

    One flush is not enough: nats-py writes its PING at once, ahead of what waits for its writing task, so the PONG of
    the first shows only that this task has run meanwhile.
    """
    for _ in range(2):
        await client.flush(timeout=within_s)
