"""`catgraph doctor`: what a car publishes, how often, and which signals catgraph derives from it."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import sys
import time
from collections.abc import Mapping
from typing import Any

from server.judge import profiles
from server.judge.reception_stats import Reception
from server.judge.settings import Settings
from server.judge.signals import TOPICS
from server.judge.sources.candidates import follow
from server.judge.sources.choice import Choice, choose
from server.judge.sources.evidence import Evidence
from server.judge.topics import BY_SIGNAL, Source
from server.judge.unit_watch import UnitBasis
from server.rosbridge.address import Address, BadAddress, parse
from server.rosbridge.connection_errors import LOGIN_WANTED, ROSAPI_ENDED, ROSAPI_MISSING, Problem, not_proved
from server.rosbridge.diagnosis import SILENT_S, Diagnosis
from server.rosbridge.link_listener import NOTE
from server.rosbridge.live_source import LinkDown, LiveSource
from server.rosbridge.rosapi_client import Questions
from server.rosbridge.subscription import Subscription
from server.vehicle import discovery
from server.vehicle.open_source import open_source
from server.vehicle.undelivered import BLOCKED_AFTER_S, CLIENT_COUNT, Passing

CONNECT_WITHIN_S = 5.0
MOST_CANDIDATES = 8  # of one signal beside the one that is taken
ROS_SILENT = "DOES NOT ANSWER (get_time); after a restart of roscore restart rosbridge"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "address", help="the car's rosbridge: host, host:port, ws:// or wss://; foxglove:// for a Foxglove server"
    )
    parser.add_argument("--seconds", type=float, default=5.0, help="listening time (default 5)")


def run(args: argparse.Namespace) -> int:
    """Return 0: every report signal is received, 1: something is missing, 2: the car cannot be reached."""
    try:
        address = parse(args.address)
    except BadAddress as why:
        print(f"catgraph: {why} {why.hint}".strip(), file=sys.stderr)
        return 2
    try:
        return asyncio.run(_examine(address, max(0.5, min(args.seconds, 600.0))))
    except KeyboardInterrupt:
        return 130


class _Listener:
    """The receiver of the link for the doctor."""

    def __init__(self) -> None:
        self.opened = asyncio.Event()
        self.decided = asyncio.Event()  # opened, or the first try failed
        self.has_received = asyncio.Event()
        self.problem: Problem | None = None
        self.reception = Reception()
        self.evidence = Evidence()
        self.by_topic: dict[str, tuple[Source, ...]] = {}
        self.basis = UnitBasis(profile=profiles.GENERIC, chosen={})
        self.counts: dict[str, int] = {}
        self.values: dict[str, Any] = {}
        self.client_count: Any = None  # of the bridge, as it last published it
        self.statuses: list[str] = []

    def link_opened(self) -> None:
        self.opened.set()
        self.decided.set()

    def link_closed(self, problem: Problem) -> None:
        self.problem = problem

    def dial_failed(self, problem: Problem) -> None:
        self.problem = problem
        self.decided.set()

    def message_received(self, topic: str, message: Any, note: str | None) -> None:
        self.has_received.set()
        if topic == CLIENT_COUNT:
            self.client_count = message
        self.counts[topic] = self.counts.get(topic, 0) + 1
        self.evidence.receive(topic, message, time.monotonic())
        for source in self.by_topic.get(topic, ()):
            value = self.reception.read(source, message, note) if source.carries else None
            if value is not None:
                value = self.reception.in_unit(source, value, time.monotonic(), self.basis)
            if value is not None:
                self.reception.units.see(source.signal, value, time.monotonic())
                self.values[source.signal] = value

    def status_received(self, level: str, text: str) -> None:
        self.has_received.set()
        self.statuses.append(text if level == NOTE else f"The bridge reports {level}: {text}")

    def junk_received(self, why: str) -> None:
        self.reception.junk(why)

    def large_skipped(self, topic: str | None, size: int) -> None:
        """It is counted among the frames that are no operations."""


async def _examine(address: Address, seconds: float) -> int:
    listener = _Listener()
    link = open_source(address, listener, now=time.monotonic)
    link.start()
    try:
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(listener.decided.wait(), CONNECT_WITHIN_S)
        if not listener.opened.is_set():
            problem = listener.problem
            print(
                f"catgraph: {problem.title} {problem.hint}"
                if problem
                else f"catgraph: {address.shown} does not answer.",
                file=sys.stderr,
            )
            return 2
        return await _report(address, link, listener, seconds)
    except LinkDown:
        print("catgraph: the bridge closed the connection while it was being examined.", file=sys.stderr)
        return 2
    finally:
        link.stop()
        await asyncio.sleep(0)


def _cannot(problem: Problem | None) -> int:
    if problem is not None:
        print(f"catgraph: {problem.title} {problem.hint}", file=sys.stderr)
    return 2


async def _report(address: Address, link: LiveSource, listener: _Listener, seconds: float) -> int:
    diagnosis = Diagnosis()
    questions = Questions(link, diagnosis, now=time.monotonic)
    try:
        return await _discover_and_report(address, link, listener, questions, diagnosis, seconds)
    finally:
        questions.stop()


async def _discover_and_report(
    address: Address, link: LiveSource, listener: _Listener, questions: Questions, diagnosis: Diagnosis, seconds: float
) -> int:
    server_software = link.server_software
    began_s = time.monotonic()
    offer = await discovery.fetch_topics(questions)
    alive = await discovery.fetch_alive(questions)
    if questions.login is not None or (listener.problem is not None and listener.problem.code == LOGIN_WANTED):
        return _cannot(questions.login or listener.problem)
    if not alive:
        while (wait_s := began_s + SILENT_S + 0.2 - time.monotonic()) > 0 and not alive:
            await asyncio.sleep(min(wait_s, 0.5))  # ROS 2 finds rosapi a little later; an answer may be late
            alive = await discovery.fetch_alive(questions)
        offer = offer or (await discovery.fetch_topics(questions) if alive else None)
    behind = diagnosis.problem(time.monotonic(), flows=False)
    if offer is None and not diagnosis.is_rosbridge and not listener.has_received.is_set():
        return _cannot(not_proved(address, server_software, link.junk_count))
    if behind is not None and behind not in (ROSAPI_MISSING, ROSAPI_ENDED) and offer is None:
        return _cannot(behind)
    print(f"{address.server} on {address.shown}: answers" + (f", ROS {offer.ros}" if offer and offer.ros else ""))
    if not address.is_foxglove:  # such a server does not report on ROS
        print(f"ROS behind it: {'answers' if alive else ROS_SILENT}")
    if offer is None:
        problem = behind or ROSAPI_MISSING
        print(f"{problem.title} {problem.hint}")
        return 1
    choice, unpublished = await _map(questions, offer)
    profile = profiles.choose(profiles.load(), offer.topics, offer.ros)
    ratio = Settings().limits(profile).steering.tyre_rad_per_unit
    listener.basis = UnitBasis(profile=profile, chosen={}, tyre_rad_per_unit=ratio)
    listener.by_topic = {}
    for source in (*choice.sources.values(), *(one for found in choice.watched.values() for one in found)):
        listener.by_topic[source.topic] = (*listener.by_topic.get(source.topic, ()), source)
    follow(listener.evidence, offer.topics, {})
    for topic, kind in offer.topics.items():
        mapped = [source for source in listener.by_topic.get(topic, ()) if source.decode is not None]
        cbor = any(BY_SIGNAL[source.signal].compression == "cbor" for source in mapped)
        if mapped or topic == CLIENT_COUNT:
            link.subscribe(
                Subscription(topic=topic, type=kind or None, compression="cbor" if cbor else "none", queue_length=50)
            )
    print(f"Listening for {seconds:g} s …", flush=True)
    await asyncio.sleep(seconds)
    shown = choose(offer.topics, unpublished=unpublished, evidence=listener.evidence)
    not_passed = await _not_passed(offer, choice.sources, listener, questions)
    if not_passed is not None:
        print(f"{not_passed.title} {not_passed.hint}")
    return _print(address, offer, shown, listener, seconds)


async def _map(questions: Questions, offer: discovery.Offer) -> tuple[Choice, set[str]]:
    """The topic of each signal, of those that a node publishes; and the topics that none does."""
    published: set[str] = set()
    unpublished: set[str] = set()
    while True:
        choice = choose(offer.topics, unpublished=unpublished)
        watched = {one.topic for found in choice.watched.values() for one in found}
        unknown = {source.topic for source in choice.sources.values()} | watched
        unknown -= published | unpublished
        if not unknown:
            return choice, unpublished
        for topic in sorted(unknown):
            nodes = await discovery.fetch_publishers(questions, topic, and_bridge=True)
            (unpublished if nodes == () else published).add(topic)


async def _not_passed(
    offer: discovery.Offer, sources: Mapping[str, Source], listener: _Listener, questions: Questions
) -> Problem | None:
    """Why topics of signals that have a publisher do not come through the bridge; None: they do, or it is not known."""
    silent = [topic for topic in {source.topic for source in sources.values()} if not listener.counts.get(topic)]
    published = [topic for topic in silent if await discovery.fetch_publishers(questions, topic)]
    passing = Passing()
    passing.follow(published, 0.0)
    passing.counted(listener.client_count)
    passing.bridges = frozenset(await discovery.fetch_publishers(questions, CLIENT_COUNT, and_bridge=True) or ())
    for topic in published if passing.bridges else ():
        passing.answered(topic, await discovery.fetch_subscribers(questions, topic), 0.0)
    return passing.problem(BLOCKED_AFTER_S)


def _print(address: Address, offer: discovery.Offer, choice: Choice, listener: _Listener, seconds: float) -> int:
    missing, sources = [], choice.sources
    print(f"\n{'signal':<14}{'topic':<46}{'type':<34}{'rate':>9}")
    for row in TOPICS:
        source = sources.get(row.signal)
        if row.signal in choice.undecided:
            print(f"{row.signal:<14}{'not chosen: ' + choice.undecided[row.signal]}")
            _print_candidates(choice, row.signal, None)
            missing.append(row.signal)
            continue
        if source is None:
            print(f"{row.signal:<14}{'not published':<46}{row.expected_type + ' looked for':<34}")
            missing.append(row.signal)
            continue
        count = listener.counts.get(source.topic, 0)
        rate = f"{count / seconds:.1f} Hz" if count else "silent"
        print(f"{row.signal:<14}{source.topic:<46}{source.type or 'unknown':<34}{rate:>9}")
        tally = listener.reception.by_signal.get(row.signal)
        if source.why:
            print(f"{'':<14}why: {source.why}")
        if source.note:
            print(f"{'':<14}{source.note}")
        if (unit := _unit(listener, source)) is not None:
            print(f"{'':<14}{unit}")
        _print_candidates(choice, row.signal, source.topic)
        if tally is not None and tally.rejected:
            print(f"{'':<14}{tally.rejected} of {tally.received} rejected: {tally.last_reason}")
        if tally is not None and tally.not_measured:
            why = tally.why_not_measured or "not measured"
            print(f"{'':<14}{tally.not_measured} of {tally.received}: {why}")
        is_empty = tally is not None and tally.rejected + tally.not_measured == tally.received
        if not count or source.decode is None or is_empty:
            missing.append(row.signal)
    others = sorted(set(offer.topics) - {source.topic for source in sources.values()})
    print(f"\n{len(others)} other topics" + (":" if others else ""))
    for topic in others:
        print(f"  {topic:<44}{offer.topics[topic]}")
    for text in listener.statuses[:10]:
        print(text)
    if listener.reception.frames.rejected:
        print(f"{listener.reception.frames.rejected} frames could not be read: {listener.reception.frames.last_reason}")
    for question in choice.questions:
        print(f"To choose, in Settings or on Signals: {question['words']}")
    needed = [signal for signal in missing if signal in REPORT_SIGNALS]
    optional = [signal for signal in missing if signal not in REPORT_SIGNALS]
    print(f"\n{'Missing or silent: ' + ', '.join(needed) if needed else 'All required signals are present.'}")
    if optional:
        print(f"Missing and optional: {', '.join(optional)}")
    print(
        f"{address.server} has no login: everyone on this network can read this car and command it. "
        "docs/safety.md explains how to restrict it."
    )
    return 1 if needed else 0


def _print_candidates(choice: Choice, signal: str, taken: str | None) -> None:
    """The other topics that may carry a signal, and what is known of each."""
    others = [(topic, why) for topic, why in choice.reasons.get(signal, {}).items() if topic != taken]
    for topic, why in others[:MOST_CANDIDATES]:
        print(f"{'':<14}or: {topic}{f' ({why})' if why else ''}")
    if len(others) > MOST_CANDIDATES:
        print(f"{'':<14}and {len(others) - MOST_CANDIDATES} more")


def _unit(listener: _Listener, source: Source) -> str | None:
    """In which unit a topic is published; None: nothing came, or there is no doubt of it, or it is unknown, which is
    the reason why its messages are not measured."""
    decision = listener.reception.units.decision(source.signal, source.topic)
    if decision is None or decision.unit is None:
        return None
    return f"published in {decision.unit.label}, {decision.why}"


REPORT_SIGNALS = ("speed", "brake", "accelerator", "steering", "distance", "bearing", "position", "scan", "diagnostics")
