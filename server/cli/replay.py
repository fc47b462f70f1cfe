"""`catgraph replay`: play a recording behind a rosbridge server, in real time."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import gc
import math
import signal
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import uvloop

from server.judge.message import Message
from server.judge.ros_names import BadName, canonical_name, canonical_type
from server.recording.read.read import Recording, RecordingUnreadable, open_recording
from server.rosbridge_server.player import moved, play
from server.rosbridge_server.server import CannotListen, RosBridge
from server.system.process_limits import TOO_LARGE, bounded_memory

SETTLED_S = 1.0  # --wait: so long without a new subscription
AHEAD = 512  # messages read before they are due: unpacking a chunk must not make others late
LAST_BYTES_S = 10.0  # clients may take so long to fetch the end
SHORTEST_ROUND_S = 0.1  # --loop over a recording without length


class Report:
    """Prints the start text, the progress and the result."""

    def __init__(self, recording: Recording, bridge: RosBridge) -> None:
        self._recording = recording
        self._bridge = bridge
        self._played = 0
        self._at_s = 0.0  # place in the recording
        self._began_s: float | None = None  # on the monotonic clock

    def open(self, args: argparse.Namespace, names: Mapping[str, str], port: int) -> None:
        """Prints what comes; `names`: recorded topic → topic published."""
        recording = self._recording
        when = datetime.fromtimestamp(recording.start_s, UTC)
        say(f"Replaying {', '.join(str(file) for file in args.files)}")
        say(
            f"  ROS {recording.ros_version}, recorded {when:%Y-%m-%d %H:%M:%S} UTC, {recording.duration_s:.1f} s, "
            f"{_counted(recording.count, 'message')} on {_counted(len(recording.topics), 'topic')}"
            + (f", at {args.rate:g}× real time" if args.rate != 1 else "")
            + (f", from {args.start:g} s on" if args.start else "")
        )
        rows = [
            (name + (f" (was {topic})" if name != topic else ""), recording.topics[topic])
            for topic, name in sorted(names.items())
        ]
        widths = max(len(name) for name, _ in rows), max(len(info.type) for _, info in rows)
        for name, info in rows:
            say(f"  {name:{widths[0]}}  {info.type:{widths[1]}}  {_grouped(info.count):>9}")
        for note in recording.notes:
            say(f"  Note: {note}")
        host = f"[{args.host}]" if ":" in args.host else args.host
        say(f"rosbridge at ws://{host}:{port}")

    def begin(self) -> None:
        """Playing begins now."""
        self._began_s = time.monotonic()

    def note(self, message: Message) -> None:
        """A message was played."""
        self._played += 1
        self._at_s = message.at_s - self._recording.start_s

    async def show_progress(self) -> None:
        """Prints how far it is, again and again, until cancelled."""
        is_terminal = sys.stdout.isatty()
        while True:
            await asyncio.sleep(1.0 if is_terminal else 10.0)
            line = (
                f"  {self._at_s:7.1f} s of {self._recording.duration_s:.1f} s · {_grouped(self._played)} messages · "
                f"{_counted(self._bridge.clients, 'client')} · {_grouped(self._bridge.dropped)} dropped"
            )
            say(f"\r{line} " if is_terminal else line, end="" if is_terminal else "\n")

    def close(self) -> None:
        """Prints what became of it."""
        took_s = time.monotonic() - self._began_s if self._began_s is not None else 0.0
        if sys.stdout.isatty():
            say("\r", end="")
        fate = f"{_grouped(self._bridge.sent)} sent to clients, {_grouped(self._bridge.dropped)} dropped"
        say(f"Played {_counted(self._played, 'message')} in {took_s:.1f} s: {fate}.")
        for topic, count in sorted(self._recording.rejected.items()):
            why = self._recording.why_rejected[topic]
            what = f"{_counted(count, 'message')} on {topic}"
            say(f"  Note: {what} could not be decoded for clients of JSON, CBOR or png: {why}")
        for sentence in self._recording.damage:
            say(f"  Note: {sentence}")


def say(text: str, end: str = "\n") -> None:
    with contextlib.suppress(BrokenPipeError):  # who listened at the other end of a pipe has gone: play on
        print(text, end=end, flush=True)


def _grouped(number: int) -> str:
    return f"{number:,}".replace(",", " ")


def _counted(number: int, what: str) -> str:
    return f"{_grouped(number)} {what}{'' if number == 1 else 's'}"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.add_argument(
        "files", nargs="+", type=Path, metavar="FILE", help="ROS 1 bag, ROS 2 bag directory, .mcap, .db3"
    )
    parser.add_argument(
        "--host", default="127.0.0.1", help="address to listen on; 0.0.0.0 for all (default: %(default)s)"
    )
    parser.add_argument("--port", type=int, default=9090, help="port, 0 for any free one (default: %(default)s)")
    parser.add_argument("--rate", type=_rate, default=1.0, metavar="X", help="playback rate (default: 1)")
    parser.add_argument("--start", type=_seconds, default=0.0, metavar="S", help="start S seconds after the beginning")
    parser.add_argument("--loop", action="store_true", help="repeat until interrupted")
    parser.add_argument(
        "--remap",
        type=_remap,
        action="append",
        default=[],
        metavar="A:=B",
        help="publish topic A as B; can be repeated",
    )
    parser.add_argument(
        "--wait", action="store_true", help="start when a client has subscribed, so that it receives every message"
    )
    parser.add_argument("--stay", action="store_true", help="keep the bridge running after the end, until interrupted")


def run(args: argparse.Namespace) -> int:
    """Plays the recording: 0 at its end, 2 with one sentence where it cannot be played, 130 when interrupted."""
    try:
        with bounded_memory(), open_recording(args.files) as recording:
            return uvloop.run(_Replay(recording, args).run())
    except (RecordingUnreadable, CannotListen, _Impossible) as error:
        print(f"catgraph replay: {error}", file=sys.stderr)
        return 2
    except MemoryError:
        print(f"catgraph replay: {args.files[0]}: {TOO_LARGE}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130


class _Impossible(Exception):
    """The recording cannot be played. The text is one sentence."""


class _Replay:
    def __init__(self, recording: Recording, args: argparse.Namespace) -> None:
        self._recording = recording
        self._args = args
        self._bridge = RosBridge(ros_version=recording.ros_version, node="/replay")
        self._names = _renamed(recording, dict(args.remap))
        self._report = Report(recording, self._bridge)
        self._subscribed = asyncio.Event()  # a client subscribed to something
        if not any(recording.topics[topic].count for topic in self._names):
            raise _Impossible(f"{args.files[0]} has no playable messages")
        if args.start > recording.duration_s:
            raise _Impossible(
                f"--start {args.start:g} is after the end: the recording has {recording.duration_s:.1f} s"
            )

    async def run(self) -> int:
        interrupted = asyncio.get_running_loop().create_future()
        for number in (signal.SIGINT, signal.SIGTERM):
            asyncio.get_running_loop().add_signal_handler(number, _settle, interrupted, 128 + number)
        for topic, name in self._names.items():
            info = self._recording.topics[topic]
            self._bridge.advertise(name, info.type, info.definition, latch=info.is_latched)
        self._bridge.advertise_rosout()
        self._bridge.on_subscribe.append(lambda _: self._subscribed.set())
        port = await self._bridge.start(self._args.host, self._args.port)
        self._report.open(self._args, self._names, port)
        playing, progress = asyncio.ensure_future(self._play()), asyncio.ensure_future(self._report.show_progress())
        try:
            await asyncio.wait({playing, interrupted}, return_when=asyncio.FIRST_COMPLETED)
            code = 0 if playing.done() else int(interrupted.result())
            if playing.done():
                playing.result()  # raises what went wrong
                if not await self._bridge.drain(LAST_BYTES_S):
                    print("catgraph replay: a client did not receive the last messages in time", file=sys.stderr)
        finally:
            for task in (playing, progress):
                task.cancel()
            await asyncio.wait({playing, progress})
            self._report.close()
            if self._args.stay and not interrupted.done() and _is_well(playing):
                say("The bridge runs until interrupted (Ctrl-C).")
                code = int(await interrupted)
            await self._bridge.stop()
        return code

    async def _play(self) -> None:
        if self._args.wait:
            await self._wait_for_subscribers()
        self._report.begin()
        gc.freeze()  # what stays until the end need not be searched again and again
        rounds = Rounds(self._args.rate)
        while True:
            round_ends_s = time.monotonic() + SHORTEST_ROUND_S
            messages = rounds.next(self._messages(), time.monotonic())
            await play(messages, self._bridge, rate=self._args.rate, ahead=AHEAD, on_message=self._report.note)
            if not self._args.loop:
                return
            await asyncio.sleep(max(0.0, round_ends_s - time.monotonic()))

    def _messages(self) -> Iterator[Message]:
        for message in self._recording.raw_messages(self._args.start):
            name = self._names.get(message.topic)
            if name is not None:
                yield message if name == message.topic else replace(message, topic=name)

    async def _wait_for_subscribers(self) -> None:
        say("Waiting for a subscriber …")
        while True:
            self._subscribed.clear()
            if not self._has_subscriber():
                await self._subscribed.wait()
                continue
            try:
                await asyncio.wait_for(self._subscribed.wait(), SETTLED_S)
            except TimeoutError:
                if self._has_subscriber():
                    return

    def _has_subscriber(self) -> bool:
        topics = (self._bridge.graph.find(name) for name in self._names.values())
        return any(topic is not None and topic.subscribers for topic in topics)


class Rounds:
    """Repeat the recording; the stamps of each round continue those of the last, as a car's clock does."""

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._began_s: float | None = None

    def next(self, messages: Iterator[Message], now_s: float) -> Iterator[Message]:
        """The messages of a round that begins now."""
        if self._began_s is None:
            self._began_s = now_s
            return messages
        by_s = (now_s - self._began_s) * self._rate
        return (replace(message, message=moved(message.message, by_s)) for message in messages)


