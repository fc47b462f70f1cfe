"""What agents, a broker and a web node cost a car and a page, at so many of each, and what they would cost at more."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import statistics
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import psutil

from server.web.hub import MAX_PAGES
from tests.bench.child import Child
from tests.bench.line import Line, fitted
from tests.bench.program import Program, Use, used
from tests.bench.rig import Rig
from tests.bench.table import Group, Row

BROKER_PERCENT = 10.0  # at 100 cars
HOME_PERCENT = 0.4  # of a core, each page
FLEET_PERCENT = 0.05
PAGE_KB = 150.0
LATER_CARS, LATER_PAGES, LATER_NODES = 1000, 10_000, 3
RECORD_S = 8.0
SERVED = 0.8  # of the states that the fewest pages got


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """Processes at so many cars and pages; `watched`: cars whose Home is open; `hz`: frames a second a page got."""

    cars: int
    pages: int
    watched: int = 0
    hz: float = 0.0
    machine: float = 0.0  # of all processors together, per cent
    uses: Mapping[str, Use] = dataclasses.field(default_factory=dict)

    @property
    def frames(self) -> float:
        """That all pages together got in a second; fewer than they want where the machine is out of processor."""
        return self.pages * self.hz

    def share(self, of: str) -> float:
        return self.uses[of].share


class Fleet:
    """A broker, the load process, the pages, and the web node of the moment."""

    def __init__(self, rig: Rig, up: contextlib.ExitStack) -> None:
        self._rig = rig
        self._up = up
        self.broker = self._child("broker")
        self._cars = self._child("many_cars", broker=self.broker.hello["address"])
        self._pages = self._child("pages")
        self.tape: dict[str, float] = {}  # of the agent that was recorded: sizes and rates

    def _child(self, module: str, **options: object) -> Child:
        started = Child(module, **options)
        self._up.callback(started.stop)
        return started

    def agents(self, count: int) -> Point:
        """So many real agents, each at the same car, watched by one page of all cars."""
        with contextlib.ExitStack() as up:
            pids = {}
            for k in range(count):
                agent = self._program(up, "agent", "--vehicle", f"real{k}={self._rig.car.hello['url']}")
                pids[f"agent {k}"] = agent.pid
            with self.node() as node:
                point = self.fleet_pages(node, count, 1, **pids)
                if not self.tape:
                    self.tape = self._cars.ask("record", vehicle="real0", for_s=min(RECORD_S, 3 * self._rig.pace.use_s))
        return point

    @contextlib.contextmanager
    def node(self) -> Iterator[Program]:
        """A web node that has served nobody."""
        with contextlib.ExitStack() as up:
            try:
                yield self._program(up, "web")
            finally:
                self._pages.ask("leave")

    def _program(self, up: contextlib.ExitStack, command: str, *arguments: str) -> Program:
        started = Program(command, "--broker", self.broker.hello["address"], *arguments)
        up.callback(started.stop)
        return started

    def grow(self, count: int) -> list[str]:
        names: list[str] = self._cars.ask("grow", count=count)
        return names

    def fleet_pages(self, node: Program, cars: int, pages: int, **more: int) -> Point:
        """So many pages of all cars at the node."""
        self._pages.ask("open_fleet", url=node.url, cars=cars, count=pages)
        return self._measured(Point(cars=cars, pages=pages), "lists", {"node": node.pid, **more})

    def home_pages(self, node: Program, names: Sequence[str], cars: int, pages: int) -> Point:
        """So many pages on Home of these of the cars."""
        self._pages.ask("open", url=node.url, vehicles=list(names), count=pages)
        point = Point(cars=cars, pages=pages, watched=min(pages, len(names)))
        return self._measured(point, "states", {"node": node.pid})

    def leave(self) -> None:
        self._pages.ask("leave")

    def _measured(self, point: Point, frames: str, pids: Mapping[str, int]) -> Point:
        time.sleep(self._rig.pace.use_s / 4)
        self._pages.ask("begin")
        psutil.cpu_percent()
        uses = used({"broker": self.broker.hello["pid"], **pids}, self._rig.pace.use_s)
        machine, report = psutil.cpu_percent(), self._pages.ask("report")
        hz = statistics.median(report[frames]) / report["seconds"]
        return dataclasses.replace(point, uses=uses, machine=machine, hz=hz)


def measure(rig: Rig) -> Group:
    """Real agents first, of which one is recorded; then so many cars and so many pages of its record."""
    pace = rig.pace
    least, few, most = pace.cars[0], pace.cars[len(pace.cars) // 3], pace.cars[-1]
    with contextlib.ExitStack() as up:
        fleet = Fleet(rig, up)
        agents = [fleet.agents(count) for count in pace.agents]
        with fleet.node() as node:
            cars = [
                fleet.fleet_pages(node, len(fleet.grow(count)), 1) for count in pace.cars[: pace.cars.index(few) + 1]
            ]
        names = fleet.grow(few)
        with fleet.node() as node:
            home = [fleet.home_pages(node, names, few, pages) for pages in pace.watchers]
            fleet.leave()
            home += [fleet.home_pages(node, names[:least], few, pages) for pages in pace.watchers[:-1]]
        with fleet.node() as node:
            cars += [
                fleet.fleet_pages(node, len(fleet.grow(count)), 1) for count in pace.cars[pace.cars.index(few) + 1 :]
            ]
            all_cars = [fleet.fleet_pages(node, most, pages) for pages in pace.watchers]
            fleet.leave()
            crowded = [fleet.home_pages(node, names, most, pages) for pages in pace.watchers[:-1]]
    found = Found(agents=agents, cars=cars, home=home, crowded=crowded, all_cars=all_cars)
    tape = fleet.tape
    return Group(
        name="many",
        title="Many cars and many pages, through a broker",
        rows=tuple(found.rows()),
        notes=(
            f"{' and '.join(map(str, pace.agents))} real agents at one car; all other cars are one process that plays"
            " what a real agent stated, by the product's own agent side; broker, web node and pages are real",
            f"a state of {tape['state_bytes']:.0f} B {tape['state_hz']:.1f} times a second, a summary of"
            f" {tape['summary_bytes']:.0f} B {tape['summary_hz']:.1f} times",
            f"each point {pace.use_s:g} s; memory: PSS; this machine's processors were busy to {found.busiest:.0f} % at"
            " most; a page of the lines gets as many frames as each of the fewest pages did",
            *found.later(),
        ),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """All points, and the lines through them."""

    agents: list[Point]
    cars: list[Point]  # one page of all cars
    home: list[Point]  # at few cars
    crowded: list[Point]  # Home, at most cars
    all_cars: list[Point]  # pages of all cars, at most cars

    @property
    def fresh(self) -> list[Point]:
        """Those whose node had not served more pages before: it gives no memory back."""
        return self.home[: len(self.all_cars)] + self.all_cars

    @property
    def busiest(self) -> float:
        return max(p.machine for p in (*self.agents, *self.cars, *self.home, *self.crowded, *self.all_cars))

    def rows(self) -> Iterator[Row]:
        for point in self.agents:
            uses = [use for name, use in point.uses.items() if name.startswith("agent")]
            what = f"agent, each of {point.cars}"
            yield _percent(what, statistics.mean(use.share for use in uses), digits=1)
            yield _mb(what, statistics.mean(use.memory_mb for use in uses))
        for part in ("broker", "node"):
            for point in self.cars:
                what = f"{part}, {point.cars} cars, 1 page of all"
                is_most = part == "broker" and point is self.cars[-1]
                yield _percent(what, point.share(part), reach=BROKER_PERCENT if is_most else None)
                yield _mb(what, point.uses[part].memory_mb)
            yield from _line_rows(part, "car", self.by_car(part))
        yield from self._pages_of("Home", self.home + self.crowded)
        yield _percent("node, each page on Home", self.by_home.each[1], reach=HOME_PERCENT, digits=3)
        yield _percent("  each car that is watched", self.by_home.each[0], digits=3)
        yield _percent("  off the line", self.by_home.residual)
        if self.is_crowd_served:
            yield _percent(f"node, each page on Home, {self.crowded[0].cars} cars", self.by_crowded.each[0], digits=3)
        yield _kb("node, each page on Home", _by_memory([p for p in self.home if p in self.fresh]))
        yield from self._pages_of("all cars", self.all_cars)
        yield _percent("node, each page of all cars", self.by_all_cars.each[0], reach=FLEET_PERCENT, digits=3)
        yield _percent("  off the line", self.by_all_cars.residual)
        yield _kb("node, each page of all cars", _by_memory(self.all_cars))

    def _pages_of(self, kind: str, points: Sequence[Point]) -> Iterator[Row]:
        for p in points:
            cars = f"{p.cars} cars" if not p.watched else f"{p.watched} of {p.cars} cars"
            what = f"node, {p.pages} pages, {kind}, {cars}"
            yield _percent(what, p.share("node"), digits=1)
            if p in self.fresh:
                yield _mb(what, p.uses["node"].memory_mb)
            yield Row(what=f"{what}: each got", unit="frames/s", catgraph=p.hz, digits=1)

    def by_car(self, part: str) -> Line:
        return fitted([((p.cars,), p.share(part)) for p in self.cars])

    @property
    def by_home(self) -> Line:
        """By cars that are watched, and by pages that get all frames."""
        return _by_pages(self.home, *((p.watched,) for p in self.home))

    @property
    def by_crowded(self) -> Line:
        return _by_pages(self.crowded)

    @property
    def is_crowd_served(self) -> bool:
        """Else its states do not show what a page costs: the long lists came and the states did not."""
        return min(p.hz for p in self.crowded) > SERVED * self.crowded[0].hz

    @property
    def by_all_cars(self) -> Line:
        return _by_pages(self.all_cars)

    def later(self) -> Iterator[str]:
        """The extrapolation to many more cars and pages; each sentence with its assumptions."""
        node, broker, pages = self.by_car("node"), self.by_car("broker"), LATER_PAGES / LATER_NODES
        summaries = node.at(LATER_CARS)
        a_car, a_page = self.by_home.each
        home = summaries + a_car * LATER_CARS + a_page * pages
        ours, more = self.crowded[0].cars, max(0.0, self.by_crowded.each[0] - a_page)
        listed = more / max(1, ours - self.home[0].cars) * (LATER_CARS - self.home[0].cars) * pages
        with_list = (
            f"{(home + listed) / 100:.1f}" if self.is_crowd_served else "an unknown number (it was out of processor)"
        )
        whole = summaries + self.by_all_cars.each[0] * LATER_CARS / self.all_cars[0].cars * pages
        yield (
            f"extrapolated to {LATER_CARS} cars and {LATER_PAGES} pages on {LATER_NODES} nodes, if all stays linear:"
            f" broker {LATER_NODES * broker.each[0] * LATER_CARS + broker.base:.0f} % of a core, as each node pulls"
            f" each car's summary; a node {summaries / 100:.1f} cores for the summaries, {home / 100:.1f} with its"
            f" {pages:.0f} pages on Home of all cars, {with_list} with the list of cars that they get"
            f" as well, {whole / 100:.1f} with as many pages of all cars"
        )
        yield (
            f"a web node is one process, which uses one core, and takes {MAX_PAGES} pages at most: for"
            f" {LATER_PAGES} pages there are {math.ceil(LATER_PAGES / MAX_PAGES)} nodes at least"
        )


def _by_pages(points: Sequence[Point], *others: tuple[float, ...]) -> Line:
    """The node's processor by what `others` has of each point, and by pages.

    A page is as many frames as each got where there were the fewest pages: where the machine is out of processor, each
    page gets fewer and costs less.
    """
    counts = [(*other, p.frames / points[0].hz) for p, other in zip(points, others or [()] * len(points), strict=True)]
    return fitted([(count, p.share("node")) for count, p in zip(counts, points, strict=True)])


def _by_memory(points: Sequence[Point]) -> float:
    """kB of the node's memory a page."""
    return 1000 * fitted([((p.pages,), p.uses["node"].memory_mb) for p in points]).each[0]


def _line_rows(part: str, of: str, line: Line) -> Iterator[Row]:
    yield _percent(f"{part}, each {of}", line.each[0], digits=3)
    yield _percent("  off the line", line.residual)


def _percent(what: str, figure: float, *, reach: float | None = None, digits: int = 2) -> Row:
    return Row(what=what, unit="% of a core", catgraph=figure, reach=reach, digits=digits)


def _mb(what: str, figure: float) -> Row:
    return Row(what=what, unit="MB", catgraph=figure, digits=1)


def _kb(what: str, figure: float) -> Row:
    return Row(what=what, unit="kB", catgraph=figure, reach=PAGE_KB, digits=0)
