"""Waiting until a NATS broker has processed what a client sent."""

from __future__ import annotations

from nats.aio.client import Client


async def processed(client: Client, *, within_s: int = 10) -> None:
    """Return once the broker has processed all that was sent before. Raises the errors of the client and TimeoutError.

    One flush is not enough: nats-py writes its PING at once, ahead of what waits for its writing task, so the PONG of
    the first shows only that this task has run meanwhile.
    """
    for _ in range(2):
        await client.flush(timeout=within_s)
