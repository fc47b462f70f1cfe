"""A server as a process: listening, announcing its address, running until it is ended."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import gc
import logging
import os
import socket
import sys
import threading
from collections.abc import Coroutine
from dataclasses import replace
from pathlib import Path
from typing import Any

import ifaddr
import uvicorn

from server.access.invitations import LASTS_S
from server.app import store, tls_process
from server.app.app import create_app
from server.app.banner import Announcement, Pairing, addresses, invitation, lines, pair_command
from server.app.config import Config, Tls, default_data
from server.app.tls_process import Secured, Server, secure, serve_secured
from server.storage.data_folder import DataFolderRefused
from server.system.page_files import AssetsMissing
from server.tls.authority import TlsRefused
from server.tls.setup import Probe, SetupAddresses
from server.web.maps import map_options
from server.web.maps.mbtiles import MapRefused
from server.web.middleware import http_protocol
from server.web.routes.pages import PageFiles
from server.web.services import Services

log = logging.getLogger("catgraph.serving")

EXITS_WITHIN_S = 5.0  # once all parts have stopped, or were left (server/app/lifespan.py)


class CannotServe(Exception):
    """The server cannot start; `str()` is one sentence."""


def add_common_arguments(parser: argparse.ArgumentParser, *, has_cars: bool = True) -> None:
    """`has_cars`: the sessions are in this process, and so are their recordings."""
    parser.add_argument(
        "--host", default="127.0.0.1", help="address to listen on (default 127.0.0.1: this machine only)"
    )
    parser.add_argument("--port", type=int, default=8000, help="port to listen on, 0 for a free one (default 8000)")
    parser.add_argument("--data", type=Path, default=default_data(), help="data folder (default %(default)s)")
    parser.add_argument(
        "--name",
        action="append",
        default=[],
        help="another name of this server: a host, or https://HOST of a proxy; can be repeated",
    )
    tls_process.add_arguments(parser)
    parser.add_argument(
        "--map",
        type=Path,
        action="append",
        default=[],
        metavar="FILE.mbtiles",
        help="a map (raster MBTiles); can be repeated, the last is on top",
    )
    parser.add_argument(
        "--site-image",
        type=Path,
        metavar="FILE",
        help="an image of the site above the maps; FILE.toml has its corners (docs/guide/map.md)",
    )
    map_options.add_arguments(parser)
    store.add_arguments(parser, uploads=has_cars)
    parser.add_argument(
        "--no-worker",
        action="store_true",
        help="no service worker: phones store nothing of the page and show a browser error without the server",
    )


def run(work: Coroutine[Any, Any, int]) -> int:
    """Runs the server's work to its end; 130 when interrupted."""
    with uvloop_runner() as runner:
        code = 130
        with contextlib.suppress(KeyboardInterrupt, asyncio.CancelledError):
            code = runner.run(work)
        _exit_soon(code)
    return code


def _exit_soon(code: int) -> None:
    """Ends the process where a thread behind a disk that hangs would keep it: Python waits for all threads."""

    def end() -> None:
        log.error("exit_forced after_s=%g", EXITS_WITHIN_S)
        logging.shutdown()
        os._exit(code)

    timer = threading.Timer(EXITS_WITHIN_S, end)
    timer.daemon = True
    timer.start()


def uvloop_runner() -> asyncio.Runner:
    """A runner on uvloop where there is one: half the time a message on asyncio's own loop."""
    if sys.platform == "win32":
        return asyncio.Runner()
    import uvloop

    return asyncio.Runner(loop_factory=uvloop.new_event_loop)


async def serve(config: Config) -> int:
    """Serves until it is ended. Raises CannotServe."""
    try:
        secured = secure(config)
        if secured is not None and secured.authority is None:  # who has a certificate for a name may be called by it
            config = replace(config, names=(*config.names, *map(_bracketed, secured.hosts())))
        app = create_app(config)
    except TlsRefused as why:
        raise CannotServe(str(why)) from None
    except (AssetsMissing, MapRefused, DataFolderRefused) as why:
        raise CannotServe(str(why)) from None
    except OSError as why:
        raise CannotServe(f"The data folder {config.data} cannot be used: {why.strerror or why}.") from None
    listening = _listen(config.host, config.port)
    port = listening.getsockname()[1]
    explainer = _listen_to_explain(config, secured, port)
    server = Server(
        uvicorn.Config(
            app if secured is None else Probe(app),
            **http_protocol.options(config.limits),
            timeout_graceful_shutdown=2,
        )
    )
    _announce(config, port, secured, explainer, app.state.services)
    _settle_memory()
    warming = asyncio.create_task(_warm(server.begun, app.state.page_files), name="warm the page")
    if secured is None:
        await server.serve(sockets=[listening])
    else:
        await serve_secured(secured, server, config, listening, explainer)
    warming.cancel()  # of a server that did not start
    return 0


