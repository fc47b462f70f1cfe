"""A mailer in its own process, to be killed: orders the given mails once, then sends until the outbox is empty."""

from __future__ import annotations

import argparse
import asyncio
import time
from pathlib import Path

from server.mail.mailer import Mailer
from server.mail.outbox import MAX_OPEN
from tests.server.mail.mailing import Shelf, order, settings


async def main(options: argparse.Namespace) -> None:
    mailer = Mailer(
        options.folder, Shelf(options.shelf), wall_ms=lambda: time.time_ns() // 1_000_000, pause_s=lambda attempts: 0.02
    )
    await mailer.start()
    assert mailer.trouble is None, mailer.trouble
    if not mailer.settings.is_complete:
        await mailer.change(settings(options.port, limit_mb=0.1))
    print("started", flush=True)
    for i in range(options.orders):  # the same keys at each start: an order that was taken is not taken twice
        await mailer.order(f"order-{i:04}", order("large" if i % 10 == 9 else "small", subject=f"Drive {i}"))
        if i % 10 == 9:
            print(f"ordered {i + 1}", flush=True)
    while any(letter.state in ("queued", "sending") for letter in await mailer.letters(None, MAX_OPEN)):
        await asyncio.sleep(0.05)
    print("over", flush=True)
    await mailer.stop()


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("shelf", type=Path)
    parser.add_argument("port", type=int)
    parser.add_argument("orders", type=int)
    asyncio.run(main(parser.parse_args()))
