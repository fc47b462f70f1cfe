"""The results of one call of `catgraph check`, of all its runs, for the writers of text, JSON and HTML."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from monitor import catalog
from monitor.alarm_spec import Priority
from monitor.scan_shape import habit_words
from monitor.signals import SIGNALS
from server.analysis.episodes import Change, compare
from server.analysis.recorded_log import RecordedLog
from server.analysis.rehearse import Rehearsed
from server.analysis.report_text import printable
from server.judge.active_settings import SettingsOverride
from server.judge.pipeline import TICK_S
from server.judge.sources.source import plain_type
from server.protocol.questions import Question
from server.recording.read.read import Recording
from server.recording.verification import Verification

MOST_NAMED = 3  # topics in one sentence


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalRow:
    """One signal as the recording has it."""

    name: str
    label: str
    topic: str | None
    type: str | None
    why: str | None  # why this topic; of a signal without one, why none is taken
    note: str | None
    count: int
    rate_hz: float | None  # over all that was judged
    expected_hz: float | None
    rejected: int
    why_rejected: str | None
    lowest: float | None
    highest: float | None
    unit: str
    optional: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """One recording, judged once or, to compare, twice."""

    files: Sequence[str]
    recording: Recording
    run: Rehearsed
    before: Rehearsed | None = None  # with the first settings of two, or without the injected faults
    open_s: float = 0.0  # what opening the files took
    recorded_log: RecordedLog | None = None  # of the page of a drive
    verified: Sequence[Verification] = ()  # the hash chain of each file that is ours

    @property
    def changes(self) -> list[Change]:
        return [] if self.before is None else compare(self.before.episodes, self.run.episodes)

    @property
    def took_s(self) -> float:
        return self.open_s + self.run.took_s

    @property
    def times_real(self) -> float:
        return self.run.judged_s / self.took_s if self.took_s > 0 else 0.0

    @property
    def has_critical(self) -> bool:
        return any(episode.priority is Priority.CRITICAL for episode in self.run.episodes)

    @property
    def why_nothing(self) -> str | None:
        """Why nothing in the recording could be judged, as a sentence; None: something was."""
        return why_nothing(self.run, self.recording)

    @property
    def recorded(self) -> datetime | None:
        """When the recording began; None where its clock has no valid time."""
        try:
            return datetime.fromtimestamp(self.recording.start_s, UTC) if self.recording.count else None
        except (OverflowError, ValueError, OSError):
            return None

    @property
    def event_log(self) -> list[tuple[str, str, bool]]:
        """Whether each file is as it was recorded: a short text, the whole sentence, and whether it is not."""
        several = len(self.verified) > 1
        return [
            (f"{one.path.name}: {one.short}" if several else one.short, one.sentence, one.is_broken)
            for one in self.verified
        ]

    def signals(self) -> list[SignalRow]:
        return [_row(self.run, name) for name in SIGNALS]

    def settings(self) -> list[tuple[str, str, float, str]]:
        """What differs from the car's defaults: full name, label, value, unit."""
        return settings_of(self.run)


def why_nothing(run: Rehearsed, recording: Recording) -> str | None:
    """Why the run shows nothing of the car: no message of any signal could be read, or no check ran. None: one did."""
    if any(tally.received > tally.rejected + tally.not_measured for tally in run.reception.by_signal.values()):
        if run.judged_s >= TICK_S:
            return None
        return f"Nothing could be evaluated: what was read covers {run.judged_s:.2f} s, too short for any check."
    if not recording.count:
        return "Nothing could be evaluated: the recording has no message."
    if not run.sources and run.undecided:
        return f"Nothing could be evaluated: {next(iter(run.undecided.values()))}."
    if not run.sources:
        none_is = f"none of its {len(recording.topics)} topics is" if len(recording.topics) > 1 else "its topic is not"
        return (
            f"Nothing could be evaluated: {none_is} one that catgraph knows. "
            "Name the topics of the signals in a file for --settings."
        )
    if not any(tally.received for tally in run.reception.by_signal.values()):
        foreign = [
            f"{one.topic} has another type, {plain_type(one.type)}, which is not read as {SIGNALS[name].label}"
            for name, one in run.sources.items()
            if one.decode is None and one.type
        ]
        if foreign:
            others = "; the others have no message here" if len(foreign) < len(run.sources) else ""
            return f"Nothing could be evaluated: {'; '.join(foreign[:MOST_NAMED])}{others}."
        return "Nothing could be evaluated: the topics that catgraph knows have no message here."
    return "Nothing could be evaluated: no message on a topic that catgraph knows could be read."


