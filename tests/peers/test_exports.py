"""Exports of real drives before the programs that read such files."""

from __future__ import annotations

import json
import shutil
import sys
import zipfile
from pathlib import Path
from typing import Any

import pytest

from tests.peers.conftest import Tally
from tests.peers.environment import PYTHON
from tests.peers.messages import compared, recorded
from tests.peers.programs import output_of
from tests.peers.test_bridge import DRIVES, every_drive, true_messages

HERE = Path(__file__).parent
positioned = pytest.mark.parametrize("drive", ["ROS 1", "ROS 2"])  # that of the laser has no position
BAGS = pytest.mark.parametrize("compression", ["none", "bz2", "lz4"])


async def exported(recordings: Path, drive: str, folder: Path, format: str, *options: str) -> Path:
    """The file that `catgraph export` makes of a real drive; a zip is unpacked into a folder."""
    source = recordings / DRIVES[drive]
    if not source.exists():
        pytest.skip(f"no {source}")
    out = folder / f"drive.{format}"
    command = ("-m", "server", "export", str(source), "--format", format, "--out", str(out), *options)
    code, printed = await output_of(sys.executable, *command, within_s=200)
    assert code == 0, printed[-2000:]
    if not zipfile.is_zipfile(out):
        return out
    with zipfile.ZipFile(out) as packed:
        packed.extractall(folder / "unpacked")
    return folder / "unpacked"


async def printed_json(*command: str | Path, within_s: float = 120) -> Any:
    """The JSON that a program printed last."""
    code, printed = await output_of(*command, within_s=within_s)
    assert code == 0, printed[-2000:]
    return json.loads(printed.splitlines()[-1])


def node(script: str) -> tuple[str, Path]:
    return shutil.which("node") or "node", HERE / script


def tables(folder: Path) -> list[Path]:
    found = sorted(folder.rglob("*.csv"))
    assert found
    return found


# -- bags ---


@every_drive
@BAGS
@pytest.mark.peers("@foxglove/rosbag")
@pytest.mark.timeout(400)
async def test_foxgloves_reader_of_bags(
    drive: str, compression: str, tally: Tally, recordings: Path, tmp_path: Path
) -> None:
    bag = await exported(recordings, drive, tmp_path, "bag", "--compression", compression)
    found = await printed_json(*node("rosbag_reader.mjs"), bag)
    true = true_messages(recordings / DRIVES[drive])
    tally.tried(sum(row["count"] for row in true.values()))
    for finding in compared(found["topics"], true):
        tally.found(f"{drive} {compression}: {finding}")
    assert tally.unexplained == []


@pytest.mark.parametrize(
    ("drive", "format"), [*((drive, "bag") for drive in DRIVES), ("ROS 2", "ros2")]
)  # a drive of ROS 1 is refused as ROS 2
@pytest.mark.peers("rosbags")
@pytest.mark.timeout(400)
async def test_rosbags(drive: str, format: str, tally: Tally, recordings: Path, tmp_path: Path) -> None:
    out = await exported(recordings, drive, tmp_path, format)
    if format == "ros2":
        (out,) = [path.parent for path in out.rglob("metadata.yaml")]
    true = true_messages(recordings / DRIVES[drive])
    tally.tried(sum(row["count"] for row in true.values()))
    for finding in compared(recorded(out), true):
        tally.found(f"{drive} {format}: {finding}")
    assert tally.unexplained == []


# -- positions ---


@positioned
@pytest.mark.parametrize("format", ["gpx", "geojson"])
@pytest.mark.peers("GDAL")
@pytest.mark.timeout(300)
async def test_gdal(drive: str, format: str, tally: Tally, recordings: Path, tmp_path: Path) -> None:
    out = await exported(recordings, drive, tmp_path, format)
    code, printed = await output_of("ogrinfo", "-ro", "-al", "-so", out, within_s=120)
    counts = [int(line.rpartition(":")[2]) for line in printed.splitlines() if line.startswith("Feature Count:")]
    tally.tried(sum(counts))
    for line in printed.splitlines():
        if line.startswith(("ERROR", "Warning")):
            tally.found(line)
    assert tally.unexplained == []
    assert code == 0
    assert sum(counts) > (100 if format == "gpx" else 0), printed[:2000]  # points; one line


@positioned
@pytest.mark.peers("gpxpy")
@pytest.mark.timeout(300)
async def test_gpxpy(drive: str, tally: Tally, recordings: Path, tmp_path: Path) -> None:
    out = await exported(recordings, drive, tmp_path, "gpx")
    (found,) = await printed_json(PYTHON, HERE / "pypi_readers.py", "gpx", out)
    tally.tried(found["points"])
    if found["times"] != found["points"]:
        tally.found(f"{found['points'] - found['times']} points without a time")
    assert tally.unexplained == []
    assert found["length_m"] == pytest.approx(76, abs=4)  # the README of the recordings


@positioned
@pytest.mark.peers("GPX 1.1 schema")
@pytest.mark.timeout(300)
async def test_the_schema_of_gpx(drive: str, tally: Tally, recordings: Path, tmp_path: Path) -> None:
    out = await exported(recordings, drive, tmp_path, "gpx")
    tally.tried()
    for error in (await printed_json(PYTHON, HERE / "pypi_readers.py", "schema", out))[0]:
        tally.found(error)
    assert tally.unexplained == []


@positioned
@pytest.mark.peers("check-geojson")
@pytest.mark.timeout(300)
async def test_geojson(drive: str, tally: Tally, recordings: Path, tmp_path: Path) -> None:
    out = await exported(recordings, drive, tmp_path, "geojson")
    found = await printed_json(*node("geojson_reader.mjs"), out)
    tally.tried(found["features"] + len(found["issues"]))
    for issue in found["issues"]:
        tally.found(f"{issue['severity']}: {issue['message']}")
    assert tally.unexplained == []
    assert tally.run > 0


# -- tables ---


@every_drive
@pytest.mark.parametrize("format", ["csv", "report_csv"])
@pytest.mark.peers("csv-parse")
@pytest.mark.timeout(300)
async def test_a_strict_reader_of_rfc_4180(
    drive: str, format: str, tally: Tally, recordings: Path, tmp_path: Path
) -> None:
    out = await exported(recordings, drive, tmp_path, format)
    files = [out] if out.is_file() else tables(out)
    tally.tried(len(files))
    for file, rows in zip(files, await printed_json(*node("csv_reader.mjs"), *files), strict=True):
        if isinstance(rows, str):
            tally.found(f"{file.name}: {rows}")
        else:
            assert rows > 0
    assert tally.unexplained == []


@every_drive
@pytest.mark.peers("pandas")
@pytest.mark.timeout(300)
async def test_pandas(drive: str, tally: Tally, recordings: Path, tmp_path: Path) -> None:
    files = tables(await exported(recordings, drive, tmp_path, "csv"))
    tally.tried(len(files))
    for file, found in zip(files, await printed_json(PYTHON, HERE / "pypi_readers.py", "csv", *files), strict=True):
        if found["unnamed"]:
            tally.found(f"{file.name}: columns without a name")
        times = [kind for name, kind in zip(found["columns"], found["types"], strict=True) if str(name).endswith("_s")]
        if any(not kind.startswith(("float", "int")) for kind in times):
            tally.found(f"{file.name}: a time that is no number: {found}")
    assert tally.unexplained == []
