"""The report as text for a terminal."""

from __future__ import annotations

from collections.abc import Iterator

from monitor.alarm_spec import Priority
from monitor.load import BEARABLE_IN_10_MIN, FLOOD_IN_10_MIN
from server.analysis.episodes import Change, Episode
from server.analysis.report import Report, SignalRow, differences, name_of, not_checked, to_choose
from server.analysis.report_text import clock, counted, grouped, length, printable

_MARKS = {Priority.CRITICAL: "CRITICAL", Priority.WARNING: "warning ", Priority.ADVISORY: "advisory"}


def text(report: Report) -> str:
    """The whole summary, without a line break at its end."""
    parts = [_head(report), _signals(report), _alarms(report), _slowed(report), _not_checked(report), _load(report)]
    if report.before is not None:
        parts.append(_comparison(report))
    parts.append(_notes(report))
    return "\n\n".join("\n".join(lines) for lines in map(list, parts) if lines)


def _head(report: Report) -> Iterator[str]:
    recording, run, when = report.recording, report.run, report.recorded
    yield f"Checked {', '.join(printable(file) for file in report.files)}"
    dated = f"recorded {when:%Y-%m-%d %H:%M:%S} UTC, " if when is not None else ""
    yield (
        f"  ROS {recording.ros_version}, {dated}{length(recording.duration_s)}, "
        f"{counted(recording.count, 'message')} on {counted(len(recording.topics), 'topic')}"
    )
    if run.messages and (run.from_s > 0.05 or run.to_s < recording.duration_s - 0.05):
        yield f"  Evaluated from {clock(run.from_s)} to {clock(run.to_s)}: {counted(run.messages, 'message')}"
    settings = report.settings()
    by = f"{printable(name_of(run.override))}" + (f": {len(settings)} of them changed" if settings else "")
    yield f"  Vehicle profile: {run.tuning.profile.title}. Settings: {by}"
    for _, label, value, unit in settings:
        yield f"    {label} {value:g} {unit}".rstrip()
    for short, sentence, _ in report.event_log:
        yield f"  Event log: {printable(short)}"
        yield f"    {printable(sentence, 600)}"
    for laid in run.faults:
        yield f"  Injected: {laid.name} from {clock(laid.from_s)} to {clock(laid.to_s)}, {_touched(laid.touched)}"
    if report.took_s > 0 and run.judged_s > 0:
        yield f"  Evaluated in {report.took_s:.2f} s: {report.times_real:.0f} × real time"


def _touched(count: int) -> str:
    return f"{counted(count, 'message')} changed or held back"


def _signals(report: Report) -> Iterator[str]:
    rows = [row for row in report.signals() if row.topic is not None or row.why or not row.optional]
    yield "Signals"
    if report.recording.count and not report.run.sources and not report.run.undecided:
        yield "  None of the topics in this recording is one that catgraph knows."
    widths = (
        max(len(row.label) for row in rows),
        max(len(printable(row.topic or "", 48)) for row in rows),
    )
    for row in rows:
        yield f"  {row.label:{widths[0]}}  " + _signal(row, widths[1])
    others = report.run.other_topics
    if others:
        shown = ", ".join(printable(name, 60) for name in list(others)[:8])
        yield f"  Besides: {shown}{f' and {len(others) - 8} more' if len(others) > 8 else ''}"


def _signal(row: SignalRow, width: int) -> str:
    if row.topic is None:
        return "not published" if row.why is None else f"not chosen: {printable(row.why, 100)}"
    parts = [f"{printable(row.topic, 48):{width}}  {grouped(row.count):>9}"]
    parts.append(f"{row.rate_hz:7.1f} Hz" if row.rate_hz is not None else " " * 10)
    if row.lowest is not None and row.highest is not None:
        parts.append(f"{row.lowest:.2f} … {row.highest:.2f} {row.unit}".rstrip())
    if row.rejected:
        parts.append(f"{grouped(row.rejected)} rejected: {printable(row.why_rejected or '', 80)}")
    if row.note:
        parts.append(f"({printable(row.note, 100)})")
    return "  ".join(parts).rstrip()


