"""`python -m tests.through_broker MODULE serve …`: a server in three parts, an agent, a real broker and a web node.

The tests of the page run against it with CATGRAPH_THROUGH_BROKER=1. Its parts end with it, also when it is killed.
"""

from __future__ import annotations

import asyncio
import ctypes
import os
import re
import signal
import sys
import tempfile
from pathlib import Path

from server.bus import nats_wire as wire
from tests.ports import free_port
from tests.server.bus.broker import connected, nats_server

NODE = "node"  # the node's data folder, in that of the agent
OF_AGENT = ("--vehicle", "--only")
_PR_SET_PDEATHSIG = 1


def end_with_parent() -> None:
    ctypes.CDLL("libc.so.6").prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


async def start(*command: str, listens: bool = True) -> str:
    """Start a part and answer the address that it prints."""
    process = await asyncio.create_subprocess_exec(
        *command,
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        stderr=None if os.environ.get("CATGRAPH_THROUGH_BROKER") == "2" else asyncio.subprocess.DEVNULL,
        preexec_fn=end_with_parent,
    )
    if not listens:
        return ""
    assert process.stdout is not None
    while line := (await process.stdout.readline()).decode():
        if found := re.search(r"https?://[^\s/]+:\d+", line):
            asyncio.get_running_loop().create_task(drain(process.stdout))
            return found.group()
    raise SystemExit(f"{command} ended")


async def agents_ready(broker: str, names: list[str]) -> None:
    """Wait until the agent has announced each vehicle, and the node has had time to read it."""
    async with connected(broker) as client:
        for name in names:
            here = await client.subscribe(wire.subject(name, "here"))
            await here.next_msg(timeout=60)
    await asyncio.sleep(0.3)


def parted(arguments: list[str]) -> tuple[list[str], list[str], Path]:
    """The options of the agent, those of the node, and the data folder; the node's own is in it."""
    options: list[list[str]] = []
    for argument in arguments:
        if argument.startswith("--"):
            options.append([argument])
        else:
            options[-1].append(argument)
    data = [Path(option[1]) for option in options if option[0] == "--data"] or [Path(tempfile.mkdtemp())]
    agent = [argument for option in options if option[0] in OF_AGENT for argument in option]
    page = [argument for option in options if option[0] not in (*OF_AGENT, "--data") for argument in option]
    return agent, page if "--port" in page else ["--port", "0", *page], data[0]


async def drain(out: asyncio.StreamReader) -> None:
    while await out.readline():
        pass


async def main(arguments: list[str]) -> None:
    module, command, *options = arguments
    assert command == "serve"
    of_agent, of_page, data = parted(options)
    at_port = free_port()
    broker = f"nats://127.0.0.1:{at_port}"
    store = tempfile.mkdtemp()
    await start(nats_server(), "-a", "127.0.0.1", "-p", str(at_port), "-js", "-sd", store, listens=False)
    await asyncio.sleep(0.3)
    python = (sys.executable, "-m", module)
    names = [argument.split("=")[0] for argument in of_agent if "=" in argument.split("://")[0]]
    expected = [argument for name in names or ["car"] for argument in ("--expect", name)]
    agent = (*python, "agent", "--no-require-signed", "--broker", broker)  # the tests' own requests sign nothing
    console, node = await asyncio.gather(
        start(*agent, "--port", "0", "--data", str(data), *of_agent),
        start(*python, "web", "--broker", broker, "--data", str(data / NODE), *expected, *of_page),
    )
    await agents_ready(broker, names or ["car"])
    print(f"console at {console.split('//')[1]}\ncatgraph listens on {node}/", flush=True)
    await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1:]))
