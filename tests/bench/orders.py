"""The bench's processes take orders from their stdin and answer on their stdout, one JSON object a line each way."""

from __future__ import annotations

import asyncio
import os
import sys
import time
import traceback
from collections.abc import Awaitable, Callable, Mapping
from typing import Any

import orjson

Orders = Mapping[str, Callable[..., Awaitable[Any]]]
_OUT = sys.stdout.buffer  # whatever becomes of sys.stdout: what others print is no answer


def options() -> dict[str, Any]:
    """What the process was started with."""
    return orjson.loads(sys.argv[1]) if len(sys.argv) > 1 else {}


async def execute_orders(orders: Orders, hello: Mapping[str, Any]) -> None:
    """Send `hello`, then execute orders until stdin ends: so the process ends also when the bench is killed.

    Every process has the order `cpu`: the processor time it has used so far [ns], all its threads.
    """
    orders = {**orders, "cpu": _cpu}
    loop = asyncio.get_running_loop()
    reader = asyncio.StreamReader(limit=2**24)
    pipe, _ = await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), os.fdopen(0, "rb"))
    try:
        _send({"answer": hello})
        async for line in reader:
            order = orjson.loads(line)
            try:
                _send({"answer": await orders[order.pop("do")](**order)})
            except Exception:  # the bench reports any
                _send({"error": traceback.format_exc()})
    finally:
        pipe.close()


async def _cpu() -> int:
    return time.process_time_ns()


def _send(message: Mapping[str, Any]) -> None:
    _OUT.write(orjson.dumps(message) + b"\n")
    _OUT.flush()
