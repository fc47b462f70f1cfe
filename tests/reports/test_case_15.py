"""A receiver that sends zero coordinates with the status of a fix, until it has a position."""

from __future__ import annotations

import csv
import io
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import orjson
import pytest

from server.recording.catalog.survey import survey
from server.recording.export.formats.csv_zip import write_csv_zip
from server.recording.export.formats.geojson import write_geojson
from server.recording.export.formats.gpx import write_gpx
from server.recording.read.read import open_recording
from tests.reports.cases import judged, made, raised

POINTS, ZEROS = 450, 150


@pytest.fixture(scope="module")
def drive() -> Path:
    return made("case_15_zero_position.py") / "15-zero-position" / "ins"


def test_no_point_of_a_track_is_at_zero(drive: Path, tmp_path: Path) -> None:
    with open_recording([drive]) as recording:
        outcome = write_gpx(recording, tmp_path / "track.gpx")
        write_geojson(recording, tmp_path / "track.geojson")
    assert outcome.notices == [f"Left out: {ZEROS} positions with coordinates 0, 0."]
    points = ElementTree.parse(tmp_path / "track.gpx").getroot().findall(".//{*}trkpt")
    assert len(points) == POINTS
    assert min(float(point.attrib["lat"]) for point in points) > 48.0
    features = orjson.loads((tmp_path / "track.geojson").read_bytes())["features"]
    places = [place for feature in features for place in feature["geometry"]["coordinates"]]
    assert len(places) == POINTS
    assert min(place[1] for place in places) > 48.0


def test_a_table_has_no_coordinates_for_them(drive: Path, tmp_path: Path) -> None:
    with open_recording([drive]) as recording:
        outcome = write_csv_zip(recording, tmp_path / "tables.zip")
    assert f"{ZEROS} positions with coordinates 0, 0 have empty cells and status -1." in outcome.notices
    with zipfile.ZipFile(tmp_path / "tables.zip") as tables:
        rows = list(csv.DictReader(io.TextIOWrapper(tables.open("position.csv"), "utf-8")))
    latitudes = [row["latitude [deg]"] for row in rows]
    assert latitudes.count("") == ZEROS
    assert min(float(one) for one in latitudes if one) > 48.0
    assert {row["status"] for row in rows[:ZEROS]} == {"-1"}


def test_list_and_check_agree_with_the_exports(drive: Path) -> None:
    found = survey(next(drive.glob("*.mcap")))
    assert found["distance_m"] == pytest.approx(99.0, abs=5.0)
    assert len(found["sketch"]["lines"]) == 1
    report = judged(drive)
    assert report.run.snapshot.track[0].lat_deg > 48.0
    alarms = raised(report)
    assert alarms["gps_fix"] == pytest.approx(3.1, abs=0.2)
    assert not {"gps_drift", "gps_jump"} & set(alarms)
