"""The bench's broker: a real nats-server."""

from __future__ import annotations

import asyncio

from tests.bench.orders import execute_orders
from tests.server.bus.broker import running_broker


async def main() -> None:
    async with running_broker() as broker:

        async def used() -> float:
            """Processor time that the broker has used so far [s]."""
            return broker.cpu_s()

        await execute_orders({"used": used}, {"address": broker.address, "pid": broker.pid})


if __name__ == "__main__":
    asyncio.run(main())
