"""A server to be attacked, as a process of its own: `python -m tests.server.security.victim DATA [CAR]`. Prints its
address; what it has to complain of goes to its second stream. It dials nobody but this machine."""

from __future__ import annotations

import asyncio
import socket
import sys
from pathlib import Path

import uvicorn

from server.app.app import create_app
from server.app.config import Config
from server.cli import logging
from server.protocol.rate_limit import Limits, Rate
from server.vehicle.vehicle import Vehicle
from server.web.middleware import http_protocol

ALL = Rate(per_s=1e6, at_once=10**6)  # what is tried here is what comes through


async def main(data: Path, *cars: str) -> None:
    limits = Limits(local_requests=ALL, commands=ALL, messages=ALL, slow_down=ALL)
    vehicles = (Vehicle(name="car", address=next(iter(cars), None)),)
    config = Config(vehicles=vehicles, data=data, allowed_hosts=("127.0.0.1",), limits=limits)
    listening = socket.create_server(("127.0.0.1", 0))
    print(f"http://127.0.0.1:{listening.getsockname()[1]}", flush=True)
    server = uvicorn.Server(uvicorn.Config(create_app(config), **http_protocol.options(limits)))
    await server.serve(sockets=[listening])


if __name__ == "__main__":
    logging.begin()
    asyncio.run(main(Path(sys.argv[1]), *sys.argv[2:]))
