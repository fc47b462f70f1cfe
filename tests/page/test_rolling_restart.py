"""Two web nodes behind a plain TCP proxy are restarted one after the other under an open page."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from tests.http import http_client
from tests.page.conftest import Phone
from tests.page.processes import Process, running, simulate
from tests.ports import free_port
from tests.server.bus.broker import running_broker

# Sockets that were opened, and the longest times without a message, as the page has them.
WATCHED = """() => {
  window.opened = 0; window.gaps = []; window.last = 0;
  const Plain = window.WebSocket;
  window.WebSocket = class extends Plain {
    constructor(...all) {
      super(...all);
      this.addEventListener('open', () => { window.opened += 1; });
      this.addEventListener('message', () => {
        const now = performance.now();
        if (window.last) window.gaps.push(now - window.last);
        window.last = now;
      });
    }
  };
}"""
VEILED = """() => {
  window.veiled = 0;
  const veil = document.querySelector('#monitor [data-f="veil"]');
  new MutationObserver(() => { if (veil.hasAttribute('data-on')) window.veiled += 1; })
    .observe(document.querySelector('#monitor'), {subtree: true, attributes: true, attributeFilter: ['data-on']});
}"""
STALE_MS = 2000  # values are covered then


class Proxy:
    """A load balancer: each connection goes to the first node that takes it; the one that took the last comes first."""

    def __init__(self, *ports: int) -> None:
        self.ports = list(ports)
        self.taken: list[int] = []

    async def handle(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        for port in list(self.ports):
            with contextlib.suppress(OSError):
                there = await asyncio.open_connection("127.0.0.1", port)
                self.ports.sort(key=lambda one: one != port)
                self.taken.append(port)
                await asyncio.wait(
                    [asyncio.create_task(_carry(reader, there[1])), asyncio.create_task(_carry(there[0], writer))],
                    return_when=asyncio.FIRST_COMPLETED,
                )
                there[1].close()
                break
        writer.close()


async def _carry(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with contextlib.suppress(OSError):
        while data := await reader.read(65536):
            writer.write(data)
            await writer.drain()


@contextlib.asynccontextmanager
async def balanced(*ports: int) -> AsyncIterator[tuple[Proxy, str]]:
    proxy = Proxy(*ports)
    server = await asyncio.start_server(proxy.handle, "127.0.0.1", 0)
    try:
        yield proxy, f"http://127.0.0.1:{server.sockets[0].getsockname()[1]}"
    finally:
        server.close()


async def well(node: Process) -> None:
    """Until a load balancer would send pages there."""
    async with http_client() as client, asyncio.timeout(60):
        while (await client.get(f"{node.address}/api/health")).json()["status"] != "ok":
            await asyncio.sleep(0.1)


@pytest.mark.own_phone
async def test_a_page_sees_one_new_connection_for_each_node_that_is_restarted(phone: Phone, tmp_path: Path) -> None:
    ports = free_port(), free_port()

    def node(i: int, broker: str) -> tuple[str, ...]:
        return ("web", "--broker", broker, "--port", str(ports[i]), "--data", str(tmp_path / f"node{i}"), *EXPECTED)

    async with running_broker() as broker, running(*simulate()) as car, balanced(*ports) as (proxy, address):
        agent = ("agent", "--broker", broker.address, "--port", "0", "--data", str(tmp_path / "agent"))
        async with contextlib.AsyncExitStack() as stack:
            await stack.enter_async_context(running(*agent, "--vehicle", f"ocelot={car.address}"))
            nodes = [await stack.enter_async_context(running(*node(i, broker.address))) for i in (0, 1)]
            for one in nodes:
                await well(one)
            await phone.page.add_init_script(f"({WATCHED})()")
            await phone.open(address)
            await phone.live()
            await phone.page.evaluate(VEILED)
            rows = []
            for at in (0, 1):
                await phone.page.evaluate("() => { window.gaps = []; window.opened = 0; window.veiled = 0; }")
                left = proxy.ports[0]
                old = next(one for one in nodes if one.address.endswith(f":{left}"))
                took_s = await old.terminate()
                await phone.page.wait_for_function("() => window.opened >= 1", timeout=15_000)
                await phone.live()
                again = await stack.enter_async_context(running(*node(ports.index(left), broker.address)))
                nodes[nodes.index(old)] = again
                await well(again)
                seen: Any = await phone.page.evaluate("() => [window.opened, Math.max(...window.gaps), window.veiled]")
                rows.append(seen)
                print(f"restart {at + 1}: {seen[0]} new connection, {seen[1]:.0f} ms without a message, "
                      f"covered {seen[2]} ×, the node ended in {took_s:.1f} s")  # fmt: skip
            assert [opened for opened, _, _ in rows] == [1, 1]
            if phone.stutter_s < 0.5:
                assert all(gap_ms < STALE_MS for _, gap_ms, _ in rows)
                assert all(veiled == 0 for _, _, veiled in rows)


EXPECTED = ("--expect", "ocelot")
