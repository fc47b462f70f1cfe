"""Recordings as tables."""

from __future__ import annotations

import csv
import io
import zipfile
from pathlib import Path
from typing import Any

import pytest

from monitor.signals import SIGNALS
from monitor.values import DriveMode
from server.bus.event_table import COLUMNS
from server.recording.export.columns import TABLES
from server.recording.export.export_format import ExportRefused, Outcome
from server.recording.export.formats.csv_zip import write_csv_zip
from server.recording.read.read import open_recording
from tests.server.recording.bags import BEGIN_S, Drive, Row, write_ros1, write_ros2
from tests.server.recording.export.ours import TOML, OurFile, Own, as_ours, event

TWIST, WRENCH, FLOAT = "geometry_msgs/msg/Twist", "geometry_msgs/msg/Wrench", "std_msgs/msg/Float32"
SCAN, FIX, DIAGNOSTICS = "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/NavSatFix", "diagnostic_msgs/msg/DiagnosticArray"
STAMP = {"stamp": {"sec": 1_600_000_000, "nanosec": 500_000_000}, "frame_id": "laser"}
NS = 10**9


def tables(path: Path) -> dict[str, list[list[str]]]:
    with zipfile.ZipFile(path) as packed:
        assert packed.testzip() is None
        return {
            name: list(csv.reader(io.StringIO(packed.read(name).decode(), newline="")))
            for name in packed.namelist()
            if name.endswith(".csv")
        }


def text(path: Path, name: str) -> str:
    with zipfile.ZipFile(path) as packed:
        return packed.read(name).decode()


def export(source: Path, path: Path) -> Outcome:
    with open_recording([source]) as recording:
        return write_csv_zip(recording, path)


def made(folder: Path, rows: list[Row], own: list[Own] | None = None) -> Path:
    return as_ours(write_ros1(folder / "in.bag", Drive(messages=rows)), folder / "ours.mcap", own or [])


def test_every_signal_has_a_table_with_its_units() -> None:
    assert TABLES.keys() == SIGNALS.keys()
    without = (
        "none in range",
        "status",
        "covariance type",
        "frame",
        "beams",
        "usable beams",
        "component",
        "level",
        "mode",
    )
    for name, table in TABLES.items():
        for column in table.columns:
            assert column.isascii(), (name, column)
            assert "[" in column or column in (*without, "message", "unit", "mode", "as sent"), (name, column)
        assert SIGNALS[name].about.endswith(".")


def test_a_mode_is_a_row_as_the_car_sent_it() -> None:
    assert list(TABLES["mode"].rows(DriveMode(mode="manual", text="AUTO_OFF"))) == [("manual", "AUTO_OFF")]


ROWS: list[Row] = [
    (0.0, "/catvehicle/vel", TWIST, {"linear": {"x": 1.5}}),
    (0.5, "/catvehicle/vel", TWIST, {"linear": {"x": float("nan")}}),  # has no value: no row
    (0.6, "/catvehicle/brake", WRENCH, {"force": {"x": 12.5}}),
    (0.7, "/catvehicle/steering", WRENCH, {"torque": {"z": -20.0}}),
    (0.8, "/DistanceEstimator/dist", FLOAT, {"data": 81.0}),
    (0.9, "/DistanceEstimator/dist", FLOAT, {"data": 7.25}),
    (
        1.0,
        "/scan",
        SCAN,
        {
            "header": STAMP,
            "angle_min": -0.5,
            "angle_max": 0.5,
            "angle_increment": 0.5,
            "range_min": 0.1,
            "range_max": 80.0,
            "ranges": [float("inf"), 4.0, float("nan")],
        },
    ),
    (1.1, "/gps_fix", FIX, {"header": STAMP, "latitude": 32.25, "longitude": -110.75, "altitude": 700.0}),
    (
        1.2,
        "/diagnostics",
        DIAGNOSTICS,
        {"status": [{"name": "=cmd|' /C calc'!A0", "level": 2, "message": "-1+1"}, {"name": "gps", "message": "@x"}]},
    ),
    (1.3, "/other", "std_msgs/msg/String", {"data": "x"}),
]


