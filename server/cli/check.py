"""`catgraph check`: every check over recordings, faster than they happened."""

from __future__ import annotations

import argparse
import math
import os
import sys
import traceback
from collections.abc import Iterator, Sequence
from pathlib import Path

from server.analysis.check_pool import check_each
from server.analysis.check_recording import (
    CANNOT,
    NO_CRITICAL,
    Checked,
    CheckOptions,
    Impossible,
    by_recording,
    check_recording,
)
from server.analysis.faults import CannotInject, Faults
from server.analysis.rehearse import Extract
from server.analysis.thresholds import BadSettingsFile, read_override
from server.cli.progress import Progress
from server.simulator.scenarios import UnknownScenario, planned
from server.storage import output_file
from server.storage.output_file import Output, output_of


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.add_argument(
        "files",
        nargs="+",
        type=Path,
        metavar="FILE",
        help="ROS 1 bag, ROS 2 bag directory, .mcap, .db3; several are several recordings, except that parts of a "
        "recording of catgraph, and the files in a directory, are one",
    )
    parser.add_argument("--one-recording", action="store_true", help="all files are parts of one recording")
    parser.add_argument("--json", type=Path, metavar="OUT", help="write the result as JSON; - for standard output")
    parser.add_argument(
        "--html",
        type=Path,
        metavar="OUT",
        help="write a report with plots: one HTML file that works offline; of one recording",
    )
    parser.add_argument("--settings", type=Path, metavar="FILE", help="settings file (TOML) with the thresholds")
    parser.add_argument(
        "--compare",
        nargs=2,
        type=Path,
        metavar=("A", "B"),
        help="two settings files: list which alarms appear, vanish or move from A to B",
    )
    parser.add_argument(
        "--inject",
        type=_fault,
        action="append",
        default=[],
        metavar="FAULT@T[+D]",
        help="add a fault of `catgraph simulate` to the recording, at T s for D s; can be repeated",
    )
    parser.add_argument("--start", type=_seconds, default=0.0, metavar="S", help="start S seconds after the beginning")
    parser.add_argument("--duration", type=_seconds, default=math.inf, metavar="S", help="evaluate at most S seconds")


def run(args: argparse.Namespace) -> int:
    """Return 0: all was read and no critical alarm (with --compare: by B), 1: a critical alarm, 2: unknown, because
    part of a recording cannot be read or nothing in it could be evaluated. Of several recordings the highest
    counts."""
    try:
        recordings = [args.files] if args.one_recording or len(args.files) == 1 else by_recording(args.files)
        _demand_sense(args, recordings)
        overrides = [read_override(path) for path in args.compare or ([args.settings] if args.settings else [])]
        options = CheckOptions(
            overrides=overrides or [None],
            extract=Extract(start_s=args.start, duration_s=args.duration),
            faults=args.inject,
            with_json=args.json is not None,
            with_page=args.html is not None,
        )
        return _print(recordings, _checked(recordings, options), args)
    except BadSettingsFile as error:
        for sentence in error.sentences:
            _complain(sentence)
    except (CannotInject, Impossible) as error:
        _complain(str(error))
    except Exception as error:  # last resort: 1 would mean a critical alarm
        traceback.print_exc()
        _complain(f"internal error of catgraph, please report it: {type(error).__name__}: {error}")
    return CANNOT


def _checked(recordings: Sequence[Sequence[Path]], options: CheckOptions) -> Iterator[Checked]:
    """What became of each recording, in the order given, with one progress bar for all."""
    what = "Checking" if len(recordings) == 1 else f"Checking {len(recordings)} recordings"
    progress = Progress(what)
    try:
        if len(recordings) == 1:
            checked = check_recording(recordings[0], options, progress)
            progress.close()
            yield checked
            return
        for checked in check_each(recordings, options, progress):
            progress.close()
            yield checked
    finally:
        progress.close()


def _print(recordings: Sequence[Sequence[Path]], found: Iterator[Checked], args: argparse.Namespace) -> int:
    """Print and write the results as they come, and return the exit status."""
    json, html = _output(args.json), _output(args.html)
    has_json_out = str(args.json) == "-" or (json is not None and json.is_stdout)
    has_page_out = html is not None and html.is_stdout
    is_one = len(recordings) == 1
    code, bodies, is_first = NO_CRITICAL, list[bytes](), True
    for files, checked in zip(recordings, found, strict=True):
        code = max(code, checked.code)
        if checked.json is not None:
            bodies.append(checked.json)
        if checked.text is not None and not has_json_out and not has_page_out:
            _say(checked.text if is_first else f"\n{'─' * 80}\n\n{checked.text}")
            is_first = False
        if checked.page is not None and html is not None:
            if html.is_stdout:
                _say(checked.page)
            else:
                _keep(html, checked.page.encode())
                if not has_json_out:
                    _say(f"\nPage: {args.html}")
        for sentence in checked.errors:
            is_named = is_one or str(files[0]) in sentence
            _complain(sentence if is_named else f"{files[0]}: {sentence}")
    if args.json is not None and (bodies or not is_one):
        body = bodies[0] if is_one else b"[" + b",\n".join(bodies) + b"]"
        if has_json_out:
            _say(body.decode())
        elif json is not None:
            _keep(json, body + b"\n")
    return code


def _output(path: Path | None) -> Output | None:
    """Before the work and not after it."""
    if path is None or str(path) == "-":
        return None
    try:
        return output_of(path)
    except OSError as error:
        raise Impossible(f"{path} cannot be written: {error.strerror or error}.") from None


def _keep(output: Output, content: bytes) -> None:
    try:
        output_file.write(output, content)
    except BrokenPipeError:  # who read the other end of a pipe has seen enough
        pass
    except OSError as error:
        raise Impossible(f"{output.path} cannot be written: {error.strerror or error}.") from None


def _demand_sense(args: argparse.Namespace, recordings: Sequence[Sequence[Path]]) -> None:
    if args.compare and args.settings:
        raise Impossible("--compare takes both settings files: omit --settings.")
    outputs = [_output(path) for path in (args.json, args.html)]
    if str(args.json) == "-" or (outputs[0] is not None and outputs[0].is_stdout):
        if outputs[1] is not None and outputs[1].is_stdout and not _is_null(args.html):
            raise Impossible("--json and --html cannot both use standard output.")
    if args.html is not None and str(args.html) == "-":
        raise Impossible("--html needs a file name.")
    if args.html is not None and len(recordings) > 1:
        raise Impossible(f"--html is a page of one recording, and these files are {len(recordings)}.")
    Faults([planned(fault) for fault in args.inject])


def _is_null(path: Path) -> bool:
    return path.samefile(os.devnull)


def _fault(text: str) -> str:
    try:
        planned(text)
    except UnknownScenario as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return text


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
        raise Impossible(f"the report cannot be printed: {error.strerror or error}.") from None