def _renamed(recording: Recording, remap: dict[str, str]) -> dict[str, str]:
    """The name under which each recorded topic is published; topics that no bridge could carry are noted."""
    names: dict[str, str] = {}
    types: dict[str, str] = {}
    for topic, info in recording.topics.items():
        try:
            full = canonical_name(topic)
            canonical_type(info.type, recording.ros_version)
        except BadName as error:
            recording.notes.append(f"{topic!r} ({info.count} messages) is left out: {error}")
            continue
        name = names[topic] = remap.pop(full, full)
        if types.setdefault(name, info.type) != info.type:
            raise _Impossible(f"two topics of different types would both be {name}: {types[name]} and {info.type}")
    if remap:
        raise _Impossible(f"--remap: there is no topic {next(iter(remap))} in the recording")
    return names


def _rate(text: str) -> float:
    value = _number(text)
    if not 0.001 <= value <= 1000.0:
        raise argparse.ArgumentTypeError("must be between 0.001 and 1000")
    return value


def _seconds(text: str) -> float:
    value = _number(text)
    if value < 0.0:
        raise argparse.ArgumentTypeError("must be 0 or more")
    return value


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number")
    return value


def _remap(text: str) -> tuple[str, str]:
    old, sign, new = text.partition(":=")
    if not sign:
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form A:=B")
    try:
        return canonical_name(old), canonical_name(new)
    except BadName as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _settle(interrupted: asyncio.Future[int], code: int) -> None:
    if not interrupted.done():
        interrupted.set_result(code)


def _is_well(task: asyncio.Future[None]) -> bool:
    return task.done() and not task.cancelled() and task.exception() is None
