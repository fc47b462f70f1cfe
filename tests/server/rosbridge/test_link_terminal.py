"""What happens to links is not written to the terminal, in a process of its own."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.tree import PROJECT

NOISY = """
import asyncio, logging, sys, time
from tests.server.link_listener import *
from server.rosbridge.subscription import Subscription

logging.basicConfig(level=logging.INFO)
logging.getLogger("websockets").propagate = False  # the other side, which is only here in the test

async def http(reader, writer):
    writer.write(b"HTTP/1.1 404 X\\r\\n\\r\\n")

async def rude(reader, writer):
    await accept(reader, writer)
    writer.write(b"\\xff\\xff")

async def silent(reader, writer):
    await accept(reader, writer)
    await asyncio.sleep(3)

async def hostile(reader, writer):
    await accept(reader, writer)
    writer.write(text_frame(b"noise") + text_frame(b"x" * 200, opcode=2) + b"\\x82\\x7f\\x7f" + b"\\xff" * 100)

async def main():
    listeners = []

    def link_to(address):
        listeners.append(LinkListener())
        return linked(address, listeners[-1])

    async with answering(http) as a, answering(rude) as b, answering(silent) as c, answering(hostile) as d:
        async with bridging() as e, link_to(f"127.0.0.1:{a}"), link_to(f"127.0.0.1:{b}"), \\
                link_to(f"127.0.0.1:{c}"), link_to(f"127.0.0.1:{d}"), link_to("127.0.0.1:1"), \\
                link_to(f"wss://127.0.0.1:{e.port}"), link_to(e.address) as last:
            await asyncio.sleep(0.2)
            last.subscribe(Subscription(topic="/a", type=None))
            task = asyncio.create_task(last.call("/rosapi/get_time", timeout_s=0.1))
            await asyncio.sleep(1.8)
            e.sockets[-1].transport.abort()
            await asyncio.sleep(0.1)
            kinds = [set(kind for kind, _ in listener.received) for listener in listeners]
            assert kinds == [{"failed"}, {"opened", "closed"}, {"opened", "closed"}, {"opened", "junk", "closed"},
                             {"failed"}, {"failed"}, {"opened", "closed"}], kinds
            assert isinstance(task.exception(), Exception)
    print("done")

if sys.argv[1] == "uvloop":
    import uvloop
    uvloop.run(main())
else:
    asyncio.run(main())
"""


@pytest.mark.field
@pytest.mark.parametrize("loop", ["asyncio", "uvloop"])
def test_nothing_of_all_this_reaches_the_operators_terminal(loop: str) -> None:
    """However logging is set up: a dropped connection is reported once, by us, in the page."""
    ended = subprocess.run(
        [sys.executable, "-W", "error", "-c", NOISY, loop],
        cwd=PROJECT,
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
        env={"PATH": "/usr/bin:/bin"},
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "done\n", "")
