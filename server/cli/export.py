"""`catgraph export`: convert a recording to another format.

With --background it is a server's worker: it runs at low priority, reports progress as lines of JSON, and ends with the
server.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import math
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from types import FrameType
from typing import Any

import orjson

from server.cli.progress import Progress
from server.recording.export.bag_file import COMPRESSIONS
from server.recording.export.clip import AFTER_S, BEFORE_S, LONGEST_S, Window, first_raised_ns, write_clip
from server.recording.export.export_format import ExportRefused, NothingRecorded, Outcome
from server.recording.export.formats import CLIP, FORMATS
from server.recording.read.read import Recording, RecordingUnreadable, open_recording
from server.recording.space import amount, free_at
from server.storage.output_file import Output, output_of, writing
from server.system.page_files import AssetsMissing
from server.system.process_limits import TOO_LARGE, bounded_memory

WHOLE, NOT_ALL, CANNOT = 0, 1, 2
_NICENESS = 10
_EVERY_S = 0.1  # interval of progress lines
_LOOK_EVERY_S = 0.5
MOST_NOTES = 100
LEAVE_FREE = 500_000_000  # bytes on the disk, for the recording that may be going on


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.add_argument(
        "files",
        nargs="+",
        type=Path,
        metavar="FILE",
        help="catgraph recording, ROS 1 bag, ROS 2 bag directory, .mcap or .db3; several files are one recording",
    )
    forms = "; ".join(f"{form.name}: {form.label}, {form.use}" for form in FORMATS.values())
    parser.add_argument(
        "--format", required=True, choices=[*FORMATS, CLIP], help=f"{forms}; {CLIP}: with --at, cut out as it is"
    )
    parser.add_argument("--out", type=Path, metavar="OUT", help="the output file (default: named after the recording)")
    parser.add_argument(
        "--compression",
        choices=COMPRESSIONS,
        default="none",
        help="compression of the chunks of a bag (default: none)",
    )
    parser.add_argument(
        "--without-own", action="store_true", help="leave catgraph's own channels (/catgraph/*) out of a bag"
    )
    parser.add_argument(
        "--at",
        metavar="WHEN",
        help="only the time around a moment: seconds after the beginning, a time such as 2026-06-01T12:00:30Z, "
        "or the name of an alarm, for when it was first raised",
    )
    parser.add_argument("--before", type=_seconds, default=BEFORE_S, metavar="S", help="with --at (default: 30)")
    parser.add_argument("--after", type=_seconds, default=AFTER_S, metavar="S", help="with --at (default: 30)")
    parser.add_argument("--background", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--required", type=Path, help=argparse.SUPPRESS)  # the one of FILE that must be in it
    parser.add_argument("--name", help=argparse.SUPPRESS)  # what the recording is called, where not as its file


def run(args: argparse.Namespace) -> int:
    """0 all of it was written, 1 written, but something of the recording is not in it, 2 nothing was written."""
    if args.background:
        _live_with_the_server()
    speaker: _Lines | _Person = _Lines() if args.background else _Person(args.format)
    try:
        out = _target(args)
        with bounded_memory(), open_recording(args.files, required=args.required) as recording:
            progress = _with_room(out.path, speaker.progress) if args.background else speaker.progress
            outcome = _export(recording, args, out, progress)
            is_whole = not recording.damage
    except (RecordingUnreadable, ExportRefused, AssetsMissing, _Impossible) as error:
        return speaker.refused(str(error), is_nothing=isinstance(error, NothingRecorded))
    except BrokenPipeError:
        return speaker.refused("It cannot be written: the reader closed the pipe.")
    except OSError as error:
        return speaker.refused(f"It cannot be written: {error.strerror or error}.")
    except MemoryError:
        return speaker.refused(f"{args.files[0]}: {TOO_LARGE}")
    except Exception as error:  # last resort: 1 would mean that something was written
        traceback.print_exc()
        return speaker.refused(f"internal error of catgraph, please report it: {type(error).__name__}: {error}")
    is_whole = is_whole and not outcome.notes
    speaker.done(out, outcome, is_whole=is_whole)
    return WHOLE if is_whole else NOT_ALL


def _with_room(out: Path, progress: Callable[[float], None]) -> Callable[[float], None]:
    """Progress that stops where the disk gets full: an export must not take the room of a recording."""
    next_s = 0.0

    def on_progress(part: float) -> None:
        nonlocal next_s
        now_s = time.monotonic()
        if now_s >= next_s:
            next_s = now_s + _LOOK_EVERY_S
            free = free_at(out.parent)
            if free < LEAVE_FREE:
                raise _Impossible(f"The disk has only {amount(free)} left: there is no room for an export.")
        progress(part)

    return on_progress


class _Impossible(Exception):
    """The request cannot be fulfilled. The text is one sentence."""


def _export(recording: Recording, args: argparse.Namespace, out: Output, progress: Callable[[float], None]) -> Outcome:
    """Whole or not at all: nothing has the name of `out` before it is complete."""
    name = args.name or _stem(args.files[0])
    with writing(out) as new:
        if args.at is None:
            return _write(recording, new, name, args, progress)
        return _cut(recording, new, name, args, progress)


def _cut(
    recording: Recording, new: Path, name: str, args: argparse.Namespace, progress: Callable[[float], None]
) -> Outcome:
    """Cut the time around a moment out as a recording, and convert it to the requested format."""
    clip = new.with_name("clip.mcap")
    window = Window(at_ns=_moment_ns(recording, args.at), before_s=args.before, after_s=args.after)
    share = 1.0 if args.format == CLIP else 0.5
    outcome = write_clip(recording, clip, window, clip_of=name, progress=lambda part: progress(part * share))
    if args.format == CLIP:
        os.rename(clip, new)
        return _with_clock(recording, outcome)
    with open_recording([clip]) as cut:
        made = _write(cut, new, f"{name}, clip", args, lambda part: progress(share + part * (1.0 - share)))
    made.notes[:0] = outcome.notes
    made.notices[:0] = outcome.notices
    return _with_clock(recording, made)


def _write(
    recording: Recording, path: Path, name: str, args: argparse.Namespace, progress: Callable[[float], None]
) -> Outcome:
    form = FORMATS[args.format]
    module, _, function = form.writer.partition(":")
    known: dict[str, Any] = {"compression": args.compression, "with_own": not args.without_own, "name": name}
    options = {option: known[option] for option in form.options}
    unread = [(f"{note.partition(' (')[0]} (", f"{note}.") for note in recording.notes]
    outcome: Outcome = getattr(importlib.import_module(module), function)(recording, path, progress=progress, **options)
    named = tuple(outcome.notes)
    outcome.notes += [note for topic, note in unread if not any(one.startswith(topic) for one in named)]
    return _with_clock(recording, outcome)


def _with_clock(recording: Recording, outcome: Outcome) -> Outcome:
    """The outcome with what was corrected in the times."""
    outcome.notices[:0] = [note for note in recording.clock_notes if note not in outcome.notices]
    return outcome


def _target(args: argparse.Namespace) -> Output:
    """Where to write, found to be writable before the work and not after it."""
    if args.format == CLIP and args.at is None:
        raise _Impossible("--format mcap cuts out the time around a moment: name it with --at.")
    ending = CLIP if args.format == CLIP else FORMATS[args.format].extension
    part = "_clip" if args.at is not None else ""
    out: Path = args.out or Path(f"{_stem(args.files[0])}{part}.{ending}")
    if out.is_dir():
        out = out / f"{_stem(args.files[0])}{part}.{ending}"
    if any(out.exists() and file.exists() and out.samefile(file) for file in args.files):
        raise _Impossible(f"{out} is the recording itself: choose another file with --out.")
    if args.out is None and out.exists():
        raise _Impossible(f"{out} exists already: choose another file with --out.")
    try:
        return output_of(out)
    except OSError as error:
        raise _Impossible(f"{out} cannot be written: {error.strerror or error}.") from None


def _moment_ns(recording: Recording, text: str) -> int:
    """Seconds after the beginning, a time of day, or the name of an alarm."""
    with contextlib.suppress(ValueError):
        seconds = float(text)
        if not math.isfinite(seconds):
            raise _Impossible(f"--at {text}: that is no moment.")
        return round((recording.start_s + seconds) * 1e9)
    with contextlib.suppress(ValueError):
        moment = datetime.fromisoformat(text)
        if moment.tzinfo is None:
            raise _Impossible(f"--at {text}: add the time zone, as {text}Z for UTC.")
        return round((moment - datetime(1970, 1, 1, tzinfo=UTC)).total_seconds() * 1e9)
    found = first_raised_ns(recording, text)
    if found is None:
        raise _Impossible(f"--at {text}: that is no moment, and no alarm of that name is in the recording's log.")
    return found


def _stem(path: Path) -> str:
    name = path.resolve().name
    for ending in (".mcap.writing", ".mcap", ".bag", ".db3", ".mcap.zstd", ".db3.zstd"):
        if name.endswith(ending):
            return name.removesuffix(ending)
    return name


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value <= LONGEST_S:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of seconds from 0 to {LONGEST_S:.0f}")
    return value


class _Person:
    """Reports to a terminal."""

    def __init__(self, what: str) -> None:
        self._bar = Progress(f"Exporting {what}")

    def progress(self, part: float) -> None:
        self._bar(part)

    def refused(self, sentence: str, *, is_nothing: bool = False) -> int:
        self._bar.close()
        print(f"catgraph export: {sentence}", file=sys.stderr)
        return CANNOT

    def done(self, out: Output, outcome: Outcome, *, is_whole: bool) -> None:
        self._bar.close()
        for note in (*outcome.notices, *outcome.notes):
            print(f"catgraph export: {note}", file=sys.stderr)
        if not is_whole:
            print("catgraph export: the export is incomplete.", file=sys.stderr)
        with contextlib.suppress(BrokenPipeError):  # who read the other end of a pipe has seen enough
            size = f" ({amount(out.file.stat().st_size)})" if out.file is not None else ""
            print(f"{out.path}{size}", file=sys.stderr if out.is_stdout else sys.stdout, flush=True)


class _Lines:
    """Reports to a server, as lines of JSON."""

    def __init__(self) -> None:
        self._next_s = 0.0

    def progress(self, part: float) -> None:
        now_s = time.monotonic()
        if now_s >= self._next_s:
            self._next_s = now_s + _EVERY_S
            self._write_line({"progress": round(part, 4)})

    def refused(self, sentence: str, *, is_nothing: bool = False) -> int:
        self._write_line({"refused": f"{sentence[:1].upper()}{sentence[1:]}", "is_nothing": is_nothing})
        return CANNOT

    def done(self, out: Output, outcome: Outcome, *, is_whole: bool) -> None:
        notes = [*outcome.notices, *outcome.notes][:MOST_NOTES]
        self._write_line({"done": str(out.path), "entries": outcome.entries, "notes": notes, "is_whole": is_whole})

    def _write_line(self, what: dict[str, Any]) -> None:
        with contextlib.suppress(BrokenPipeError):
            sys.stdout.write(orjson.dumps(what).decode() + "\n")
            sys.stdout.flush()


def _live_with_the_server() -> None:
    """Steps behind whatever else runs here, and ends with the server: its end of our input is closed then."""
    with contextlib.suppress(OSError):
        os.nice(_NICENESS)
    signal.signal(signal.SIGTERM, _stop)  # unfinished files are deleted at the end

    def wait() -> None:
        while os.read(0, 1):  # not through a buffer: its lock would block the end of Python
            pass
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=wait, daemon=True, name="the server is there").start()


def _stop(number: int, frame: FrameType | None) -> None:
    raise SystemExit(CANNOT)
