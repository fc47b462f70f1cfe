"""The tracks of a drive as GPX 1.1 (topografix.com/GPX/1/1): car, phones, a waypoint for each alarm and mark."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TextIO
from xml.sax.saxutils import escape

from server.recording.export.decoded_drive import DecodedDrive
from server.recording.export.export_format import ExportFormat, Outcome, Progress, nothing
from server.recording.export.track import Track, tracks_of, when
from server.recording.read.read import Recording
from server.version import catgraph_version

FORMAT = ExportFormat(
    name="gpx",
    label="GPX track",
    use="for maps and watches",
    extension="gpx",
    media_type="application/gpx+xml",
    writer=f"{__name__}:write_gpx",
    order=40,
)

_HEAD = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<gpx version="1.1" creator="catgraph {version}" xmlns="http://www.topografix.com/GPX/1/1" '
    'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" '
    'xsi:schemaLocation="http://www.topografix.com/GPX/1/1 http://www.topografix.com/GPX/1/1/gpx.xsd">\n'
)


def write_gpx(recording: Recording, path: Path, *, progress: Progress = nothing) -> Outcome:
    """Raises ExportRefused where there is no position, RecordingUnreadable, OSError."""
    tracks = tracks_of(DecodedDrive(recording), progress)
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(_HEAD.format(version=_text(catgraph_version())))
        file.write(
            f"<metadata><name>{_text(tracks.name)}</name>"
            "<desc>Elevations are above the WGS84 ellipsoid, as the receiver gives them.</desc>"
            f"<time>{when(recording.start_s)}</time></metadata>\n"
        )
        for place in tracks.alarms:
            file.write(
                f'<wpt lat="{place.lat_deg:.8f}" lon="{place.lon_deg:.8f}">{_height(place.alt_m)}'
                f"<time>{when(place.at_s)}</time><name>{_text(place.title)}</name>"
                f"<desc>{_text(place.text)}</desc><type>{_text(place.priority)}</type></wpt>\n"
            )
        for place in tracks.marks:
            file.write(
                f'<wpt lat="{place.lat_deg:.8f}" lon="{place.lon_deg:.8f}">{_height(place.alt_m)}'
                f"<time>{when(place.at_s)}</time><name>{_text(place.title)}</name>"
                f"<desc>{_text(place.text)}</desc><sym>Flag, Blue</sym><type>mark</type></wpt>\n"
            )
        if tracks.car.at_s:
            _track(file, str(recording.metadata.get("vehicle") or "car"), "car", tracks.car)
        for name, track in tracks.phones.items():
            _track(file, name, "phone", track)
        file.write("</gpx>\n")
    return Outcome(entries=tracks.points, notes=tracks.notes, notices=tracks.notices)


def _track(file: TextIO, name: str, kind: str, track: Track) -> None:
    file.write(f"<trk><name>{_text(name)}</name><type>{kind}</type>\n")
    for stretch in track.stretches():
        file.write("<trkseg>\n")
        for i in stretch:
            file.write(
                f'<trkpt lat="{track.lat_deg[i]:.8f}" lon="{track.lon_deg[i]:.8f}">'
                f"{_height(track.alt_m[i])}<time>{when(track.at_s[i])}</time></trkpt>\n"
            )
        file.write("</trkseg>\n")
    file.write("</trk>\n")


def _height(alt_m: float) -> str:
    return f"<ele>{alt_m:.2f}</ele>" if math.isfinite(alt_m) else ""


def _text(text: str) -> str:
    """Text that is valid in XML; texts of car and operators can contain any character."""
    return escape("".join(letter if letter.isprintable() else "�" for letter in text))
