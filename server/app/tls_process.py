"""HTTPS of one running server: its options, its certificate looked after, its port for TLS and plain, the page."""

from __future__ import annotations

import argparse
import asyncio
import datetime as dt
import functools
import logging
import socket
import sys
import time
from collections.abc import Callable, Coroutine
from contextlib import AsyncExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import uvicorn
from starlette.types import ASGIApp
from uvicorn.server import ServerState

from server.access.names import is_in_container
from server.app.config import Config, Tls
from server.tls import server_certificate
from server.tls.authority import Authority, TlsRefused
from server.tls.certificate_renewal import OwnCertificate, ProvidedCertificateRenewal, keep
from server.tls.names import HostAddresses, Names, addresses_now, host_now, names_of
from server.tls.setup import SetupAddresses, explaining, leading
from server.tls.tls_sniffer import Factory, TlsSniffer
from server.web.middleware import http_protocol

log = logging.getLogger("catgraph.tls")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--tls",
        nargs="+",
        metavar=("auto|off|CERT", "KEY"),
        help="auto: HTTPS by an authority of the server's own; off: plain HTTP; CERT KEY: HTTPS by these files (PEM), "
        "read again when they change (default: off on loopback, else auto)",
    )
    parser.add_argument(
        "--setup-port",
        type=int,
        metavar="PORT",
        help="port of the plain page with instructions for phones (default: after --port)",
    )


def read_options(args: argparse.Namespace) -> Tls | None:
    """The parsed options; None: none given. Raises ValueError with one sentence."""
    match args.tls, args.setup_port:
        case None, None:
            return None
        case None | ["auto"], port:
            return Tls(mode="auto", setup_port=port)
        case ["off"], None:
            return Tls(mode="off")
        case ["off"], _:
            raise ValueError("--setup-port has no effect with --tls off.")
        case [cert, key], port:
            return Tls(mode="files", cert=Path(cert), key=Path(key), setup_port=port)
    raise ValueError("--tls takes auto, off, or two files: the certificate and its key.")


def utc_now() -> dt.datetime:
    return dt.datetime.now(dt.UTC)


class Server(uvicorn.Server):
    """uvicorn's server with an event for the start of its application."""

    def __init__(self, config: uvicorn.Config) -> None:
        super().__init__(config)
        self.begun = asyncio.Event()

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        self.begun.set()


@dataclass(frozen=True, slots=True, kw_only=True)
class Secured:
    """What HTTPS needs of one server that is to start."""

    certificate: OwnCertificate | ProvidedCertificateRenewal
    tls: Tls
    host: str  # listened on
    outside: HostAddresses | None = None  # in a container
    now: Callable[[], dt.datetime] = utc_now

    @property
    def authority(self) -> Authority | None:
        """Ours; None where the certificate was given."""
        return self.certificate.authority if isinstance(self.certificate, OwnCertificate) else None

    @property
    def warning(self) -> str | None:
        """What somebody should see to soon."""
        return None if isinstance(self.certificate, OwnCertificate) else self.certificate.given.warning

    @property
    def names(self) -> Names:
        """The names now."""
        if isinstance(self.certificate, OwnCertificate):
            return self.certificate.names
        return names_of(_addresses(), host_now())

    def typed(self, host: str | None) -> None:
        """Somebody came to the plain page by this name."""
        if self.outside is not None and self.outside.learn(host):
            notice = self.certificate.refresh(self.now())
            if notice is not None:
                log.warning("%s", notice)

    def hosts(self) -> tuple[str, ...]:
        """The hosts that the page's address may have, the likeliest first."""
        if isinstance(self.certificate, ProvidedCertificateRenewal):
            return tuple(name for name in self.certificate.given.names if "*" not in name) or (host_now(),)
        names = self.names
        served = [ip for ip in names.ips if ip.version == 4 or ":" in self.host]
        reachable = [ip for ip in names.reachable if ip in served]
        all = [*map(str, reachable), *names.dns, *(str(ip) for ip in served if ip not in reachable)]
        return tuple(dict.fromkeys([self.host, *all] if self.host in all else all))


