"""The tracks of a drive as GeoJSON (RFC 7946): lines with the time of each point, a point for each alarm and mark.

Lines end at the antimeridian and go on beyond it, as RFC 7946, 3.1.9 wants it. `coordTimes` is the usage of togeojson.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import orjson

from server.recording.export.decoded_drive import DecodedDrive
from server.recording.export.export_format import ExportFormat, Outcome, Progress, nothing
from server.recording.export.track import Place, Track, tracks_of, when
from server.recording.read.read import Recording

FORMAT = ExportFormat(
    name="geojson",
    label="GeoJSON track",
    use="for QGIS and web maps",
    extension="geojson",
    media_type="application/geo+json",
    writer=f"{__name__}:write_geojson",
    order=50,
)

Position = list[float]


def write_geojson(recording: Recording, path: Path, *, progress: Progress = nothing) -> Outcome:
    """Raises ExportRefused where there is no position, RecordingUnreadable, OSError."""
    tracks = tracks_of(DecodedDrive(recording), progress)
    lines = [("car", str(recording.metadata.get("vehicle") or "car"), tracks.car)]
    lines += [("phone", name, track) for name, track in tracks.phones.items()]
    with path.open("wb") as file:
        file.write(b'{"type":"FeatureCollection","features":[')
        separator = b"\n"
        for kind, name, track in lines:
            for feature in _lines(kind, name, track):
                file.write(separator + orjson.dumps(feature))
                separator = b",\n"
        for place in tracks.alarms:
            file.write(separator + orjson.dumps(_alarm(place)))
            separator = b",\n"
        for place in tracks.marks:
            file.write(separator + orjson.dumps(_mark(place)))
            separator = b",\n"
        file.write(b"\n]}\n")
    return Outcome(entries=tracks.points, notes=tracks.notes, notices=tracks.notices)


def _lines(kind: str, name: str, track: Track) -> Iterator[dict[str, Any]]:
    for stretch in track.stretches():
        for positions, times in _parts(track, stretch):
            is_line = len(positions) > 1
            yield {
                "type": "Feature",
                "geometry": {
                    "type": "LineString" if is_line else "Point",
                    "coordinates": positions if is_line else positions[0],
                },
                "properties": {
                    "kind": kind,
                    "name": name,
                    **({"coordTimes": times} if is_line else {"time": times[0]}),
                },
            }


def _parts(track: Track, stretch: range) -> Iterator[tuple[list[Position], list[str]]]:
    """A stretch, cut where it crosses the antimeridian."""
    positions: list[Position] = []
    times: list[str] = []
    before: int | None = None
    for i in stretch:
        if before is not None and abs(track.lon_deg[i] - track.lon_deg[before]) > 180.0:
            edge, lat_deg, at_s = _crossing(track, before, i)
            if positions[-1][0] != edge:
                positions.append(_position(lat_deg, edge, math.nan))
                times.append(when(at_s))
            yield positions, times
            positions, times = [_position(lat_deg, -edge, math.nan)], [when(at_s)]
            if track.lon_deg[i] == -edge:
                positions, times = [], []
        positions.append(_position(track.lat_deg[i], track.lon_deg[i], track.alt_m[i]))
        times.append(when(track.at_s[i]))
        before = i
    if positions:
        yield positions, times


def _crossing(track: Track, before: int, i: int) -> tuple[float, float, float]:
    """On which side of the antimeridian (180 or −180) a step comes to it, at which latitude, and when."""
    edge = 180.0 if track.lon_deg[before] > 0 else -180.0
    whole = track.lon_deg[i] + 2 * edge - track.lon_deg[before]
    part = (edge - track.lon_deg[before]) / whole if whole else 0.0
    return (
        edge,
        track.lat_deg[before] + part * (track.lat_deg[i] - track.lat_deg[before]),
        track.at_s[before] + part * (track.at_s[i] - track.at_s[before]),
    )


def _position(lat_deg: float, lon_deg: float, alt_m: float) -> Position:
    position = [round(lon_deg, 8), round(lat_deg, 8)]
    return [*position, round(alt_m, 2)] if math.isfinite(alt_m) else position


def _alarm(place: Place) -> dict[str, Any]:
    event = place.event
    return {
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": _position(place.lat_deg, place.lon_deg, place.alt_m)},
        "properties": {
            "kind": "alarm",
            "name": place.title,
            "text": place.text,
            "priority": place.priority,
            "alarm": event.get("alarm"),
            "occurrence": event.get("occurrence"),
            "change": event.get("change"),
            "time": when(place.at_s),
        },
    }


def _mark(place: Place) -> dict[str, Any]:
    fields = {name: place.event[name] for name in ("mark", "category", "voice", "photo", "source", "by", "late")}
    return {
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": _position(place.lat_deg, place.lon_deg, place.alt_m)},
        "properties": {"kind": "mark", "name": place.title, "text": place.text, **fields, "time": when(place.at_s)},
    }
