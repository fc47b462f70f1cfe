"""One recording checked as `catgraph check` does it: judged, and the result as text, JSON and page."""

from __future__ import annotations

import contextlib
import sys
import time
import traceback
from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import orjson

from server.analysis import summary
from server.analysis.as_json import as_json
from server.analysis.faults import CannotInject
from server.analysis.rehearse import Extract, Rehearsed, rehearse
from server.analysis.report import Report, to_choose
from server.analysis.report_text import printable
from server.judge.active_settings import SettingsOverride
from server.judge.settings import BadSetting
from server.recording.read.errors import RecordingUnreadable
from server.recording.read.read import Recording, open_recording
from server.recording.verification import of_files
from server.simulator.scenarios import planned
from server.system.page_files import AssetsMissing
from server.system.process_limits import TOO_LARGE, bounded_memory

NO_CRITICAL, CRITICAL, CANNOT = 0, 1, 2
SWITCH_S = 0.0002

OnProgress = Callable[[float, float], None]  # which part is done, from 0 to 1; seconds of recording judged
_OWN_SUFFIXES = (".mcap", ".writing")  # of catgraph's own files


class Impossible(Exception):
    """The request cannot be fulfilled. The text is one sentence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckOptions:
    """The options of a check."""

    overrides: Sequence[SettingsOverride | None] = (None,)  # two: they are compared
    extract: Extract = field(default_factory=Extract)
    faults: Sequence[str] = ()  # FAULT@T[+D]
    with_json: bool = False
    with_page: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Checked:
    """The result for one recording."""

    code: int  # NO_CRITICAL, CRITICAL or CANNOT
    errors: Sequence[str] = ()  # sentences
    text: str | None = None  # None: there is no result
    json: bytes | None = None
    page: str | None = None


def check_recording(
    files: Sequence[Path], options: CheckOptions, on_progress: OnProgress, *, memory_part: float = 1.0
) -> Checked:
    """Check one recording, which is in one or several files. `memory_part`: of the free memory that it may take."""
    began_s = time.perf_counter()
    try:
        with bounded_memory(memory_part), _prompt_threads(), open_recording(files) as recording:
            _demand_extract(recording, options)
            unread = [f"{note}." for note in recording.notes]
            report = _report(files, recording, options, on_progress, began_s)
            unread += [
                f"{count} messages on {topic} are left out: {recording.why_rejected.get(topic, 'not JSON')}."
                for topic, count in sorted(recording.rejected.items())
            ]
            unread += [printable(sentence, 2000) for sentence in to_choose(report.run)]
            text, json, page = summary.text(report), None, None
            if options.with_json:
                json = orjson.dumps(as_json(report), option=orjson.OPT_INDENT_2)
            if options.with_page:
                from server.analysis.page import page as page_of  # jinja2 takes its time to load

                page = page_of(report)
    except (RecordingUnreadable, CannotInject, BadSetting, AssetsMissing, Impossible) as error:
        return Checked(code=CANNOT, errors=(str(error),))
    except MemoryError:
        return Checked(code=CANNOT, errors=(f"{files[0]}: {TOO_LARGE}",))
    except Exception as error:  # the one net: exit status 1 would say that a critical alarm was raised
        traceback.print_exc()
        why = f"internal error of catgraph, please report it: {type(error).__name__}: {error}"
        return Checked(code=CANNOT, errors=(why,))
    errors = [*report.run.damage, *([report.run.broke_off] if report.run.broke_off is not None else [])]
    if not errors and report.why_nothing is not None:
        errors = [report.why_nothing]
    code = CANNOT if errors else CRITICAL if report.has_critical else CANNOT if unread else NO_CRITICAL
    return Checked(code=code, errors=[*errors, *unread], text=text, json=json, page=page)


@contextlib.contextmanager
def _prompt_threads() -> Iterator[None]:
    """A thread that unpacks beside the judge would else wait 5 ms for the interpreter each time."""
    before_s = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_S)
    try:
        yield
    finally:
        sys.setswitchinterval(before_s)


def _report(
    files: Sequence[Path], recording: Recording, options: CheckOptions, on_progress: OnProgress, began_s: float
) -> Report:
    extract, faults = options.extract, [planned(fault) for fault in options.faults]
    open_s = time.perf_counter() - began_s
    length_s = max(0.0, min(recording.duration_s - extract.start_s, extract.duration_s))
    is_compared = len(options.overrides) == 2 or bool(faults)
    total_s = length_s * (2 if is_compared else 1)

    def run(override: SettingsOverride | None, done_s: float, *, with_faults: bool, with_traces: bool) -> Rehearsed:
        recording.rejected.clear()
        return rehearse(
            recording,
            override=override,
            extract=extract,
            faults=faults if with_faults else (),
            with_traces=with_traces,
            on_progress=lambda at_s: report_progress(done_s + at_s - extract.start_s),
        )

    def report_progress(judged_s: float) -> None:
        on_progress(judged_s / max(total_s, 1e-9), judged_s)

    before: Rehearsed | None = None
    if is_compared:
        before = run(options.overrides[0], 0.0, with_faults=len(options.overrides) == 2, with_traces=False)
    done_s = length_s if is_compared else 0.0
    found = run(options.overrides[-1], done_s, with_faults=True, with_traces=options.with_page)
    return Report(
        files=[str(path) for path in files],
        recording=recording,
        run=found,
        before=before,
        open_s=open_s,
        verified=of_files(recording),
    )


def _demand_extract(recording: Recording, options: CheckOptions) -> None:
    extract, length_s = options.extract, recording.duration_s
    if extract.start_s > length_s:
        raise Impossible(f"--start {extract.start_s:g} is behind the end: the recording has {length_s:.1f} s.")
    if extract.duration_s == 0.0:
        raise Impossible("--duration 0 leaves nothing to judge.")
    for fault in map(planned, options.faults):
        if fault.after_s > length_s:
            raise Impossible(
                f"{fault.scenario.name} at {fault.after_s:g} s is behind the end: the recording has {length_s:.1f} s."
            )


def by_recording(paths: Sequence[Path]) -> list[list[Path]]:
    """The files of each recording, in the order in which the recordings are first named.

    Parts of a recording of catgraph name it in their metadata. Every other file is a recording, as is a clip.
    """
    groups: dict[Hashable, list[Path]] = {}
    for number, path in enumerate(paths):
        groups.setdefault(_recording_of(path) or number, []).append(path)
    return list(groups.values())


def _recording_of(path: Path) -> tuple[str, str] | None:
    """Vehicle and recording of the file; None: unknown."""
    if path.suffix not in _OWN_SUFFIXES or not path.is_file():
        return None
    try:
        with open_recording([path]) as recording:
            about = recording.metadata
    except (RecordingUnreadable, MemoryError):
        return None  # reading it reports the reason
    return (about.get("vehicle", ""), about["session"]) if "session" in about and "clip_of" not in about else None
