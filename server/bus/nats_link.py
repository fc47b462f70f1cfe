"""The connection of one program to a NATS broker: who it is, and that it is there again after any loss."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
import ssl
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import nkeys
from nats.aio.client import Client

from server.bus import nats_wire as wire
from server.bus.broker import Broker, BrokerRefused

log = logging.getLogger("catgraph.bus")

RETRY_S = 1
AGAIN_S = 0.3  # between two dials of a broker that was lost: behind a gap of the radio pages wait for it
CONNECTS_WITHIN_S = 3
PING_EVERY_S = 2  # a broker that has not answered two of them is gone: after 4 to 6 s
LOG_AGAIN_S = 60.0  # the same complaint is logged no more often
MOST_REFUSED = 20  # subjects that are named
NO_RIGHT = "permissions violation"  # as a broker words it; the connection stays


class Part(Protocol):
    """What works by a connection."""

    def open(self) -> None:
        """Before the first connection is tried."""

    def close(self) -> None:
        """No connection is tried any more."""

    async def start(self, client: Client) -> None:
        """Begin by a client that is connected. Raises the client's errors and TimeoutError."""

    async def stop(self) -> None:
        """End; it may be started again with another client."""


class BrokerLink:
    """Connects, and connects again, until it is stopped; its parts work whenever there is a connection.

    The client connects again by itself where the network or the broker was lost. Where the broker sends it away, as
    after its key was withdrawn, the client ends for good: then another one takes its place.
    """

    def __init__(
        self, broker: Broker, *parts: Part, name: str, unsent: Callable[[], str | None] = lambda: None
    ) -> None:
        """`name`: of this program in the broker's own lists; `unsent`: what was too large for the broker, as a
        sentence. Raises BrokerRefused."""
        self._broker = broker
        self._unsent = unsent
        self._parts = parts
        self._name = name
        self._seed = _seed(broker.key)
        self._context = _context(broker)
        self._client: Client | None = None
        self._task: asyncio.Task[None] | None = None
        self._is_started = False
        self._why = "it was not reached yet"
        self._logged: tuple[str, float] = ("", 0.0)
        self._refused: dict[str, None] = {}  # what the broker refused by this connection, in its order

    @property
    def refused(self) -> str | None:
        """What the broker does not allow this program, as a sentence; None: it refused nothing by this connection.

        Nothing else shows it: subscriptions deliver nothing, and what is published does not arrive.
        """
        if not self._refused:
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
        if self._is_started and self._client is not None and self._client.is_connected:
            return None
        return f"The broker {self._broker.address} is not connected: {self._why}."

    def start(self) -> None:
        """Begin to connect, in the background, because everything else works without a broker."""
        for part in self._parts:
            part.open()
        self._task = asyncio.create_task(self._run(), name="broker link")

    async def stop(self) -> None:
        if self._task is None:
            return
        for part in self._parts:
            part.close()
        self._task.cancel()
        await asyncio.gather(self._task, return_exceptions=True)
        self._task = None

    async def _run(self) -> None:
        while True:
            client, ended = Client(), asyncio.Event()
            self._client = client
            try:
                await self._connect(client, ended)
                _check_size(client)
                for part in self._parts:
                    await part.start(client)
                self._is_started = True
                log.info("broker_connected address=%s", self._broker.address)
                await ended.wait()
            except Exception as why:  # whatever it was: without a link a car would be lost for good
                await self._on_error(why)
            finally:
                self._is_started = False
                self._refused.clear()
                for part in self._parts:
                    await part.stop()
                with contextlib.suppress(Exception):  # a client that never connected cannot be closed
                    await client.close()
            await asyncio.sleep(RETRY_S)

    async def _connect(self, client: Client, ended: asyncio.Event) -> None:
        async def on_ended() -> None:
            ended.set()

        async def on_lost() -> None:
            self._refused.clear()  # by the next connection its rights may be others

        await client.connect(
            self._broker.address,
            name=self._name,
            error_cb=self._on_error,
            closed_cb=on_ended,
            disconnected_cb=on_lost,
            nkeys_seed_str=self._seed,
            tls=self._context,
            inbox_prefix=f"_INBOX.{secrets.token_hex(8)}",
            connect_timeout=CONNECTS_WITHIN_S,
            ping_interval=PING_EVERY_S,
            max_outstanding_pings=2,
            reconnect_time_wait=AGAIN_S,  # type: ignore[arg-type]
            max_reconnect_attempts=-1,
            pending_size=0,  # what cannot be sent now is not kept: it would come late
        )

    async def _on_error(self, why: Exception) -> None:
        self._why = _reason(why)
        if NO_RIGHT in self._why.lower() and len(self._refused) < MOST_REFUSED:
            self._refused[self._why] = None
        now_s = asyncio.get_running_loop().time()
        logged, at_s = self._logged
        if self._why != logged or now_s - at_s > LOG_AGAIN_S:
            self._logged = (self._why, now_s)
            log.warning("broker_error address=%s why=%s", self._broker.address, self._why)


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
