"""Which types are subscribed to as CBOR: exactly those that real servers delivered so."""

from __future__ import annotations

import asyncio
import json
import time
from pathlib import Path
from typing import Any

import pytest

from server.app.config import Config
from server.judge.message import RosVersion
from server.judge.signals import TOPICS
from server.vehicle.type_definitions import fit_for_cbor
from server.vehicle.vehicle import Vehicle
from tests.server.cars import driving
from tests.server.conftest import serving
from tests.server.rosbridge_server.conftest import bridging
from tests.server.viewer import viewer
from tests.tree import RECORDINGS

TRANSCRIPTS = RECORDINGS / "rosbridge"
VERSIONS: tuple[RosVersion, ...] = (1, 2)
pytestmark = pytest.mark.world(n=4)

# Delivered by the server of the transcripts, and not by older ones, or not certain: JSON is taken.
CAUTIOUS: dict[RosVersion, set[str]] = {
    1: {"std_msgs/UInt64"},
    2: {"sensor_msgs/msg/JointState", "diagnostic_msgs/msg/DiagnosticArray"},
}


def transcript(version: RosVersion, name: str) -> list[dict[str, Any]]:
    path: Path = TRANSCRIPTS / f"ros{version}" / f"{name}.jsonl"
    if not path.exists():
        pytest.skip(f"{path} is not there")
    return [json.loads(line) for line in path.read_text().splitlines()]


def definitions(version: RosVersion) -> dict[str, str]:
    """Type → definition, as the real rosapi gave them."""
    for line in transcript(version, "discover"):
        if line.get("dir") == "in" and "typedefs_full_text" in line["text"]:
            values = json.loads(line["text"])["values"]
            return dict(zip(values["types"], values["typedefs_full_text"], strict=True))
    raise AssertionError("no definitions")


def delivered(version: RosVersion) -> dict[str, int]:
    """Type → how many messages came after it was subscribed to as CBOR."""
    counts: dict[str, int] = {}
    type = ""
    for line in transcript(version, "subscribe_cbor"):
        if line.get("dir") == "out":
            operation = json.loads(line["text"])
            if operation["op"] == "subscribe":
                type = operation["type"]
                counts.setdefault(type, 0)
        elif line.get("dir") == "in":
            counts[type] += 1
    return counts


@pytest.mark.parametrize("version", VERSIONS)
def test_cbor_is_chosen_for_what_a_real_bridge_delivers_and_for_nothing_else(version: RosVersion) -> None:
    counts = delivered(version)
    fit = fit_for_cbor(counts, definitions(version), version)
    assert len(counts) >= 29
    assert {type for type in fit if not counts[type]} == set()
    assert {type for type, count in counts.items() if count} - fit == CAUTIOUS[version]


@pytest.mark.parametrize("version", VERSIONS)
def test_what_the_bridge_does_not_define_is_known_by_the_distribution(version: RosVersion) -> None:
    spelled = "/msg/" if version == 2 else "/"
    types = [f"sensor_msgs{spelled}{name}" for name in ("LaserScan", "Imu", "NavSatFix", "PointCloud2")]
    types += [f"nav_msgs{spelled}Path", f"std_msgs{spelled}Empty", f"car_msgs{spelled}Unknown"]
    assert fit_for_cbor(types, {}, version) == {types[0], types[3], types[4], types[5]}


@pytest.mark.parametrize(
    ("text", "fit"),
    [
        ("float64 x\nuint8[] raw\nchar c\nstring s\nbool b\nint8[] i\n", (True, True)),
        ("float64[9] covariance\n", (False, False)),
        ("uint8[16] uuid\n", (False, False)),
        ("string[] names\n", (False, False)),
        ("bool[] flags\n", (False, False)),
        ("byte level\n", (True, False)),
        ("byte[] raw\n", (True, False)),
        ("float64[<=3] few\n", (False, False)),
        ("string<=8 short\n", (False, False)),
        ("wstring wide\n", (False, False)),
        ("Inner[2] two\n================================================================================\n"
         "MSG: car_msgs/Inner\nfloat64 x\n", (False, False)),
        ("Inner[] many\n================================================================================\n"
         "MSG: car_msgs/Inner\nfloat64 x\n", (True, True)),
        ("Inner[] many\n================================================================================\n"
         "MSG: car_msgs/Inner\nfloat64[3] x\n", (False, False)),
        ("Inner one\n", (False, False)),  # and its definition is not there
        ("this is no definition [", (False, False)),
    ],
)  # fmt: skip
def test_every_field_counts(text: str, fit: tuple[bool, bool]) -> None:
    for version, expected in zip(VERSIONS, fit, strict=True):
        found = fit_for_cbor(["car_msgs/Thing"], {"car_msgs/Thing": text}, version)
        assert (found == {"car_msgs/Thing"}) is expected, version
    both = fit_for_cbor(["car_msgs/Thing"], {"car_msgs/Thing": text}, None)
    assert (both == {"car_msgs/Thing"}) is all(fit)


def test_what_is_requested_as_cbor_before_definitions_are_known_is_fit() -> None:
    for row in TOPICS:
        if row.compression == "cbor":
            for type in row.types:
                assert fit_for_cbor([type], {}, None) == {type}


@pytest.mark.field
def test_a_definition_that_holds_too_much_is_not_fit_and_takes_no_time() -> None:
    parts = ["L1 a\nL1 b\n"]
    parts += [f"MSG: car_msgs/L{n}\nL{n + 1} a\nL{n + 1} b\n" for n in range(1, 30)]
    text = f"{'=' * 80}\n".join([*parts, "MSG: car_msgs/L30\nfloat64 x\n"])
    itself = "Thing one\nThing two\n"
    for definition in (text, itself, "float64 x\n" * 20_000):
        began_s = time.process_time()
        assert fit_for_cbor(["car_msgs/Thing"], {"car_msgs/Thing": definition}, 1) == set()
        assert time.process_time() - began_s < 5.0


@pytest.mark.virtual_time
async def test_what_holds_too_much_to_be_read_as_cbor_is_recorded_as_json(tmp_path: Path) -> None:
    """A path of 9000 poses, or a polygon of 60 000 points: it was counted as unreadable, and named nowhere."""
    polygon = {"points": [{"x": 1.0, "y": 2.0, "z": 0.5}] * 60_000}

    async with bridging(ros_version=1) as (bridge, port):
        bridge.advertise("/catvehicle/vel", "geometry_msgs/Twist")
        bridge.advertise("/polygon", "geometry_msgs/Polygon")

        async def draw() -> None:
            while True:
                await asyncio.sleep(1.0)
                bridge.publish("/polygon", polygon)

        config = Config(vehicles=(Vehicle(name="car", address=f"ws://127.0.0.1:{port}"),), data=tmp_path)
        async with driving(bridge), serving(config) as base, viewer(base) as one:
            drawing = asyncio.create_task(draw())
            try:
                await one.state(lambda s: s["recording"]["as_json"] >= 2, 30.0)
            finally:
                drawing.cancel()
            assert one.states[-1]["link"]["unreadable_frames"] >= 1
            assert any(event["text"].startswith("/polygon is now received as JSON") for event in one.events)