def settings_of(run: Rehearsed) -> list[tuple[str, str, float, str]]:
    """What a run was judged by beyond the car's defaults: full name, label, value, unit."""
    if not run.tuning.settings.values:
        return []
    schema = catalog.schema()
    return [
        (name, str(schema[name]["title"]), value, str(schema[name]["unit"]))
        for name, value in sorted(run.tuning.settings.values.items())
    ]


def differences(before: Rehearsed, after: Rehearsed) -> list[tuple[str, float, float, str]]:
    """Thresholds in which two runs differ: label, before, after, unit."""
    old, new = catalog.flat(before.tuning.limits), catalog.flat(after.tuning.limits)
    if old == new:
        return []
    schema = catalog.schema()
    return [
        (str(schema[name]["title"]), old[name], new[name], str(schema[name]["unit"]))
        for name in new
        if old.get(name) != new[name]
    ]


def not_checked(run: Rehearsed) -> list[tuple[str, list[str]]]:
    """Each reason, with the checks that never had a result because of it."""
    by_reason: dict[str, list[str]] = {}
    for one in run.unchecked:
        by_reason.setdefault(one.why, []).append(one.label)
    return list(by_reason.items())


def to_choose(run: Rehearsed) -> list[str]:
    """What could not be judged because no topic carries it, and how to choose one, in sentences."""
    questions = [f"{_shown(question)} {_answer(question)}" for question in run.questions]
    picked = run.tuning.settings.topics  # what was picked and is not there is noted already
    return questions + [
        f"{SIGNALS[signal].label}: {run.undecided[signal]}." for signal in sorted(run.refused) if signal not in picked
    ]


def _shown(question: Question) -> str:
    left = question["options_count"] - len(question["options"])
    options = [
        printable(one["value"], 60) + (f" ({printable(one['why'], 80)})" if one["why"] else "")
        for one in question["options"]
    ]
    return f"{printable(question['words'])} {', '.join(options)}{f' and {left} more' if left else ''}."


def _answer(question: Question) -> str:
    example = printable(question["options"][0]["value"], 80)
    return f'Choose in a file for --settings: [topics] {question["signal"]} = "{example}".'


def name_of(override: SettingsOverride) -> str:
    return override.name or "the defaults"


def _row(run: Rehearsed, name: str) -> SignalRow:
    signal, source, tally = SIGNALS[name], run.sources.get(name), run.reception.by_signal.get(name)
    extent, rate = run.snapshot.extents.get(name), run.snapshot.rates.get(name)
    proper = 0 if tally is None else tally.received - tally.rejected - tally.not_measured
    return SignalRow(
        name=name,
        label=signal.label,
        topic=None if source is None else source.topic,
        type=None if source is None else source.type,
        why=run.undecided.get(name) if source is None else source.why,
        note=_note(run, name),
        count=0 if tally is None else tally.received,
        rate_hz=proper / run.judged_s if proper > 1 and run.judged_s > 0 else None,
        expected_hz=None if rate is None or not rate.settled else rate.expected_hz,
        rejected=0 if tally is None else tally.rejected,
        why_rejected=None if tally is None else tally.last_reason,
        lowest=None if extent is None else extent.lowest,
        highest=None if extent is None else extent.highest,
        unit=signal.unit,
        optional=signal.optional,
    )


def _note(run: Rehearsed, name: str) -> str | None:
    """The notes on a signal's source."""
    source, tally = run.sources.get(name), run.reception.by_signal.get(name)
    notes = [] if source is None or source.note is None else [source.note]
    if tally is not None and tally.not_measured:
        notes.append(f"{tally.not_measured} of {tally.received} {tally.why_not_measured or 'not measured'}")
    if source is not None and (unit := run.reception.units.note(name, source.topic)) is not None:
        if tally is None or unit != tally.why_not_measured:
            notes.append(unit)
    scan = run.snapshot.get("scan") if name == "scan" else None
    if scan is not None and scan.value.mounting is not None:
        notes += scan.value.mounting.notes
    if name == "scan" and (habit := habit_words(run.snapshot.scan_habit)) is not None:
        notes.append(habit)
    return "; ".join(notes) or None
