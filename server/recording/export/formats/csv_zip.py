"""A recording as tables: one CSV file a signal, the log, the settings and a text that explains them, in one zip.

Messages of all signals come mixed, and a zip takes one file after another: so the tables are written beside the zip
first, and what is in memory is never more than a line of each.
"""

from __future__ import annotations

import contextlib
import csv
import tempfile
import zipfile
from collections.abc import Collection, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from itertools import chain, count
from pathlib import Path
from typing import IO, Any

import orjson

from monitor.values import GpsFix
from server.bus.event_table import COLUMNS as ALARM_COLUMNS
from server.bus.event_table import event_row, safe_cell
from server.judge.units import Unit
from server.recording.export.columns import OWN_TABLES, TABLES, TIMES, OwnTable, Written, number_table, readme
from server.recording.export.decoded_drive import DecodedDrive
from server.recording.export.export_format import ExportFormat, ExportRefused, Outcome, Progress, nothing
from server.recording.export.raw import described_event
from server.recording.marks.recorded import described_late, marks_of, media_of
from server.recording.read.read import Recording

FORMAT = ExportFormat(
    name="csv",
    label="CSV tables",
    use="one for each signal, zipped",
    extension="csv.zip",
    media_type="application/zip",
    writer=f"{__name__}:write_csv_zip",
    order=30,
)

MARK_COLUMNS = ("mark", "category", "words", "voice", "photo", "source", "by", "late")
_READING = 0.85  # of the work; the rest is packing
_BLOCK = 1 << 20


def write_csv_zip(recording: Recording, path: Path, *, progress: Progress = nothing) -> Outcome:
    """Writes the zip. Raises ExportRefused where there is nothing to write, RecordingUnreadable, OSError."""
    outcome = Outcome()
    drive = DecodedDrive(recording)
    with tempfile.TemporaryDirectory(prefix=".tables-", dir=path.parent) as folder:
        tables = _Tables(Path(folder), recording.start_s)
        with contextlib.closing(tables):
            unset = 0

            def add(signal: str, value: Any, at_s: float, stamp_s: float | None) -> None:
                nonlocal unset
                unset += isinstance(value, GpsFix) and value.is_unset
                table = TABLES[signal]
                for row in table.rows(value):
                    tables.add(f"{signal}.csv", table.columns, at_s, stamp_s, row)

            def add_number(signal: str, number: float, unit: Unit | None, at_s: float, stamp_s: float | None) -> None:
                column = f"as published [{'unit unknown' if unit is None else unit.label}]"
                tables.add(number_table(signal, unit), (column,), at_s, stamp_s, (number,))

            drive.read(add, on_number=add_number, progress=lambda part: progress(part * _READING))
            unfit = _own_tables(recording, tables)
            _marks(recording, tables)
        texts = _settings(recording)
        if not tables.rows and not texts:
            raise ExportRefused("Nothing in this recording fits a table.")
        outcome.entries = sum(tables.rows.values())
        outcome.notes = [*(f"{note}." for note in recording.notes), *_without_table(drive), *unfit, *drive.losses()]
        outcome.notices = [*recording.clock_notes, *drive.not_measured()]
        if unset:
            outcome.notices.append(f"{unset} positions with coordinates 0, 0 have empty cells and status -1.")
        notes = [*outcome.notices, *outcome.notes]
        about = readme(drive, [Written(name=name, rows=rows) for name, rows in tables.rows.items()], notes)
        _pack(path, Path(folder), list(tables.rows), {"README.txt": about, **texts}, recording, progress)
    return outcome


class _Tables:
    """The CSV files while they are written."""

    def __init__(self, folder: Path, start_s: float) -> None:
        self.rows: dict[str, int] = {}
        self._folder, self._start_s = folder, start_s
        self._open: dict[str, tuple[IO[str], Any]] = {}

    def add(self, name: str, columns: Sequence[str], at_s: float, stamp_s: float | None, values: Sequence[Any]) -> None:
        writer = self._writer(name, (*TIMES, *columns))
        writer.writerow(
            (
                when(at_s),
                f"{at_s - self._start_s:.6f}",
                "" if stamp_s is None else f"{stamp_s:.6f}",
                *("" if value != value else safe_cell(value) for value in values),  # NaN: not known
            )
        )
        self.rows[name] += 1

    def add_whole(self, name: str, columns: Sequence[str], row: Sequence[Any]) -> None:
        """A row that has its own columns for the time."""
        self._writer(name, columns).writerow(row)
        self.rows[name] += 1

    def close(self) -> None:
        for file, _ in self._open.values():
            file.close()

    def _writer(self, name: str, columns: Sequence[str]) -> Any:
        found = self._open.get(name)
        if found is None:
            file = (self._folder / name).open("w", encoding="utf-8", newline="", buffering=1 << 16)
            found = self._open[name] = (file, csv.writer(file))
            found[1].writerow(columns)
            self.rows[name] = 0
        return found[1]


