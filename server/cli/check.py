"""`catgraph check`: every check over a recording, faster than it happened."""

from __future__ import annotations

import argparse
import contextlib
import math
import os
import sys
import time
import traceback
from collections.abc import Iterator, Sequence
from pathlib import Path

import orjson

from server.analysis import summary
from server.analysis.as_json import as_json
from server.analysis.faults import CannotInject, Faults
from server.analysis.rehearse import Extract, Rehearsed, rehearse
from server.analysis.report import Report
from server.analysis.thresholds import BadSettingsFile, read_override
from server.cli.progress import Progress
from server.judge.settings import BadSetting
from server.judge.settings_override import SettingsOverride
from server.recording.read.read import Recording, RecordingUnreadable, open_recording
from server.simulator.scenarios import Planned, UnknownScenario, planned
from server.storage import output_file
from server.storage.output_file import Output, output_of
from server.system.memory_limit import TOO_LARGE, bounded_memory
from server.system.page_files import AssetsMissing

NO_CRITICAL, CRITICAL, CANNOT = 0, 1, 2
SWITCH_S = 0.0002


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.add_argument(
        "files",
        nargs="+",
        type=Path,
        metavar="FILE",
        help="ROS 1 bag, ROS 2 bag directory, .mcap, .db3; several are one recording",
    )
    parser.add_argument("--json", type=Path, metavar="OUT", help="write all that was found as JSON; - for the screen")
    parser.add_argument("--html", type=Path, metavar="OUT", help="write a page with plots, one file, works offline")
    parser.add_argument("--settings", type=Path, metavar="FILE", help="thresholds to judge by, as TOML")
    parser.add_argument(
        "--compare",
        nargs=2,
        type=Path,
        metavar=("A", "B"),
        help="two files of settings: which alarms appear, vanish or move from A to B",
    )
    parser.add_argument(
        "--inject",
        type=_fault,
        action="append",
        default=[],
        metavar="FAULT@T[+D]",
        help="lay a fault of `catgraph simulate` over the recording from T s on, for D s; may be repeated",
    )
    parser.add_argument("--start", type=_seconds, default=0.0, metavar="S", help="begin S seconds after the start")
    parser.add_argument("--duration", type=_seconds, default=math.inf, metavar="S", help="judge S seconds at most")


def run(args: argparse.Namespace) -> int:
    """0 no critical alarm was raised (with --compare: by B), 1 one was, 2 it cannot be told: not all
    of the recording can be read, or nothing in it could be judged."""
    began_s = time.perf_counter()
    try:
        _demand_sense(args)
        overrides = [read_override(path) for path in args.compare or ([args.settings] if args.settings else [])]
        with bounded_memory(), _prompt_threads(), open_recording(args.files) as recording:
            _demand_extract(recording, args)
            report = _report(recording, overrides or [None], args, began_s)
            _write(report, args)
    except BadSettingsFile as error:
        for sentence in error.sentences:
            _complain(sentence)
        return CANNOT
    except (RecordingUnreadable, CannotInject, BadSetting, AssetsMissing, _Impossible) as error:
        _complain(str(error))
        return CANNOT
    except MemoryError:
        _complain(f"{args.files[0]}: {TOO_LARGE}")
        return CANNOT
    except Exception as error:  # the one net: 1 would say that a critical alarm was raised
        traceback.print_exc()
        _complain(f"a fault of catgraph itself, please report it: {type(error).__name__}: {error}")
        return CANNOT
    missing = [*report.run.damage, *([report.run.broke_off] if report.run.broke_off is not None else [])]
    for sentence in missing:
        _complain(sentence)
    if missing:
        return CANNOT
    if report.why_nothing is not None:
        _complain(report.why_nothing)
        return CANNOT
    return CRITICAL if report.has_critical else NO_CRITICAL


@contextlib.contextmanager
def _prompt_threads() -> Iterator[None]:
    """Who unpacks beside the judge asks for the interpreter now and then, and would wait 5 ms each time."""
    before_s = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_S)
    try:
        yield
    finally:
        sys.setswitchinterval(before_s)


class _Impossible(Exception):
    """What was asked for cannot be done. The text is one sentence."""


