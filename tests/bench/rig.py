"""The bench's processes, started when first needed and ended together, and the pace of a run."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from tests.bench.child import Child


@dataclass(frozen=True, slots=True, kw_only=True)
class Pace:
    """How long things are measured."""

    probes: int  # alarms a series
    probe_every_s: float
    rounds: int  # series in turn, where one figure is another's difference
    load_s: float  # how long load is measured
    held_s: float  # how long an order is: of 200 commands three decide on p99, and each late one spoils two gaps
    gap_s: float  # how long a page reads nothing
    settle_s: float  # between connecting and measuring
    crowd: int  # pages that look on
    many: int  # pages on the bridge
    most: int  # pages on the server
    warm_s: float  # until the server's rings and caches are full, before its memory is looked at
    memory_s: float  # how long memory is looked at
    stall_s: float  # how long the event loop is watched
    events: int  # in the journal of a server that has run for long
    agents: tuple[int, ...]  # real ones at a broker
    cars: tuple[int, ...]  # at a broker
    watchers: tuple[int, ...]  # pages at a web node
    use_s: float  # how long each point of a fleet's load is measured


FULL = Pace(
    probes=240,
    probe_every_s=0.08,
    rounds=5,
    load_s=10.0,
    held_s=40.0,
    gap_s=10.0,
    settle_s=1.0,
    crowd=30,
    many=50,
    most=100,
    warm_s=180.0,
    memory_s=420.0,
    stall_s=60.0,
    events=200_000,
    agents=(1, 3),
    cars=(1, 10, 30, 100),
    watchers=(10, 100, 300),
    use_s=8.0,
)
QUICK = Pace(
    probes=20,
    probe_every_s=0.06,
    rounds=1,
    load_s=0.8,
    held_s=0.8,
    gap_s=2.0,
    settle_s=0.1,
    crowd=30,
    many=50,
    most=100,
    warm_s=0.5,
    memory_s=1.5,
    stall_s=3.0,
    events=2_000,
    agents=(1,),
    cars=(1, 2),
    watchers=(2, 6),
    use_s=0.6,
)


class Rig:
    """A car, a server, pages and clients of the bridge, each a process. Leave it by `with`, so that all of them end."""

    def __init__(self, pace: Pace) -> None:
        self.pace = pace
        self._stack = contextlib.ExitStack()
        self._children: dict[str, Child] = {}

    def __enter__(self) -> Rig:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    @property
    def car(self) -> Child:
        """The car at full load: 181 and 180 beams at 75 Hz, and all else at the real car's rates."""
        return self._child("car", "car")

    @property
    def dense_car(self) -> Child:
        """The same car with 1081 beams at 20 Hz."""
        return self._child("dense car", "car", beams=1081)

    @property
    def server(self) -> Child:
        return self._child("server", "serving")

    @contextlib.contextmanager
    def pages(self, count: int, *, car: Child | None = None, **more: Any) -> Iterator[Child]:
        """So many pages that watch the car through catgraph, until the block ends; then the bridge is rid of it."""
        self.server.ask("command", kind="connect", address=(car or self.car).hello["url"])
        try:
            with self.pages_at(self.server.hello["url"], count, **more) as pages:
                yield pages
        finally:
            self.server.ask("command", kind="disconnect")

    @contextlib.contextmanager
    def pages_at(self, url: str, count: int, **more: Any) -> Iterator[Child]:
        """So many pages at a server of any kind, until the block ends."""
        with self._settled(self._child("pages", "pages"), url=url, count=count, **more) as pages:
            yield pages

    @contextlib.contextmanager
    def direct(self, *, car: Child | None = None, **more: Any) -> Iterator[Child]:
        """Clients straight on the car's bridge, until the block ends."""
        car = car or self.car
        child = self._child("direct", "direct")
        with self._settled(child, url=car.hello["url"], topics=car.hello["topics"], **more) as direct:
            yield direct

    @contextlib.contextmanager
    def apart(self) -> Iterator[None]:
        """Until the block ends the server has a processor of its own, as where phones and the car have theirs."""
        with self.apart_from(self.server):
            yield

    @contextlib.contextmanager
    def apart_from(self, server: Child) -> Iterator[None]:
        """As `apart`, for any server."""
        cores = sorted(os.sched_getaffinity(0))
        others = [child for child in self._children.values() if child is not server]
        server.keep_to(cores[-1:])
        for child in others:
            child.keep_to(cores[:-1] or cores)
        try:
            yield
        finally:
            for child in (server, *others):
                child.keep_to(cores)

    @contextlib.contextmanager
    def relay(self) -> Iterator[Child]:
        """A bare relay between the car and pages, until the block ends."""
        relay = Child("relay", bridge=self.car.hello["url"], topics=self.car.hello["topics"])
        try:
            yield relay
        finally:
            relay.stop()

    @contextlib.contextmanager
    def _settled(self, child: Child, **connect: Any) -> Iterator[Child]:
        try:
            child.ask("connect", **connect)
            time.sleep(self.pace.settle_s)
            yield child
        finally:
            child.ask("leave")

    def _child(self, name: str, module: str, **options: Any) -> Child:
        if name not in self._children:
            child = Child(module, **options)
            self._stack.callback(child.stop)
            self._children[name] = child
        return self._children[name]
