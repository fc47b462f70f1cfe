"""`catgraph doctor`: what a car publishes, how often, and which signals catgraph makes of it."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import sys
import time
from typing import Any

from server import discovery
from server.address import Address, BadAddress, parse
from server.link import LinkDown, RosLink, Subscription
from server.problems import Problem, not_rosbridge
from server.reception import Reception
from server.topics import BY_SIGNAL, TOPICS, Source, map_signals

CONNECT_WITHIN_S = 5.0
ROS_SILENT = "DOES NOT ANSWER (get_time); after a restart of roscore restart rosbridge"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("address", help="the car's rosbridge: host, host:port, ws:// or wss://")
    parser.add_argument("--seconds", type=float, default=5.0, help="how long to listen (default 5)")


def run(args: argparse.Namespace) -> int:
    """0: every report signal is there and speaks; 1: something is missing; 2: the car cannot be reached."""
    try:
        address = parse(args.address)
    except BadAddress as why:
        print(f"catgraph: {why} {why.hint}".strip(), file=sys.stderr)
        return 2
    try:
        return asyncio.run(_examine(address, max(0.5, min(args.seconds, 600.0))))
    except KeyboardInterrupt:
        return 130


class _Ear:
    """Listens to the link for the doctor."""

    def __init__(self) -> None:
        self.opened = asyncio.Event()
        self.decided = asyncio.Event()  # opened, or the first try failed
        self.spoke = asyncio.Event()
        self.problem: Problem | None = None
        self.reception = Reception()
        self.by_topic: dict[str, tuple[Source, ...]] = {}
        self.counts: dict[str, int] = {}
        self.values: dict[str, Any] = {}
        self.words: list[str] = []

    def link_opened(self) -> None:
        self.opened.set()
        self.decided.set()

    def link_closed(self, problem: Problem) -> None:
        self.problem = problem

    def dial_failed(self, problem: Problem) -> None:
        self.problem = problem
        self.decided.set()

    def message_received(self, topic: str, message: Any, note: str | None) -> None:
        self.spoke.set()
        self.counts[topic] = self.counts.get(topic, 0) + 1
        for source in self.by_topic.get(topic, ()):
            value = self.reception.read(source, message, note)
            if value is not None:
                self.values[source.signal] = value

    def status_received(self, level: str, text: str) -> None:
        self.spoke.set()
        self.words.append(f"{level}: {text}")

    def junk_received(self, why: str) -> None:
        self.reception.junk(why)


async def _examine(address: Address, seconds: float) -> int:
    ear = _Ear()
    link = RosLink(address, ear, now=time.monotonic)
    link.start()
    try:
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(ear.decided.wait(), CONNECT_WITHIN_S)
        if not ear.opened.is_set():
            problem = ear.problem
            print(
                f"catgraph: {problem.title} {problem.hint}"
                if problem
                else f"catgraph: {address.shown} does not answer.",
                file=sys.stderr,
            )
            return 2
        return await _report(address, link, ear, seconds)
    except LinkDown:
        print("catgraph: the bridge closed the connection while it was being examined.", file=sys.stderr)
        return 2
    finally:
        link.stop()
        await asyncio.sleep(0)


async def _report(address: Address, link: RosLink, ear: _Ear, seconds: float) -> int:
    offer = await discovery.ask_topics(link)
    alive = await discovery.ask_alive(link)
    if offer is None and not alive and not ear.spoke.is_set():
        problem = not_rosbridge(address, "It speaks WebSocket and answers nothing that rosbridge would.")
        print(f"catgraph: {problem.title} {problem.hint}", file=sys.stderr)
        return 2
    print(f"rosbridge on {address.shown}: answers" + (f", ROS {offer.ros}" if offer and offer.ros else ""))
    print(f"ROS behind it: {'answers' if alive else ROS_SILENT}")
    if offer is None:
        print("It has no rosapi: topics and types cannot be asked for. Start rosapi beside rosbridge.")
        return 1
    sources = map_signals(offer.topics)
    ear.by_topic = {}
    for source in sources.values():
        ear.by_topic[source.topic] = (*ear.by_topic.get(source.topic, ()), source)
    for topic, kind in offer.topics.items():
        mapped = ear.by_topic.get(topic, ())
        cbor = any(BY_SIGNAL[source.signal].compression == "cbor" for source in mapped)
        if mapped:
            link.subscribe(
                Subscription(topic=topic, type=kind or None, compression="cbor" if cbor else "none", queue_length=50)
            )
    print(f"Listening for {seconds:g} s …", flush=True)
    await asyncio.sleep(seconds)
    return _print(offer, sources, ear, seconds)


def _print(offer: discovery.Offer, sources: dict[str, Source], ear: _Ear, seconds: float) -> int:
    missing = []
    print(f"\n{'signal':<14}{'topic':<46}{'type':<34}{'rate':>9}")
    for row in TOPICS:
        source = sources.get(row.signal)
        if source is None:
            print(f"{row.signal:<14}{'not published':<46}{row.expected_type + ' looked for':<34}")
            missing.append(row.signal)
            continue
        count = ear.counts.get(source.topic, 0)
        rate = f"{count / seconds:.1f} Hz" if count else "silent"
        print(f"{row.signal:<14}{source.topic:<46}{source.type or 'unknown':<34}{rate:>9}")
        tally = ear.reception.by_signal.get(row.signal)
        if source.note:
            print(f"{'':<14}{source.note}")
        if tally is not None and tally.rejected:
            print(f"{'':<14}{tally.rejected} of {tally.received} rejected: {tally.last_reason}")
        if not count or source.decode is None or (tally is not None and tally.rejected == tally.received):
            missing.append(row.signal)
    others = sorted(set(offer.topics) - {source.topic for source in sources.values()})
    print(f"\n{len(others)} other topics" + (":" if others else ""))
    for topic in others:
        print(f"  {topic:<44}{offer.topics[topic]}")
    for words in ear.words[:10]:
        print(f"The bridge says {words}")
    if ear.reception.frames.rejected:
        print(
            f"{ear.reception.frames.rejected} frames were no rosbridge operations: {ear.reception.frames.last_reason}"
        )
    needed = [signal for signal in missing if signal in REPORT_SIGNALS]
    print(f"\n{'Missing or silent: ' + ', '.join(needed) if needed else 'Every signal of the page is there.'}")
    print(
        "rosbridge asks nobody who they are: everyone on this network can read this car and command it. "
        "docs/safety.md says how to close it."
    )
    return 1 if needed else 0


REPORT_SIGNALS = ("speed", "brake", "accelerator", "steering", "distance", "bearing", "position", "scan", "diagnostics")
