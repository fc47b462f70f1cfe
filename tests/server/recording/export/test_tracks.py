"""The tracks of a drive as GPX and GeoJSON."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import orjson
import pytest

from server.recording.export.export_format import ExportRefused, Outcome
from server.recording.export.formats.geojson import write_geojson
from server.recording.export.formats.gpx import write_gpx
from server.recording.export.track import Track
from server.recording.read.read import open_recording
from tests.server.recording.bags import BEGIN_S, Drive, Row, write_ros1
from tests.server.recording.export.ours import Own, as_ours, event

FIX, TWIST = "sensor_msgs/msg/NavSatFix", "geometry_msgs/msg/Twist"
GPX = {"g": "http://www.topografix.com/GPX/1/1"}
NS = 10**9


def fix(at_s: float, lat: float, lon: float, *, status: int = 0, alt: float = 700.0) -> Row:
    return (at_s, "/gps_fix", FIX, {"status": {"status": status}, "latitude": lat, "longitude": lon, "altitude": alt})


def made(folder: Path, rows: list[Row], own: list[Own] | None = None) -> Path:
    return as_ours(write_ros1(folder / "in.bag", Drive(messages=rows)), folder / "ours.mcap", own or [])


def gpx(source: Path, folder: Path) -> tuple[ElementTree.Element, Outcome]:
    with open_recording([source]) as recording:
        outcome = write_gpx(recording, folder / "out.gpx")
    return ElementTree.parse(folder / "out.gpx").getroot(), outcome


def geojson(source: Path, folder: Path) -> tuple[list[dict[str, Any]], Outcome]:
    with open_recording([source]) as recording:
        outcome = write_geojson(recording, folder / "out.geojson")
    body = orjson.loads((folder / "out.geojson").read_bytes())
    assert body["type"] == "FeatureCollection"
    return body["features"], outcome


def alarm(at_s: float, **more: Any) -> Own:
    return (
        round((BEGIN_S + at_s) * NS),
        "/catgraph/alarms",
        event(1, round((BEGIN_S + at_s) * 1000), "raised", **more),
    )


def phone(at_s: float, lat: float, lon: float, **more: Any) -> Own:
    where = {"lat_deg": lat, "lon_deg": lon, "accuracy_m": 5.0, "age_s": 0.5, "alt_m": None}
    return (round((BEGIN_S + at_s) * NS), "/catgraph/phone", {"phone": "9c <b>", "fix": where} | more)


LAP = [fix(0.1 * n, 32.0 + n * 1e-5, -110.0, alt=700.0 + n) for n in range(30)]
OWN: list[Own] = [
    alarm(1.0, text="3.2 m/s & <more>"),
    phone(1.0, 32.5, -110.5),
    phone(2.0, 32.6, -110.5),
    (BEGIN_S * NS, "/catgraph/phone", {"phone": "x", "why": "denied", "fix": None}),
    (BEGIN_S * NS, "/catgraph/alarms", event(3, BEGIN_S * 1000, "acknowledged")),
    (BEGIN_S * NS, "/catgraph/alarms", event(4, BEGIN_S * 1000, "connected", None)),
]


def test_gpx_has_the_car_the_phone_and_the_alarm(tmp_path: Path) -> None:
    root, outcome = gpx(made(tmp_path, LAP, OWN), tmp_path)
    assert root.attrib["version"] == "1.1"
    assert [child.tag.rpartition("}")[2] for child in root] == ["metadata", "wpt", "trk", "trk"]  # the schema's order
    points = root.findall("g:trk[1]/g:trkseg/g:trkpt", GPX)
    assert len(points) == 30
    assert (points[1].attrib["lat"], points[1].attrib["lon"]) == ("32.00001000", "-110.00000000")
    assert points[1].findtext("g:ele", namespaces=GPX) == "701.00"
    assert points[1].findtext("g:time", namespaces=GPX) == "2023-11-14T22:13:20.100Z"
    (waypoint,) = root.findall("g:wpt", GPX)
    assert waypoint.attrib["lat"] == "32.00010000"
    assert waypoint.findtext("g:name", namespaces=GPX) == "Speed above limit"
    assert waypoint.findtext("g:desc", namespaces=GPX) == "3.2 m/s & <more>"
    other = root.findall("g:trk[2]", GPX)[0]
    assert other.findtext("g:name", namespaces=GPX) == "9c <b>"
    times = [p.findtext("g:time", namespaces=GPX) for p in other.findall("g:trkseg/g:trkpt", GPX)]
    assert times == ["2023-11-14T22:13:20.500Z", "2023-11-14T22:13:21.500Z"]  # when it was measured, not reported
    assert outcome.entries == 33
    assert outcome.notes == []


def test_geojson_has_the_same(tmp_path: Path) -> None:
    features, outcome = geojson(made(tmp_path, LAP, OWN), tmp_path)
    car, other, point = features
    assert (car["geometry"]["type"], car["properties"]["kind"]) == ("LineString", "car")
    assert car["geometry"]["coordinates"][1] == [-110.0, 32.00001, 701.0]
    assert len(car["properties"]["coordTimes"]) == len(car["geometry"]["coordinates"]) == 30
    assert other["geometry"]["coordinates"] == [[-110.5, 32.5], [-110.5, 32.6]]
    assert point["geometry"] == {"type": "Point", "coordinates": [-110.0, 32.0001, 710.0]}
    assert (point["properties"]["priority"], point["properties"]["time"]) == ("critical", "2023-11-14T22:13:21.000Z")
    assert outcome.entries == 33


def test_a_gap_begins_a_new_stretch_and_no_fix_is_no_place(tmp_path: Path) -> None:
    rows = [
        fix(0.0, 32.0, -110.0),
        fix(1.0, 32.1, -110.0),
        fix(2.0, 50.0, 50.0, status=-1),
        fix(5.9, 32.2, -110.0),
        fix(11.0, 32.3, -110.0),
        fix(12.0, 32.4, -110.0),
    ]
    root, _ = gpx(made(tmp_path, rows), tmp_path)
    assert [len(s.findall("g:trkpt", GPX)) for s in root.findall("g:trk/g:trkseg", GPX)] == [3, 2]
    features, _ = geojson(tmp_path / "ours.mcap", tmp_path)
    assert [len(f["geometry"]["coordinates"]) for f in features] == [3, 2]


def test_a_lone_position_is_a_point(tmp_path: Path) -> None:
    features, _ = geojson(made(tmp_path, [fix(0.0, 32.0, -110.0)]), tmp_path)
    assert [f["geometry"] for f in features] == [{"type": "Point", "coordinates": [-110.0, 32.0, 700.0]}]


@pytest.mark.parametrize(
    ("lons", "expected"),
    [
        pytest.param([179.0, -179.0], [[179.0, 180.0], [-180.0, -179.0]], id="eastwards"),
        pytest.param([-179.0, 179.0], [[-179.0, -180.0], [180.0, 179.0]], id="westwards"),
        pytest.param([179.5, 180.0, -179.5], [[179.5, 180.0], [-180.0, -179.5]], id="stands on it"),
        pytest.param([-179.5, -180.0, 179.5], [[-179.5, -180.0], [180.0, 179.5]], id="stands on it, westwards"),
        pytest.param(
            [179.0, -179.0, 179.0], [[179.0, 180.0], [-180.0, -179.0, -180.0], [180.0, 179.0]], id="there and back"
        ),
        pytest.param([-1.0, 1.0], [[-1.0, 1.0]], id="the other meridian"),
        pytest.param([-89.0, 90.0], [[-89.0, 90.0]], id="half the earth is no crossing"),
    ],
)
def test_lines_are_cut_at_the_antimeridian(tmp_path: Path, lons: list[float], expected: list[list[float]]) -> None:
    rows = [fix(float(n), 10.0 + n, lon, alt=math.nan) for n, lon in enumerate(lons)]
    features, _ = geojson(made(tmp_path, rows), tmp_path)
    assert [[p[0] for p in f["geometry"]["coordinates"]] for f in features] == expected
    for feature in features:
        assert len(feature["properties"]["coordTimes"]) == len(feature["geometry"]["coordinates"])
    for before, after in pairwise(features):
        assert before["geometry"]["coordinates"][-1][1] == after["geometry"]["coordinates"][0][1]
    root, _ = gpx(tmp_path / "ours.mcap", tmp_path)
    assert all(-180.0 <= float(p.attrib["lon"]) < 180.0 for p in root.iter(f"{{{GPX['g']}}}trkpt"))


SPEED: Row = (0.0, "/catvehicle/vel", TWIST, {"linear": {"x": 1.0}})
NO_TRACK: dict[str, tuple[list[Row], str]] = {
    "nothing": ([], "No position was recorded in this drive: there is no track to export."),
    "no fix": (
        [fix(0.0, 32.0, -110.0, status=-1), fix(1.0, 32.0, -110.0, status=-1)],
        "There is no track to export. Left out: 2 positions without a fix.",
    ),
    "no status": (
        [fix(0.0, 32.0, -110.0, status=-2)],
        "There is no track to export. Left out: 1 position without a known status.",
    ),
    "zeros": (
        [fix(0.0, 0.0, 0.0), fix(1.0, 0.0, -0.0, status=2), fix(2.0, 1e-12, 0.0)],
        "There is no track to export. Left out: 3 positions with coordinates 0, 0.",
    ),
    "beyond the pole": (
        [fix(0.0, 91.0, 0.0)],
        "There is no track to export. 1 of 1 messages for position were invalid: latitude or longitude out of range.",
    ),
    "no numbers": (
        [fix(0.0, math.nan, 0.0)],
        "There is no track to export. 1 of 1 messages for position were invalid: "
        "latitude or longitude is not a number.",
    ),
}


@pytest.mark.parametrize(("rows", "sentence"), NO_TRACK.values(), ids=NO_TRACK)
@pytest.mark.parametrize("write", [gpx, geojson])
def test_why_there_is_no_track_is_reported(tmp_path: Path, rows: list[Row], sentence: str, write: Any) -> None:
    with pytest.raises(ExportRefused) as refusal:
        write(made(tmp_path, [SPEED, *rows]), tmp_path)
    assert str(refusal.value) == sentence


def test_what_a_track_leaves_out_is_counted_by_its_reason(tmp_path: Path) -> None:
    rows = [fix(0.0, 0.0, 0.0), fix(1.0, 0.0, 0.0), fix(2.0, 32.0, -110.0), fix(3.0, 5.0, 5.0, status=-1)]
    root, outcome = gpx(made(tmp_path, [*rows, fix(4.0, 6.0, 6.0, status=-2)]), tmp_path)
    points = [(float(p.attrib["lat"]), float(p.attrib["lon"])) for p in root.iter(f"{{{GPX['g']}}}trkpt")]
    assert points == [(32.0, -110.0)]
    assert outcome.notices == [
        "Left out: 2 positions with coordinates 0, 0.",
        "Left out: 1 position without a fix.",
    ]
    assert outcome.notes == ["Left out: 1 position without a known status."]


def test_a_phone_alone_is_a_track_and_alarms_without_a_place_are_counted(tmp_path: Path) -> None:
    drive: list[Row] = [(0.0, "/catvehicle/vel", TWIST, {"linear": {"x": 1.0}})]
    root, outcome = gpx(made(tmp_path, drive, OWN), tmp_path)
    assert [t.findtext("g:type", namespaces=GPX) for t in root.findall("g:trk", GPX)] == ["phone"]
    assert outcome.notices == ["The car published no position: only that of the phone is in the file."]
    assert outcome.notes == [
        "1 alarm was raised while the car's position was unknown, and cannot be drawn.",
    ]


@pytest.mark.parametrize(("at_s", "index"), [(-6.0, None), (-5.0, 0), (0.4, 0), (0.6, 1), (6.0, 1), (6.1, None)])
def test_an_alarm_stands_where_the_car_was_last_known(at_s: float, index: int | None) -> None:
    track = Track()
    track.add(0.0, 1.0, 1.0, None)
    track.add(1.0, 1.0, 1.0, None)
    assert track.near(at_s) == index
    assert Track().near(at_s) is None


def test_control_characters_do_not_spoil_the_file(tmp_path: Path) -> None:
    root, _ = gpx(made(tmp_path, LAP, [alarm(1.0, text="a\x00b\x1b[2J\ud83d"[:6])]), tmp_path)
    assert root.findtext("g:wpt/g:desc", namespaces=GPX) == "a�b�[2"
