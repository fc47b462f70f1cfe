"""Names of objects in the store.

catalogue/<vehicle>/<id>.json              the row of a recording, its alarms and the list of its files
files/<vehicle>/<id>/<id>.mcap             its file, or, where it is larger than PART_BYTES:
files/<vehicle>/<id>/<id>.mcap.part-00001  … in parts; one after the other they are the file
files/<vehicle>/<id>/clip_<time>.mcap      the time around an alarm
files/<vehicle>/<id>/annotations.json      its annotations, late marks too: the <id>.mcap.json beside its file
files/<vehicle>/<id>/marks/<mark>.<kind>   a voice note or photo that came after it was complete
"""

from __future__ import annotations

import re
from datetime import UTC, datetime

from server.recording.folder import is_id

PART_BYTES = 16 * 2**20
ROWS = "catalogue/"
_ROW = re.compile(r"catalogue/([A-Za-z0-9_-]{1,40})/([A-Za-z0-9_-]{1,90})\.json")
_VEHICLE = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,39}")


def vehicle_folder(vehicle: str) -> str:
    """A vehicle's name as an object may have it."""
    plain = re.sub(r"[^A-Za-z0-9_-]", "-", vehicle)[:40]
    return plain if plain[:1].isalnum() else f"v{plain}"[:40]


def is_place(vehicle: str, id: str) -> bool:
    """Whether a folder and an id can be those of a recording; nothing else is looked for in the store."""
    return _VEHICLE.fullmatch(vehicle) is not None and is_id(id)


def row_key(vehicle: str, id: str) -> str:
    return f"{ROWS}{vehicle_folder(vehicle)}/{id}.json"


def place_of(key: str) -> tuple[str, str] | None:
    """Folder of the vehicle and id of the recording whose row has this name; None: it is no row."""
    found = _ROW.fullmatch(key)
    return (found[1], found[2]) if found is not None and is_place(found[1], found[2]) else None


def folder_key(vehicle: str, id: str) -> str:
    return f"files/{vehicle_folder(vehicle)}/{id}/"


def mark_key(vehicle: str, id: str, file: str) -> str:
    return f"{folder_key(vehicle, id)}marks/{file}"


def annotations_key(vehicle: str, id: str) -> str:
    return f"{folder_key(vehicle, id)}annotations.json"


def part_count(size: int) -> int:
    """The number of objects for a file of `size` bytes."""
    return max(1, -(-size // PART_BYTES))


def part_key(vehicle: str, id: str, ending: str, number: int, of: int) -> str:
    """The object of a part; the first has number 1."""
    whole = f"{folder_key(vehicle, id)}{id}.{ending}"
    return whole if of == 1 else f"{whole}.part-{number:05d}"


def part_size(size: int, number: int) -> int:
    return max(0, min(PART_BYTES, size - (number - 1) * PART_BYTES))


def clip_key(vehicle: str, id: str, at_ms: int) -> str:
    return f"{folder_key(vehicle, id)}clip_{datetime.fromtimestamp(at_ms / 1000, UTC):%Y%m%dT%H%M%SZ}.mcap"
