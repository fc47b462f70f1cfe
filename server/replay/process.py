"""The process of one replay: reads and judges outside the server's loop, at lower priority.

Started by `server.replay.manager` only. The first input line has the recording to open; it ends when its input closes.
"""

from __future__ import annotations

import contextlib
import gc
import os
import select
import signal
import sys
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from pathlib import Path
from typing import Any, BinaryIO

import orjson

from server.judge.active_settings import SettingsOverride
from server.recording.read.read import RecordingUnreadable, open_recording
from server.replay.playback import Playback
from server.replay.protocol import Kind, record
from server.replay.timeline import NOTHING, TimelineEvents, read_timeline_events

NICE = 10
MOST_MEMORY = 1536 * 1024 * 1024  # of its own data; a file that needs more is not of a car
FRAME_S = 0.1  # while it runs
REST_S = 0.2  # heartbeat while paused
SCAN_S = 0.05
PORTION_S = 0.03  # of work between two reads of commands
TIMELINE_S = 1.0


def main() -> int:
    """Runs until its input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the terminal's Ctrl-C is for the server, which closes our input
    with contextlib.suppress(OSError):
        os.nice(NICE)
    _limit_memory()
    gc.set_threshold(100_000, 50, 100)  # many short-lived values and hardly a circle
    process = _Process(sys.stdin.buffer, sys.stdout.buffer)
    try:
        return process.run()
    except BrokenPipeError:
        return 0


def _limit_memory() -> None:
    with contextlib.suppress(ImportError, OSError, ValueError):
        import resource

        resource.setrlimit(resource.RLIMIT_DATA, (MOST_MEMORY, MOST_MEMORY))


class _Process:
    def __init__(self, orders: BinaryIO, answers: BinaryIO) -> None:
        self._orders = orders.fileno()
        self._answers = answers
        self._unread = b""
        self._wants_scan = False
        self._scan_key: tuple[int, float] = (-1, -1.0)
        self._sent_s: dict[str, float] = {"state": -1.0, "scan": -1.0, "timeline": -1.0}
        self._timeline_done = False
        self._events = NOTHING
        self._reading: Future[TimelineEvents] | None = None  # of the events; None: not begun
        self._is_urgent = True  # after a command the state is sent at once

    def run(self) -> int:
        opening = self._read_opening()
        if opening is None:
            return 0
        self._names = {
            "vehicle": opening["vehicle"],
            "name": opening["name"],
            "settings_version": opening["settings_version"],
        }
        paths = [Path(opening["path"])]
        try:
            recording = open_recording(paths)
            playback = Playback(
                recording,
                lambda: open_recording(paths),
                settings=opening["settings"],
                choices=SettingsOverride(topics=opening.get("topics", {}), units=opening.get("units", {})),
                now_s=time.monotonic(),
                at_s=opening["at_s"],
                sketch=opening["sketch"],
                trends=opening["trends"],
            )
            with contextlib.closing(playback):
                self._play(playback, lambda: read_timeline_events(lambda: open_recording(paths)))
        except RecordingUnreadable as error:
            text = str(error).replace(str(paths[0]), paths[0].name)  # the path on the server is not disclosed
            self._send_json("failed", {"reason": _sentence(text)})
            return 2
        except MemoryError:
            self._send_json("failed", {"reason": "This recording needs more memory than a replay may use."})
            return 3
        return 0

    def _play(self, playback: Playback, read: Callable[[], TimelineEvents]) -> None:
        while True:
            began_s = time.monotonic()
            playback.work(began_s, _until(began_s + PORTION_S))
            self._show(playback)
            if self._reading is None and not playback.is_seeking:  # after the first picture
                self._reading = _begun(read)
            is_busy = playback.is_seeking or not playback.index.is_done
            due_s = 0.0 if is_busy else max(0.0, began_s + PORTION_S - time.monotonic())
            if not self._run_orders(playback, due_s):
                return

    # -- orders ------------------------------------------------------------------------------------------------------

    def _read_opening(self) -> dict[str, Any] | None:
        while True:
            lines = self._read_lines(None)
            if lines is None:
                return None
            if lines:
                self._unread = b"\n".join([*lines[1:], self._unread])
                opening: dict[str, Any] = orjson.loads(lines[0])
                return opening

    def _read_lines(self, within_s: float | None) -> list[bytes] | None:
        """The orders that came; None: there will be no more."""
        readable, _, _ = select.select([self._orders], [], [], within_s)
        if readable:
            more = os.read(self._orders, 65536)
            if not more:
                return None
            self._unread += more
        *lines, self._unread = self._unread.split(b"\n")
        return lines

    def _run_orders(self, playback: Playback, within_s: float) -> bool:
        lines = self._read_lines(within_s)
        if lines is None:
            return False
        for line in lines:
            order = orjson.loads(line)
            now_s = time.monotonic()
            try:
                answer = self._run_order(playback, order, now_s)
            except ValueError as why:
                answer = {"ok": False, "reason": str(why)}
            if order.get("n") is not None:
                self._send_json("reply", {"n": order["n"], "answer": answer})
        return True

    def _run_order(self, playback: Playback, order: dict[str, Any], now_s: float) -> Mapping[str, Any]:
        self._is_urgent = True
        match order["kind"]:
            case "seek":
                playback.seek(order["at_s"], now_s)
            case "play":
                playback.play(now_s)
            case "pause":
                playback.pause(now_s)
            case "rate":
                playback.set_rate(order["rate"], now_s)
            case "alarm":
                if not playback.step_alarm(order["direction"], now_s):
                    raise ValueError(
                        f"There is no alarm {'after' if order['direction'] > 0 else 'before'} this moment."
                    )
            case "scan":
                self._wants_scan = order["wanted"] is True
                self._scan_key = (-1, -1.0)
            case "pass_gaps":
                playback.passes_gaps = order["wanted"] is True
            case "trends" | "track_points" | "drive_trends" | "check" | "signals":
                self._is_urgent = False
                return playback.answer(order)
        return {"ok": True}

    # -- what is shown -----------------------------------------------------------------------------------------------

    def _show(self, playback: Playback) -> None:
        now_s = time.monotonic()
        is_read = self._reading is not None and self._reading.done()
        if now_s - self._sent_s["timeline"] >= TIMELINE_S and not self._timeline_done:
            if self._reading is not None and is_read:
                self._events = self._reading.result()
            self._timeline_done = playback.index.is_done and is_read
            self._send("timeline", orjson.dumps(playback.timeline(self._events)), now_s)
        every_s = FRAME_S if playback.is_playing or playback.is_seeking else REST_S
        if not self._is_urgent and now_s - self._sent_s["state"] < every_s:
            return self._show_scan(playback, now_s)
        self._is_urgent = playback.is_seeking and self._is_urgent
        if not playback.is_seeking:  # otherwise the old state stays until the sought one is ready
            state = playback.frame(**self._names)
            state["marks"] = sum(flag["at_s"] <= playback.at_s for flag in self._events.flags)
            self._send("state", orjson.dumps(state), now_s)
        self._send("position", orjson.dumps(playback.position()), now_s)
        self._sent_s["state"] = now_s
        self._show_scan(playback, now_s)

    def _show_scan(self, playback: Playback, now_s: float) -> None:
        if not self._wants_scan or playback.is_seeking or now_s - self._sent_s["scan"] < SCAN_S:
            return
        key = (playback.seeks, playback.at_s)
        if key != self._scan_key or now_s - self._sent_s["scan"] >= REST_S:  # a paused one is sent again as a heartbeat
            scan = playback.scan_bytes()
            self._scan_key = key
            self._send("scan", scan if scan is not None else b"", now_s)

    def _send_json(self, kind: Kind, body: dict[str, Any]) -> None:
        self._send(kind, orjson.dumps(body), time.monotonic())

    def _send(self, kind: Kind, payload: bytes, now_s: float) -> None:
        self._sent_s[kind] = now_s
        self._answers.write(record(kind, payload))
        self._answers.flush()


def _until(over_s: float) -> Callable[[], bool]:
    return lambda: time.monotonic() >= over_s


def _begun(read: Callable[[], TimelineEvents]) -> Future[TimelineEvents]:
    """Done beside the replay, by a thread that does not keep the process from its end."""
    reading: Future[TimelineEvents] = Future()
    threading.Thread(target=lambda: reading.set_result(read()), name="recorded events", daemon=True).start()
    return reading


def _sentence(text: str) -> str:
    return text if text.endswith(".") else f"{text}."


if __name__ == "__main__":
    sys.exit(main())
