"""Terminal output of a replay."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import sys
import time
from collections.abc import Mapping
from datetime import UTC, datetime

from server.judge.message import Message
from server.recording.read.read import Recording
from server.rosbridge_server.server import RosBridge


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
            say(f"  Note: {_counted(count, 'message')} on {topic} left out: {why}")
        for sentence in self._recording.damage:
            say(f"  Note: {sentence}")


def say(text: str, end: str = "\n") -> None:
    with contextlib.suppress(BrokenPipeError):  # who listened at the other end of a pipe has gone: play on
        print(text, end=end, flush=True)


def _grouped(number: int) -> str:
    return f"{number:,}".replace(",", " ")


def _counted(number: int, what: str) -> str:
    return f"{_grouped(number)} {what}{'' if number == 1 else 's'}"
