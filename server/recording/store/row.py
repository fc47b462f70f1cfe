"""The row of a recording as it is in the store: written by its agent, read by every server that has the store."""

from __future__ import annotations

import hashlib
from typing import Annotated, Any

import orjson
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from monitor.alarm_spec import Priority
from server.protocol.answers import Recording, SketchAnswer, StoredRecording
from server.recording.catalog.annotations import line
from server.recording.store.names import is_place, vehicle_folder
from server.recording.store.uploads import Upload

MOST_BYTES = 2**20  # of a row
FORMAT = 1
_KEPT_BACK = ("stored", "thumbnail", "trashed_ms", "file")  # of the list of the agent, and of no use elsewhere
_SHA256 = r"^(?:[0-9a-f]{64})$"
_NAME = r"^(?:[A-Za-z0-9][A-Za-z0-9_.-]{0,119})$"


class BadRow(ValueError):
    """What the store has there is no row."""


class RowPart(BaseModel):
    """One object with a part of a file; the order of the list is that of the file."""

    model_config = ConfigDict(extra="ignore")
    name: str = Field(pattern=_NAME)
    size: int = Field(ge=0, le=5 * 2**30)
    sha256: str = Field(pattern=_SHA256)


class RowClip(RowPart):
    at_ms: int = Field(ge=0, le=2**53)


class RowFile(BaseModel):
    """The whole file."""

    model_config = ConfigDict(extra="ignore")
    name: str = Field(pattern=_NAME)
    size: int = Field(ge=0, le=2**53)
    sha256: str = Field(pattern=_SHA256)
    checked_ms: int = Field(ge=0, le=2**53)
    parts: list[RowPart] = Field(max_length=100_000)


class StoredRow(BaseModel):
    """What is read of a row; it may have more."""

    model_config = ConfigDict(extra="ignore")
    id: str
    folder: str
    vehicle: Annotated[str, Field(max_length=200)]
    title: Annotated[str, Field(max_length=500)] = ""
    started_ms: int = Field(ge=-(2**53), le=2**53)
    length_s: float | None = None
    distance_m: float | None = None
    top_speed_mps: float | None = None
    alarms: dict[Priority, int] | None = None
    sketch: SketchAnswer | None = None
    stored_file: RowFile | None = None
    stored_clips: list[RowClip] = Field(default_factory=list, max_length=1000)

    def as_json(self) -> StoredRecording:
        """As a page gets it."""
        file = self.stored_file
        return {
            "id": self.id,
            "vehicle": line(self.vehicle)[:40],
            "folder": self.folder,
            "title": line(self.title)[:120],
            "started_ms": self.started_ms,
            "length_s": self.length_s,
            "distance_m": self.distance_m,
            "top_speed_mps": self.top_speed_mps,
            "alarms": self.alarms,
            "sketch": self.sketch,
            "file": None if file is None else file.name,
            "size_bytes": None if file is None else file.size,
            "sha256": None if file is None else file.sha256,
            "checked_ms": None if file is None else file.checked_ms,
            "clips": [{"name": clip.name, "at_ms": clip.at_ms, "size_bytes": clip.size} for clip in self.stored_clips],
        }


def digest_of(row: Recording, upload: Upload) -> str:
    """Another value: the row in the store is out of date."""
    facts = (
        FORMAT,
        *(row["title"], row["note"], row["weather"], row["tags"], row["size_bytes"], row["sha256"], row["state"]),
        row.get("late", ""),
        upload.verified.model_dump() if upload.verified else None,
        [clip.key for clip in upload.clips],
    )
    return hashlib.sha256(orjson.dumps(facts)).hexdigest()


def made(row: Recording, upload: Upload, annotations: dict[str, Any] | None = None) -> bytes:
    """The object: all that the agent's list has of it, and the files of it that are in the store; `annotations`: the
    object with all annotations."""
    verified = upload.verified
    name = f"{row['id']}.{row['format']}"
    file: dict[str, Any] | None = None
    if verified is not None:
        parts = [upload.parts[number] for number in sorted(upload.parts)]
        file = {
            "name": name,
            "size": verified.size,
            "sha256": verified.sha256,
            "checked_ms": verified.at_ms,
            "parts": [_part(part.key, part.size, part.sha256) for part in parts],
            "join": f"cat {name}.part-* > {name}" if len(parts) > 1 else None,
        }
    clips = [{**_part(clip.key, clip.size, clip.sha256), "at_ms": clip.at_ms} for clip in upload.clips]
    kept = {key: value for key, value in row.items() if key not in _KEPT_BACK}
    body: dict[str, Any] = {**kept, "catgraph": FORMAT, "folder": vehicle_folder(row["vehicle"])}
    body |= {"stored_file": file, "stored_clips": clips, "stored_annotations": annotations}
    whole = orjson.dumps(body, option=orjson.OPT_INDENT_2)
    if len(whole) > MOST_BYTES and body.pop("late_marks", None):  # they are in the annotations
        whole = orjson.dumps(body, option=orjson.OPT_INDENT_2)
    return whole


def read(body: bytes, folder: str, id: str) -> StoredRow:
    """Raises BadRow. A program with write access to the store can write anything there."""
    try:
        row = StoredRow.model_validate_json(body)
    except ValidationError:
        raise BadRow("The row cannot be read.") from None
    if (row.folder, row.id) != (folder, id) or not is_place(folder, id):
        raise BadRow("The row is another recording's.")
    return row


def _part(key: str, size: int, sha256: str) -> dict[str, Any]:
    return {"name": key.rpartition("/")[2], "size": size, "sha256": sha256}