def when(at_s: float) -> str:
    """A time of day as ISO 8601 in UTC; what no calendar has, as it came."""
    try:
        return datetime.fromtimestamp(at_s, UTC).isoformat(timespec="microseconds").replace("+00:00", "Z")
    except (OverflowError, ValueError, OSError):
        return f"{at_s:.6f}"


def _own_tables(recording: Recording, tables: _Tables) -> list[str]:
    """Writes them; what of them is no row, as sentences."""
    unfit = 0
    for _, event in recording.own("/catgraph/alarms"):
        try:
            row = event_row(event)
        except (KeyError, TypeError, ValueError, OverflowError):  # no event as we write them
            unfit += 1
            continue
        tables.add_whole("alarms.csv", ALARM_COLUMNS, row)
    for described in described_late(recording):
        tables.add_whole("alarms.csv", ALARM_COLUMNS, event_row(described_event(described)))
    for topic, table in OWN_TABLES.items():
        for at_s, entry in recording.own(topic):
            tables.add(table.file, (*table.columns, "details"), at_s, None, _own_row(table, entry))
    return [f"{unfit} events of the log are left out: they have no time or no number."] if unfit else []


def _marks(recording: Recording, tables: _Tables) -> None:
    """Those that came after the recording was complete are among them."""
    for mark in marks_of(recording):
        row = [mark[name] for name in MARK_COLUMNS]  # type: ignore[literal-required]
        tables.add("marks.csv", MARK_COLUMNS, mark["marked_ms"] / 1000, None, row)


def _own_row(table: OwnTable, entry: Mapping[str, Any]) -> list[Any]:
    rest = {name: value for name, value in entry.items() if name != "time_ms"}
    row: list[Any] = []
    for way in table.columns.values():
        first, _, second = way.partition(".")
        value = entry.get(first)
        if second:
            value = value.get(second) if isinstance(value, Mapping) else None
        else:
            rest.pop(first, None)
        row.append(orjson.dumps(value).decode() if isinstance(value, dict | list) else value)
    return [*row, orjson.dumps(rest).decode() if rest else None]


def _settings(recording: Recording) -> dict[str, str]:
    """The settings at the beginning, and each change of them under its time."""
    texts: dict[str, str] = {}
    newest = None
    for at_s, entry in recording.own("/catgraph/settings"):
        toml = entry.get("toml")
        if isinstance(toml, str) and toml != newest:  # each part repeats those in force
            texts[_settings_name(at_s, texts)] = newest = toml
    if not texts and recording.metadata.get("settings"):
        texts["settings.toml"] = recording.metadata["settings"]
    return texts


def _settings_name(at_s: float, taken: Collection[str]) -> str:
    if not taken:
        return "settings.toml"
    time = when(at_s).replace(":", "")
    exact = time.removesuffix("Z")
    names = chain((time[:17], exact), (f"{exact}-{number}" for number in count(2)))
    return next(name for one in names if (name := f"settings from {one}Z.toml") not in taken)


def _without_table(drive: DecodedDrive) -> list[str]:
    return [
        f"{topic} ({kind}, {count} messages) fills no signal and has no table."
        for topic, (kind, count) in drive.other_topics().items()
        if count
    ]


def _pack(
    path: Path,
    folder: Path,
    names: Sequence[str],
    texts: Mapping[str, str],
    recording: Recording,
    progress: Progress,
) -> None:
    now = datetime.now(UTC).timetuple()[:6]
    sizes = {name: (folder / name).stat().st_size for name in names}
    whole, done = max(sum(sizes.values()), 1), 0
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as packed:
        for name, text in texts.items():
            packed.writestr(_entry(name, now), text)
        for media, data in media_of(recording):
            packed.writestr(_entry(f"marks/{media.file}", now), data, zipfile.ZIP_STORED)
        for name in names:
            with (folder / name).open("rb") as source, packed.open(_entry(name, now), "w", force_zip64=True) as target:
                for block in _blocks(source):
                    target.write(block)
                    done += len(block)
                    progress(_READING + (1 - _READING) * done / whole)
            (folder / name).unlink()


def _entry(name: str, now: tuple[int, ...]) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name, date_time=(now[0], now[1], now[2], now[3], now[4], now[5]))
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.external_attr = 0o644 << 16
    return entry


def _blocks(file: IO[bytes]) -> Iterator[bytes]:
    while block := file.read(_BLOCK):
        yield block
