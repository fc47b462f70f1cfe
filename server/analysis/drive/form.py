"""The tables of an authority, filled from a drive by a template file. Nothing here knows a particular form."""

from __future__ import annotations

import csv
import io
import os
import re
import zipfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from server.analysis.drive.drive_report import DriveReport
from server.bus.event_table import safe_cell
from server.recording.drive.modes import Intervention
from server.recording.export.export_format import ExportRefused, Outcome
from server.recording.read.read import Recording
from server.storage import bounded_toml

FOLDER = "CATGRAPH_FORMS"  # environment: a folder with further templates
MAX_BYTES = 128 * 1024
MOST_FILES = 50
Text = Annotated[str, Field(max_length=300)]


_FIGURES = ("distance_m", "driven_s", "alarms", "interventions", "marks")
_OF_DRIVE = ("vehicle", "session", "weather", "remarks", "title")
_MODES = tuple(f"{mode}_{unit}" for mode in ("autonomous", "manual", "unknown") for unit in ("m", "s"))
# What a column may have of a row.
FIELDS = {
    "drive": frozenset({"time", *_FIGURES, *_OF_DRIVE, *_MODES}),
    "interventions": frozenset({"time", "description", "at_s", *(field.name for field in fields(Intervention))}),
}


class Column(BaseModel):
    """One column: a text that is always the same, or a field of the row."""

    model_config = ConfigDict(extra="forbid")
    title: Text
    text: Text = ""
    value: Text = ""
    words: dict[Text, Text] = {}
    factor: float = 1.0
    digits: int | None = Field(None, ge=0, le=9)
    format: Text = ""
    month: int | None = Field(None, ge=1, le=12)


class Table(BaseModel):
    """One table: a row for each intervention, or one for the drive."""

    model_config = ConfigDict(extra="forbid")
    file: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]{0,60}$")]
    rows: Literal["interventions", "drive"]
    columns: Annotated[list[Column], Field(min_length=1, max_length=100)]

    @model_validator(mode="after")
    def _has_these_fields(self) -> Self:
        for column in self.columns:
            if column.value and column.value not in FIELDS[self.rows]:
                raise ValueError(f"{column.title}: there is no field {column.value} of {self.rows}")
        return self


class Form(BaseModel):
    """One template file."""

    model_config = ConfigDict(extra="forbid")
    title: Text
    table: Annotated[list[Table], Field(min_length=1, max_length=20)]


def read_form(text: bytes, name: str) -> Form:
    """Raises ExportRefused with what is wrong with a template."""
    try:
        return Form.model_validate(bounded_toml.loads(text, max_bytes=MAX_BYTES))
    except ValidationError as why:
        first = why.errors()[0]
        place, why_not = ".".join(map(str, first["loc"])), first["msg"].removeprefix("Value error, ")
        raise ExportRefused(f"The template {name} cannot be used: {place}: {why_not}.") from None
    except ValueError as why:
        raise ExportRefused(f"The template {name} cannot be used: {why}") from None


def forms() -> dict[str, Form]:
    """The shipped templates, and those of the folder beside them. Raises ExportRefused."""
    found = {
        item.name: item.read_bytes()
        for item in files("server.analysis.drive.forms").iterdir()
        if item.name.endswith(".toml")
    }
    folder = os.environ.get(FOLDER)
    if folder:
        try:
            for path in sorted(Path(folder).glob("*.toml"))[:MOST_FILES]:
                with path.open("rb") as file:
                    found[path.name] = file.read(MAX_BYTES + 1)
        except OSError as why:
            raise ExportRefused(f"The templates in {folder} cannot be read: {why.strerror or why}.") from None
    return {name: read_form(text, name) for name, text in sorted(found.items())}


def write_forms(
    recording: Recording, path: Path, *, name: str = "", progress: Callable[[float], None] = lambda part: None
) -> Outcome:
    """Writes a zip with a CSV file of each table. Raises ExportRefused, RecordingUnreadable, OSError."""
    tables = [table for form in forms().values() for table in form.table]
    report = DriveReport.read(recording, name=name)
    outcome = Outcome(notices=list(report.found["parts_missing"]))
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        for table in tables:
            rows = list(rows_of(table, report.found))
            outcome.entries += len(rows) - 1
            packed.writestr(f"{table.file}.csv", as_csv(rows))
    if report.found["interventions"] is None:
        outcome.notices.append("The interventions are not known: the mode of the car was not recorded.")
    outcome.notes += [f"{sentence}." for sentence in recording.damage]
    progress(1.0)
    return outcome


def as_csv(rows: list[list[Any]]) -> str:
    """RFC 4180; no cell is taken for a formula."""
    out = io.StringIO()
    csv.writer(out).writerows([[safe_cell(cell) for cell in row] for row in rows])
    return out.getvalue()


def rows_of(table: Table, found: Mapping[str, Any]) -> Iterator[list[Any]]:
    """The heads, then a row for each thing. What is not known is empty."""
    yield [column.title for column in table.columns]
    things = [_drive(found)] if table.rows == "drive" else map(_intervention, found["interventions"] or ())
    for thing in things:
        yield [_cell(column, thing) for column in table.columns]


def _drive(found: Mapping[str, Any]) -> dict[str, Any]:
    figures = found["figures"]
    modes = {f"{mode}_{unit}": row[unit] for mode, row in figures["modes"].items() for unit in ("m", "s")}
    is_known = found["modes"] is not None
    return {
        "time": found["start_ms"],
        **{key: value if is_known or key.startswith("unknown") else None for key, value in modes.items()},
        **{name: figures[name] for name in _FIGURES},
        **{name: found[name] for name in _OF_DRIVE},
    }


def _intervention(one: Mapping[str, Any]) -> dict[str, Any]:
    description = ". ".join(filter(None, (one["category"], one["what"])))
    return {**one, "time": one["at_ms"], "description": description, "active": "; ".join(one["active"])}


def _cell(column: Column, thing: Mapping[str, Any]) -> Any:
    if not column.value:
        return column.text
    value = thing.get(column.value)
    if column.month is not None and _when(thing["time"]).month != column.month:
        return ""
    if column.format and isinstance(value, int):
        return re.sub(r"[\x00-\x1f]", " ", _when(value).strftime(column.format))
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        number = value if column.factor == 1.0 else value * column.factor
        return f"{number:.{column.digits}f}" if column.digits is not None else number
    if value is None or isinstance(value, (list, tuple, dict)):
        return ""
    return column.words.get(str(value), str(value))


def _when(at_ms: int) -> datetime:
    try:
        return datetime.fromtimestamp(at_ms / 1000, UTC)
    except (OverflowError, ValueError, OSError):
        return datetime(1970, 1, 1, tzinfo=UTC)
