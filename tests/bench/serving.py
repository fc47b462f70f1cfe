"""The bench's server: catgraph as `catgraph serve` runs it, but its speed alarm has no delays, and it is timed inside.

Without the delays every speed above the limit is an alarm of its own, so what is measured is the way through the
server and not the operator's patience.
"""

from __future__ import annotations

import asyncio
import contextlib
import dataclasses
import io
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from monitor import catalog
from monitor.runner import Monitor
from server.app import app, process
from server.app.config import Config
from server.bus.broker import Broker
from server.bus.journal import Journal
from server.rosbridge import codec
from server.vehicle.message_intake import MessageIntake
from server.vehicle.session import Session
from server.vehicle.tick import Tick
from server.vehicle.vehicle import Vehicle
from tests.bench import slow_disk
from tests.bench.orders import execute_orders, options

VEHICLE = "car"


def impatient_checks() -> list[catalog.AnyCheck]:
    """All checks, the speed limit's alarm without delays."""
    return [
        dataclasses.replace(check, alarm=dataclasses.replace(check.alarm, on_delay_s=0.0, off_delay_s=0.0))
        if check.id == "speed_limit"
        else check
        for check in catalog.load()
    ]


class Timed:
    """Counts the calls of a function and the processor time of this thread in them [ns]."""

    def __init__(self, owner: Any, name: str) -> None:
        self.calls = self.spent_ns = 0
        inner: Callable[..., Any] = getattr(owner, name)

        def outer(*args: Any, **kwargs: Any) -> Any:
            began_ns = time.thread_time_ns()
            try:
                return inner(*args, **kwargs)
            finally:
                self.spent_ns += time.thread_time_ns() - began_ns
                self.calls += 1

        setattr(owner, name, outer)


class LoopLag:
    """How late the event loop wakes up who sleeps [s], and its thread's processor time meanwhile [s]."""

    EVERY_S = 0.005

    def __init__(self) -> None:
        self._lags_s: list[tuple[float, float]] = []
        self._task: asyncio.Task[None] | None = None

    async def begin(self) -> None:
        self._lags_s = []
        self._task = asyncio.create_task(self._watch())

    async def end(self) -> list[tuple[float, float]]:
        assert self._task is not None
        self._task.cancel()
        return self._lags_s

    async def _watch(self) -> None:
        while True:
            due_s, worked_s = time.monotonic() + self.EVERY_S, time.thread_time()
            await asyncio.sleep(self.EVERY_S)
            self._lags_s.append((max(0.0, time.monotonic() - due_s), time.thread_time() - worked_s))


def fill(journal: Path, events: int) -> None:
    """An alarm log as of weeks."""
    kept = Journal(journal)
    for first in range(0, events, 1000):
        kept.append(VEHICLE, [_event(n) for n in range(first, min(events, first + 1000))])
    kept.close()


def _event(n: int) -> dict[str, Any]:
    is_raised = n // 40 % 2 == 0
    return {
        "at_ms": 1_790_000_000_000 + 1000 * n,
        "alarm": f"alarm_{n % 40}",
        "change": "raised" if is_raised else "cleared",
        "state": "unacknowledged" if is_raised else "normal",
        "occurrence": n // 80 + 1,
        "text": "12.0 m/s, limit 11.0 m/s",
    }


async def main(events: int = 0, disk_s: float = 0.0, broker: str | None = None, is_node: bool = False) -> None:
    """`events`: in the alarm log when it starts. `disk_s`: what each access to the disk takes longer, once it runs.

    With a `broker` it is an agent, or a web node.
    """
    timed = {
        "parse": Timed(codec, "decode"),
        "message": Timed(MessageIntake, "message_received"),
        "step": Timed(Monitor, "step"),
        "tick": Timed(Tick, "run"),
        "frame": Timed(Session, "frame"),
    }
    made: list[Any] = []

    def create_app(config: Config) -> Any:
        made.append(app.create_app(config, checks=impatient_checks()))
        return made[-1]

    process.create_app = create_app  # so that uvicorn is set up as the product sets it up
    announced = io.StringIO()
    kept = tempfile.TemporaryDirectory()  # the alarm log is on a disk, as in earnest
    fill(Path(kept.name) / "events.sqlite", events)
    lag = LoopLag()
    with contextlib.redirect_stdout(announced):
        config = Config(
            port=0,
            data=Path(kept.name),
            broker=Broker(address=broker) if broker else None,
            is_node=is_node,
            vehicles=() if is_node else (Vehicle(name=VEHICLE),),
        )
        running = asyncio.create_task(process.serve(config))
        while "listens on" not in announced.getvalue() or not made[-1].state.services.bus.vehicles:
            if running.done():
                running.result()
            await asyncio.sleep(0.01)
    url = announced.getvalue().split()[3].replace("http://", "ws://")

    async def command(**command: Any) -> Any:
        """The commands of a page: connect, disconnect."""
        return await made[-1].state.services.bus.request(VEHICLE, command)

    async def timings() -> dict[str, Any]:
        """Calls and processor time [ns] of the timed functions so far, and the clock [ns]."""
        spent = {name: [one.calls, one.spent_ns] for name, one in timed.items()}
        return {"at_ns": time.monotonic_ns(), "spent": spent}

    try:
        if disk_s:
            slow_disk.begin(Path(kept.name), disk_s)
        orders = {"command": command, "timings": timings, "begin_stalls": lag.begin, "stalls": lag.end}
        await execute_orders(orders, {"url": f"{url}ws"})
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        kept.cleanup()


if __name__ == "__main__":
    with process.uvloop_runner() as runner:
        runner.run(main(**options()))