def _alarms(report: Report) -> Iterator[str]:
    run = report.run
    if not run.messages:
        yield "No alarms: there is no message to evaluate."
        return
    if not run.episodes:
        yield "No alarms"
        return
    numbers = {priority: sum(one.priority is priority for one in run.episodes) for priority in Priority}
    counts = [f"{number} {priority}" for priority, number in numbers.items() if number]
    yield f"{counted(len(run.episodes), 'alarm')}: {', '.join(counts)}"
    for episode in run.episodes:
        yield from _episode(episode)


def _episode(episode: Episode) -> Iterator[str]:
    lasted = length(episode.for_s) if episode.cleared_s is not None else f"{length(episode.for_s)} to the end"
    yield f"  {clock(episode.raised_s):>9}  {_MARKS[episode.priority]}  {printable(episode.title)}, for {lasted}"
    yield f"{'':23}{printable(episode.trip_text)}"
    if episode.worst_text:
        yield f"{'':23}worst: {printable(episode.worst_text)}"
    for one in episode.announcements[1:4]:
        yield f"{'':23}again at {clock(one.at_s)}: {printable(one.text)}"
    if len(episode.announcements) > 4:
        yield f"{'':23}and {len(episode.announcements) - 4} times more"


def _slowed(report: Report) -> Iterator[str]:
    if report.run.simulated_orders:
        yield "Would have slowed the car if armed and without a veto"
        for one in report.run.simulated_orders:
            yield f"  {clock(one.at_s):>9}  {printable(one.title)}, after a count-down from {clock(one.countdown_s)}"
            yield f"{'':23}{printable(one.text)}"


def _not_checked(report: Report) -> Iterator[str]:
    sentences = to_choose(report.run)
    if sentences:
        yield "To choose: which topic carries a signal"
        yield from (f"  {printable(sentence, 2000)}" for sentence in sentences)
        yield ""
    rows = not_checked(report.run)
    if rows:
        yield "Never checked, state unknown"
        for why, labels in rows:
            yield f"  {', '.join(printable(label) for label in labels)}: {printable(why)}"


def _load(report: Report) -> Iterator[str]:
    if not report.run.messages:
        return
    load = report.run.load
    ratings = {
        "bearable": f"acceptable (at most {BEARABLE_IN_10_MIN:g} in 10 min)",
        "demanding": f"demanding (acceptable is {BEARABLE_IN_10_MIN:g} in 10 min)",
        "flood": f"a flood (more than {FLOOD_IN_10_MIN} in 10 min)",
    }
    yield (
        f"Alarm load after EEMUA 191: {load.announced} announced in {length(load.judged_s)}, "
        f"at most {load.most_in_10_min} within 10 min: {ratings[load.verdict]}"
    )
    if load.chattering:
        titles = ", ".join(printable(report.run.titles[name]) for name in load.chattering)
        yield f"  Chattering: {titles}"


def _comparison(report: Report) -> Iterator[str]:
    before, run = report.before, report.run
    assert before is not None
    if run.faults:
        yield "Compared with the unchanged recording"
    else:
        yield f"{printable(name_of(before.override))} → {printable(name_of(run.override))}"
        for label, old, new, unit in differences(before, run):
            yield f"  {label}: {old:g} → {new:g} {unit}".rstrip()
    if not report.changes:
        yield "  No alarm appears, vanishes or moves"
    for change in report.changes:
        yield "  " + _change(change)


def _change(change: Change) -> str:
    episode = change.episode
    head = f"{change.kind:9} {clock(episode.raised_s):>9}  {_MARKS[episode.priority]}  {printable(episode.title)}"
    if change.kind == "moves" and change.before is not None and change.after is not None:
        return f"{head}: was {_span(change.before)}, is {_span(change.after)}"
    return f"{head}, {_span(episode)}: {printable(episode.trip_text)}"


def _span(episode: Episode) -> str:
    return f"{clock(episode.raised_s)} to {clock(episode.until_s) if episode.cleared_s is not None else 'the end'}"


def _notes(report: Report) -> Iterator[str]:
    if report.run.broke_off is not None:
        yield f"Aborted at {clock(report.run.to_s)}: {printable(report.run.broke_off)}"
    for note in report.run.notes:
        yield f"Note: {printable(note)}"