def secure(
    config: Config, *, now: Callable[[], dt.datetime] = utc_now, in_container: bool | None = None
) -> Secured | None:
    """The certificate that `config` requires; None: plain HTTP. Raises TlsRefused."""
    if not config.is_tls:
        return None
    tls = config.tls or Tls()
    certificate: OwnCertificate | ProvidedCertificateRenewal
    outside: HostAddresses | None = None
    if tls.mode == "files":
        if tls.cert is None or tls.key is None:
            raise TlsRefused("A given certificate needs its key, and a key its certificate.")
        certificate = ProvidedCertificateRenewal(tls.cert, tls.key, now=now())
    else:
        if config.data is None:
            raise TlsRefused("The server's own authority needs a data folder.")
        folder = config.data / "tls"
        if is_in_container() if in_container is None else in_container:
            before = server_certificate.load(folder)
            outside = HostAddresses(
                () if before is None else server_certificate.addresses_of(before), now=time.monotonic
            )
        names = functools.partial(_names_now, config.names, outside)
        certificate = OwnCertificate(folder, names, host=host_now(), now=now())
    return Secured(certificate=certificate, tls=tls, host=config.host, outside=outside, now=now)


async def serve_secured(
    secured: Secured, server: Server, config: Config, listening: socket.socket, explainer: socket.socket | None
) -> None:
    """Serves on `listening` by TLS and, plainly, the page that explains, on `explainer` too, until the server ends."""
    context = secured.certificate.context
    port = listening.getsockname()[1]
    setup_port = explainer.getsockname()[1] if explainer is not None else port
    plain = _Plain(_plain_app(secured, port, setup_port), config)
    async with AsyncExitStack() as ending:
        ending.callback(plain.close)
        looking_after = functools.partial(keep, secured.certificate, now=secured.now)
        ending.push_async_callback(_cancelled, _supervised(looking_after))
        if explainer is not None:
            loop = asyncio.get_running_loop()
            explaining_server = await loop.create_server(plain.protocol, sock=explainer)
            ending.callback(explaining_server.close)
        if sys.platform == "win32":
            server.config.ssl_context_factory = lambda *_: context.ssl
            await server.serve(sockets=[listening])
            return
        serving = asyncio.create_task(server.serve(sockets=[]), name="serve")
        begun = asyncio.create_task(server.begun.wait())
        await asyncio.wait([serving, begun], return_when=asyncio.FIRST_COMPLETED)
        begun.cancel()
        doorway = TlsSniffer(
            listening,
            context.ssl,
            secure=_pages(server),
            plain=plain.protocol,
            most=config.limits.connections,
            connected=lambda address: (
                http_protocol.connected(server.server_state.connections, address) + plain.connected(address)
            ),
        )
        ending.push_async_callback(_cancelled, _supervised(doorway.run))
        ending.callback(listening.close)
        try:
            await serving
        except asyncio.CancelledError:
            server.should_exit = True
            await serving
            raise


def _pages(server: Server) -> Factory:
    """As uvicorn makes the protocol of a connection; written against 0.54."""
    made: Callable[..., asyncio.Protocol] = server.config.http_protocol_class
    return lambda: made(config=server.config, server_state=server.server_state, app_state=server.lifespan.state)


class _Plain:
    """The plain page's side of uvicorn: no sockets of its own, no signals."""

    def __init__(self, app: ASGIApp, config: Config) -> None:
        self._config = uvicorn.Config(app, **{**http_protocol.options(config.limits), "lifespan": "off"})
        self._config.load()
        self._state = ServerState()

    def protocol(self) -> asyncio.Protocol:
        made: Callable[..., asyncio.Protocol] = self._config.http_protocol_class
        return made(config=self._config, server_state=self._state, app_state={})

    def connected(self, address: str) -> int:
        return http_protocol.connected(self._state.connections, address)

    def close(self) -> None:
        for connection in tuple(self._state.connections):
            connection.shutdown()


def _plain_app(secured: Secured, port: int, setup_port: int) -> ASGIApp:
    def where() -> SetupAddresses:
        return SetupAddresses(hosts=secured.hosts(), port=port, setup_port=setup_port)

    return leading(where) if secured.authority is None else explaining(secured.authority, where, secured.typed)


def _supervised(work: Callable[[], Coroutine[Any, Any, None]]) -> asyncio.Task[None]:
    """Run `work` until cancelled; a failure is logged and `work` is restarted."""

    async def again() -> None:
        while True:
            try:
                await work()
                return
            except Exception:
                log.exception("a task of HTTPS failed and is restarted")
                await asyncio.sleep(1.0)

    return asyncio.create_task(again())


async def _cancelled(task: asyncio.Task[None]) -> None:
    task.cancel()
    await asyncio.wait([task])


def _names_now(given: tuple[str, ...], outside: HostAddresses | None) -> Names:
    learnt = outside.addresses if outside is not None else ()
    return names_of(addresses_now(), host_now(), (*given, *learnt))


def _addresses() -> tuple[Any, ...]:
    try:
        return addresses_now()
    except OSError:
        return ()
