"""A server as a process: listening, announcing its address, running until it is ended."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import os
import socket
import sys
from collections.abc import Coroutine
from pathlib import Path
from typing import Any

import ifaddr
import segno
import uvicorn

from server.app import create_app
from server.config import Config
from server.web import requests
from server.web.assets import AssetsMissing
from server.web.mbtiles import MapRefused


class CannotServe(Exception):
    """The server cannot start; `str()` is one sentence."""


def add_common_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--host", default="127.0.0.1", help="address to listen on (default 127.0.0.1: this machine only)"
    )
    parser.add_argument("--port", type=int, default=8000, help="port to listen on, 0 for a free one (default 8000)")
    parser.add_argument(
        "--data", type=Path, default=_default_data(), help="folder for what is kept (default %(default)s)"
    )
    parser.add_argument(
        "--map",
        type=Path,
        action="append",
        default=[],
        metavar="FILE.mbtiles",
        help="a map to draw under the car: raster MBTiles; several lie on each other, the last on top",
    )
    parser.add_argument(
        "--site-image",
        type=Path,
        metavar="FILE",
        help="a picture of the site to draw above the maps; its corners stand in FILE.toml beside it, see README",
    )


def _default_data() -> Path:
    base = os.environ.get("XDG_DATA_HOME")
    return (Path(base) if base else Path.home() / ".local" / "share") / "catgraph"


def run(work: Coroutine[Any, Any, int]) -> int:
    """Runs the server's work to its end; 130 when interrupted."""
    with uvloop_runner() as runner, contextlib.suppress(KeyboardInterrupt, asyncio.CancelledError):
    parser.add_argument(
        "--no-worker",
        action="store_true",
        help="phones keep nothing of the page; without the server they then show their browser's own error",
    )
        return runner.run(work)
    return 130


def uvloop_runner() -> asyncio.Runner:
    """A runner on uvloop where there is one: half the time a message on asyncio's own loop."""
    if sys.platform == "win32":
        return asyncio.Runner()
    import uvloop

    return asyncio.Runner(loop_factory=uvloop.new_event_loop)


async def serve(config: Config) -> int:
    """Serves until it is ended. Raises CannotServe."""
    try:
        app = create_app(config)
    except (AssetsMissing, MapRefused) as why:
        raise CannotServe(str(why)) from None
    except OSError as why:
        raise CannotServe(f"The data folder {config.data} cannot be used: {why.strerror or why}.") from None
    listening = _listen(config.host, config.port)
    port = listening.getsockname()[1]
    server = uvicorn.Server(
        uvicorn.Config(
            app,
            **requests.options(config.limits),
            timeout_graceful_shutdown=2,
        )
    )
    _announce(config, port)
    await server.serve(sockets=[listening])
    return 0


def _listen(host: str, port: int) -> socket.socket:
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        listening = socket.socket(family, socket.SOCK_STREAM)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((host, port))
        listening.listen(256)
        listening.setblocking(False)
    except (OSError, OverflowError) as why:
        reason = getattr(why, "strerror", None) or str(why)
        raise CannotServe(f"Nothing can listen on {host}:{port}: {reason}.") from None
    return listening


def _announce(config: Config, port: int) -> None:
    """The address for people (and, on the first line, for scripts), and a QR code for phones on the same network."""
    shown = _reachable(config.host)
    bracketed = f"[{shown}]" if ":" in shown else shown
    url = f"http://{bracketed}:{port}/"
    print(f"catgraph listens on {url}", flush=True)
    for vehicle in config.vehicles:
        print(f"  {vehicle.name}: {vehicle.address or 'waits for an address from the page'}", flush=True)
    if shown in ("127.0.0.1", "::1", "localhost"):
        print("  Only this machine can open it; for phones start it with --host 0.0.0.0.", flush=True)
    elif sys.stdout.isatty():
        segno.make(url, error="m").terminal(compact=True)
    print("  Ctrl-C ends it.", flush=True)


def _reachable(host: str) -> str:
    """The address to type into a phone for a server that listens on `host`."""
    if host not in ("0.0.0.0", "::", ""):
        return host
    for adapter in ifaddr.get_adapters():
        for ip in adapter.ips:
            if ip.is_IPv4 and not str(ip.ip).startswith(("127.", "169.254.", "172.17.")):
                return str(ip.ip)
    return "127.0.0.1"