def _report(
    recording: Recording, overrides: Sequence[SettingsOverride | None], args: argparse.Namespace, began_s: float
) -> Report:
    extract = Extract(start_s=args.start, duration_s=args.duration)
    faults: list[Planned] = args.inject
    with_traces = args.html is not None
    open_s = time.perf_counter() - began_s
    before: Rehearsed | None = None
    if len(overrides) == 2:
        before = _rehearse(recording, overrides[0], extract, faults, "First settings", with_traces=False)
    elif faults:
        before = _rehearse(recording, overrides[0], extract, (), "Without faults", with_traces=False)
    found = _rehearse(recording, overrides[-1], extract, faults, "Checking", with_traces=with_traces)
    return Report(
        files=[str(path) for path in args.files], recording=recording, run=found, before=before, open_s=open_s
    )


def _rehearse(
    recording: Recording,
    override: SettingsOverride | None,
    extract: Extract,
    faults: Sequence[Planned],
    what: str,
    *,
    with_traces: bool,
) -> Rehearsed:
    end_s = min(recording.duration_s, extract.start_s + extract.duration_s)
    progress = Progress(extract.start_s, end_s, what)
    recording.rejected.clear()
    try:
        return rehearse(
            recording,
            override=override,
            extract=extract,
            faults=faults,
            with_traces=with_traces,
            on_progress=progress,
        )
    finally:
        progress.close()


def _write(report: Report, args: argparse.Namespace) -> None:
    json, html = _output(args.json), _output(args.html)
    text = summary.text(report)
    if str(args.json) == "-" or (json is not None and json.is_stdout):
        text, json = orjson.dumps(as_json(report), option=orjson.OPT_INDENT_2).decode(), None
    content = b""
    if html is not None:
        from server.analysis.page import page  # jinja2 takes its time to load

        content = page(report).encode()
        if html.is_stdout:
            text, html = content.decode(), None
    _say(text)
    if json is not None:
        _keep(json, orjson.dumps(as_json(report), option=orjson.OPT_INDENT_2) + b"\n")
    if html is not None:
        _keep(html, content)
        if str(args.json) != "-":
            _say(f"\nPage: {args.html}")


def _output(path: Path | None) -> Output | None:
    """Before the work and not after it."""
    if path is None or str(path) == "-":
        return None
    try:
        return output_of(path)
    except OSError as error:
        raise _Impossible(f"{path} cannot be written: {error.strerror or error}.") from None


def _keep(output: Output, content: bytes) -> None:
    try:
        output_file.write(output, content)
    except BrokenPipeError:  # who read the other end of a pipe has seen enough
        pass
    except OSError as error:
        raise _Impossible(f"{output.path} cannot be written: {error.strerror or error}.") from None


def _demand_sense(args: argparse.Namespace) -> None:
    if args.compare and args.settings:
        raise _Impossible("--compare names both settings already: leave --settings out.")
    outputs = [_output(path) for path in (args.json, args.html)]
    if str(args.json) == "-" or (outputs[0] is not None and outputs[0].is_stdout):
        if outputs[1] is not None and outputs[1].is_stdout and not _is_null(args.html):
            raise _Impossible("--json and --html cannot both go to the screen.")
    if args.html is not None and str(args.html) == "-":
        raise _Impossible("--html needs the name of a file.")
    Faults(args.inject)


def _is_null(path: Path) -> bool:
    return path.samefile(os.devnull)


def _demand_extract(recording: Recording, args: argparse.Namespace) -> None:
    if args.start > recording.duration_s:
        raise _Impossible(
            f"--start {args.start:g} lies behind the end: the recording has {recording.duration_s:.1f} s."
        )
    if args.duration == 0.0:
        raise _Impossible("--duration 0 leaves nothing to judge.")
    for fault in args.inject:
        if fault.after_s > recording.duration_s:
            raise _Impossible(
                f"{fault.scenario.name} at {fault.after_s:g} s lies behind the end: the recording has "
                f"{recording.duration_s:.1f} s."
            )


def _fault(text: str) -> Planned:
    try:
        return planned(text)
    except UnknownScenario as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of seconds, 0 or more")
    return value


def _complain(sentence: str) -> None:
    print(f"catgraph check: {sentence}", file=sys.stderr)


def _say(text: str) -> None:
    try:
        print(text, flush=True)
    except BrokenPipeError:  # who read the other end of a pipe has seen enough
        pass
    except OSError as error:
        raise _Impossible(f"the report cannot be printed: {error.strerror or error}.") from None