def test_one_tidy_table_a_signal(tmp_path: Path) -> None:
    outcome = export(made(tmp_path, ROWS), tmp_path / "out.zip")
    found = tables(tmp_path / "out.zip")
    assert set(found) == {
        f"{n}.csv" for n in ("speed", "brake", "steering", "distance", "scan", "position", "diagnostics")
    }
    head = ["time", "since start [s]", "stamp by the car [s since 1970]"]
    assert found["speed.csv"] == [
        [*head, "speed [m/s]", "yaw rate [rad/s]"],
        ["2023-11-14T22:13:20.000000Z", "0.000000", "", "1.5", "0.0"],
    ]
    assert found["brake.csv"][1][1:] == ["0.600000", "", "12.5"]
    assert found["steering.csv"][1][3:] == ["-20.0"]
    assert [row[3:] for row in found["distance.csv"]] == [
        ["distance [m]", "none in range"],
        ["", "True"],
        ["7.25", "False"],
    ]
    assert found["scan.csv"][1][2:7] == ["1600000000.500000", "3", "1", "4.0", "0.0"]
    assert found["position.csv"][1][3:7] == ["32.25", "-110.75", "700.0", "0"]
    assert [row[3:] for row in found["diagnostics.csv"][1:]] == [
        ["'=cmd|' /C calc'!A0", "2", "'-1+1"],
        ["gps", "0", "'@x"],
    ]
    assert outcome.entries == sum(len(rows) - 1 for rows in found.values())
    assert any("/other (std_msgs/String, 1 messages) fills no signal" in note for note in outcome.notes)
    assert any("1 of 2 messages for speed were invalid" in note for note in outcome.notes)


def test_numbers_are_as_the_car_sent_them(recordings: Path, tmp_path: Path) -> None:
    """Every value of a real drive, to the last digit, against the drive's own tables."""
    export(recordings / "catvehicle_2016-06-01.bag", tmp_path / "out.zip")
    ours = tables(tmp_path / "out.zip")
    with (recordings / "catvehicle_2016-06-01_csv" / "catvehicle-vel.csv").open() as file:
        theirs = list(csv.DictReader(file))
    speeds = [float(row[3]) for row in ours["speed.csv"][1:]]
    column = next(name for name in theirs[0] if name.endswith("linear.x") or name == "x")
    assert speeds == [float(row[column]) for row in theirs]
    assert len(ours["distance.csv"]) - 1 == 4190


@pytest.mark.parametrize("version", [1, 2])
def test_both_versions_of_ros_give_the_same_tables(tmp_path: Path, version: int) -> None:
    rows = [row for row in ROWS if row[1] in ("/catvehicle/vel", "/scan", "/gps_fix")]
    write = write_ros1 if version == 1 else write_ros2
    export(write(tmp_path / f"in{'.bag' if version == 1 else ''}", Drive(messages=rows)), tmp_path / "out.zip")
    found = tables(tmp_path / "out.zip")
    assert [row[3] for row in found["speed.csv"][1:]] == ["1.5"]
    assert found["scan.csv"][1][2:7] == ["1600000000.500000", "3", "1", "4.0", "0.0"]