async def _warm(begun: asyncio.Event, files: PageFiles) -> None:
    """Prepare the first page once the server listens, in a thread: neither the start nor the event loop waits."""
    await begun.wait()
    await asyncio.to_thread(files.warm)


def _settle_memory() -> None:
    """What was loaded until now stays for good, and is not searched for circles again: a full search took 76 ms on a
    laptop, in which nothing else ran, no alarm and no command."""
    gc.collect()
    gc.freeze()


def _listen(host: str, port: int) -> socket.socket:
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        listening = socket.socket(family, socket.SOCK_STREAM)
        with contextlib.ExitStack() as unless_bound:
            unless_bound.callback(listening.close)
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listening.bind((host, port))
            listening.listen(256)
            listening.setblocking(False)
            unless_bound.pop_all()
    except (OSError, OverflowError) as why:
        reason = (getattr(why, "strerror", None) or str(why)).rstrip(".")
        raise CannotServe(f"Nothing can listen on {host}:{port}: {reason}.") from None
    return listening


def _listen_to_explain(config: Config, secured: Secured | None, port: int) -> socket.socket | None:
    """The plain HTTP port. If the default is in use, the page's own port serves both."""
    if secured is None:
        return None
    chosen = (config.tls or Tls()).setup_port
    if chosen is None and secured.authority is None:
        return None
    usual = 0 if config.port == 0 else port + 1 if port < 65535 else port - 1
    try:
        return _listen(config.host, usual if chosen is None else chosen)
    except CannotServe as why:
        if chosen is not None:
            raise
        log.warning("%s The instructions for phones are on the page's own port.", why)
        return None


def _announce(
    config: Config, port: int, secured: Secured | None, explainer: socket.socket | None, running: Services
) -> None:
    """Print the addresses; the first line is for scripts too."""
    announcement = Announcement(config=config, url=_plain_url(config.host, port))
    if not config.is_open:
        announcement = replace(announcement, pairing=_pairing(running, config))
    if secured is not None:
        setup_port = explainer.getsockname()[1] if explainer is not None else port
        where = SetupAddresses(hosts=secured.hosts(), port=port, setup_port=setup_port)
        url, others = addresses(where)
        announcement = replace(announcement, url=url, others=others)
        if secured.authority is not None:
            authority = secured.authority
            announcement = replace(
                announcement, setup=where.setup(), fingerprint=authority.fingerprint, authority=authority.name
            )
            announcement = replace(announcement, left_out=secured.names.left_out if _is_any(config.host) else ())
        else:
            announcement = replace(announcement, warning=secured.warning)
    draws = sys.stdout.isatty()
    for line in lines(announcement, draws=draws):
        print(line, flush=True)
    running.access.listens_at(announcement.url)
    if draws and not config.is_open:
        running.access.on_paired = lambda name, role: _print_invitation(
            running, config, announcement.url, f"{name} was paired as {role}."
        )


def _print_invitation(running: Services, config: Config, url: str, what: str) -> None:
    for line in invitation(url, _pairing(running, config), f"  {what} The next device:"):
        print(line, flush=True)


def _pairing(running: Services, config: Config) -> Pairing:
    next_one = running.access.invitation()
    return Pairing(
        token=next_one.token, pin=next_one.pin, minutes=round(LASTS_S / 60), command=pair_command(config.data)
    )


def _plain_url(host: str, port: int) -> str:
    return f"http://{_bracketed(_reachable(host))}:{port}/"


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host else host


def _is_any(host: str) -> bool:
    return host in ("0.0.0.0", "::", "")


def _reachable(host: str) -> str:
    """The address to type into a phone for a server that listens on `host`."""
    if not _is_any(host):
        return host
    for adapter in ifaddr.get_adapters():
        for ip in adapter.ips:
            if ip.is_IPv4 and not str(ip.ip).startswith(("127.", "169.254.", "172.17.")):
                return str(ip.ip)
    return "127.0.0.1"