def test_the_log_the_phone_and_the_settings_are_beside_them(tmp_path: Path) -> None:
    begin = BEGIN_S * NS
    own: list[Own] = [
        (begin, "/catgraph/settings", {"version": 1, "profile": "catvehicle", "toml": TOML, "in_force": {}}),
        (begin + NS, "/catgraph/settings", {"version": 2, "toml": TOML.replace("3.0", "4.0"), "in_force": {}}),
        (begin + NS // 2, "/catgraph/alarms", event(7, BEGIN_S * 1000 + 500, "raised", text="+3.2 m/s", measured=None)),
        (begin + NS, "/catgraph/alarms", event(8, BEGIN_S * 1000 + 900, "acknowledged", by="=Ann")),
        (
            begin + NS,
            "/catgraph/phone",
            {"phone": "9c", "by": "Ann", "why": None, "fix": {"lat_deg": 32.5, "lon_deg": -110.5, "accuracy_m": 5.0}},
        ),
        (begin + NS, "/catgraph/phone", {"phone": "9c", "by": "Ann", "why": "denied", "fix": None}),
        (begin + NS, "/catgraph/operator", {"kind": "pause", "by": "Ann", "ok": False, "reason": "no", "id": 4}),
    ]
    export(made(tmp_path, ROWS, own), tmp_path / "out.zip")
    found = tables(tmp_path / "out.zip")
    log = [dict(zip(COLUMNS, row, strict=True)) for row in found["alarms.csv"][1:]]
    assert [(row["n"], row["time"], row["change"], row["text"], row["by"]) for row in log] == [
        ("7", "2023-11-14T22:13:20.500+00:00", "raised", "'+3.2 m/s", ""),
        ("8", "2023-11-14T22:13:20.900+00:00", "acknowledged", "", "'=Ann"),
    ]
    assert [row[3:8] for row in found["phone.csv"][1:]] == [
        ["9c", "Ann", "32.5", "-110.5", "5.0"],
        ["9c", "Ann", "", "", ""],
    ]
    assert found["phone.csv"][2][-2] == "denied"
    assert found["operator.csv"][1][3:] == ["pause", "Ann", "False", "no", '{"id":4}']
    assert text(tmp_path / "out.zip", "settings.toml") == TOML
    assert "max_mps = 4.0" in text(tmp_path / "out.zip", "settings from 2023-11-14T221321Z.toml")


def test_each_change_of_the_settings_is_there_also_one_that_returns_and_several_of_one_moment(tmp_path: Path) -> None:
    begin, stricter, strictest = round(BEGIN_S * NS), TOML + "# stricter\n", TOML + "# strictest\n"
    changes = [(0.0, TOML), (1.0, stricter), (1.5, strictest), (2.0, strictest), (3.0, TOML)]
    changes += [(4.0, text) for text in (stricter, TOML, strictest, TOML)]
    own = [(begin + round(at_s * NS), "/catgraph/settings", {"version": 1, "toml": toml}) for at_s, toml in changes]
    export(made(tmp_path, ROWS, own), tmp_path / "out.zip")
    with zipfile.ZipFile(tmp_path / "out.zip") as packed:
        found = {name: packed.read(name).decode() for name in packed.namelist() if name.endswith(".toml")}
    assert found == {
        "settings.toml": TOML,
        "settings from 2023-11-14T221321Z.toml": stricter,
        "settings from 2023-11-14T221321.500000Z.toml": strictest,
        "settings from 2023-11-14T221323Z.toml": TOML,
        "settings from 2023-11-14T221324Z.toml": stricter,
        "settings from 2023-11-14T221324.000000Z.toml": TOML,
        "settings from 2023-11-14T221324.000000-2Z.toml": strictest,
        "settings from 2023-11-14T221324.000000-3Z.toml": TOML,
    }


def test_the_readme_tells_what_is_there_and_what_is_not(tmp_path: Path) -> None:
    export(made(tmp_path, ROWS), tmp_path / "out.zip")
    readme = text(tmp_path / "out.zip", "README.txt")
    assert "Began:      2023-11-14 22:13:20 UTC" in readme
    assert "Length:     1.3 s" in readme
    assert "speed.csv" in readme
    assert "speed is /catvehicle/vel (geometry_msgs/Twist)" in readme
    assert "No alarm log was recorded" in readme
    assert "/other (std_msgs/String, 1 messages) fills no signal and has no table." in readme
    assert "An empty cell means: not known. It never means 0." in readme


def test_a_simulator_s_tyre_angle_is_percent_as_on_the_page(tmp_path: Path) -> None:
    toml = 'profile = "catvehicle-sim"\n'
    rows: list[Row] = [(0.0, "/catvehicle/steering", WRENCH, {"torque": {"z": 0.0536}})]
    own: list[Own] = [(BEGIN_S * NS, "/catgraph/settings", {"version": 1, "toml": toml, "in_force": {}})]
    export(made(tmp_path, rows, own), tmp_path / "out.zip")
    assert float(tables(tmp_path / "out.zip")["steering.csv"][1][3]) == pytest.approx(-10.0)


def test_a_choice_of_topic_counts_from_its_moment(tmp_path: Path) -> None:
    """As for the operator: the speed is that of the topic which was chosen at the time."""
    rows: list[Row] = []
    for n in range(20):
        for topic, speed in (("/catvehicle/vel", 1.0), ("/other/vel", 2.0)):
            twist = {"linear": {"x": speed, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.0}}
            rows.append((n / 10, topic, "geometry_msgs/msg/Twist", twist))
    chosen = '[topics]\nspeed = "/other/vel"\n'
    own: list[Own] = [
        (BEGIN_S * NS, "/catgraph/settings", {"version": 1, "toml": "", "in_force": {}}),
        (BEGIN_S * NS + NS, "/catgraph/settings", {"version": 2, "toml": chosen, "in_force": {}}),
    ]
    export(made(tmp_path, rows, own), tmp_path / "out.zip")
    speeds = [float(row[3]) for row in tables(tmp_path / "out.zip")["speed.csv"][1:]]
    assert set(speeds[:9]) == {1.0}
    assert set(speeds[-9:]) == {2.0}
    assert len(speeds) == 20


def test_a_recording_with_nothing_in_it_is_refused(tmp_path: Path) -> None:
    source = write_ros1(tmp_path / "in.bag", Drive(messages=[(0.0, "/other", "std_msgs/msg/String", {"data": "x"})]))
    with pytest.raises(ExportRefused, match="Nothing in this recording"):
        export(source, tmp_path / "out.zip")
    assert [path.name for path in tmp_path.iterdir()] == ["in.bag"]  # and no table is left lying about


def test_what_is_no_event_spoils_nothing(tmp_path: Path) -> None:
    odd: list[Any] = [{}, {"at_ms": "x", "change": 3}, {"at_ms": 1e300, "change": "raised", "alarm": None}]
    ours = OurFile(tmp_path / "ours.mcap")
    for row in odd:
        ours.own(BEGIN_S * NS, "/catgraph/alarms", row)
    ours.own(BEGIN_S * NS, "/catgraph/alarms", event(1, BEGIN_S * 1000, "connected", None))
    ours.own(BEGIN_S * NS, "/catgraph/phone", {"phone": 3, "fix": [1]})
    export(ours.close(), tmp_path / "out.zip")
    found = tables(tmp_path / "out.zip")
    assert [row[2] for row in found["alarms.csv"][1:]] == ["connected"]
    assert len(found["phone.csv"]) == 2
