"""An export that leaves anything out answers 1 and names it; one that leaves nothing out answers 0."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import orjson
import pytest

from server.cli.main import main
from server.mail import mail_text
from server.mail.pack import Pack, Stretch
from server.recording.export import make_export
from server.recording.export.formats import FORMATS
from tests.server.mail.mailing import Shelf, mailing, order, over, settings
from tests.server.mail.post import posting
from tests.server.recording.export.ours import OurFile
from tests.server.recording.made import record

pytestmark = pytest.mark.world(n=5)
BEGIN_NS = 1_790_000_000 * 10**9
FIX = "sensor_msgs/NavSatFix"
SPEED = "geometry_msgs/Twist"

NOTICES = {  # what is to be known besides, though nothing is missing
    "forms": "catgraph export: The interventions are not known: the mode of the car was not recorded.\n",
}


def fix(lat_deg: float) -> dict[str, Any]:
    return {"status": {"status": 0}, "latitude": lat_deg, "longitude": -110.0, "altitude": 700.0,
            "position_covariance": [0.0] * 9, "position_covariance_type": 0}  # fmt: skip


def twist(speed_mps: Any) -> dict[str, Any]:
    zeros = {"x": 0.0, "y": 0.0, "z": 0.0}
    return {"linear": zeros | {"x": speed_mps}, "angular": zeros}


def drive(folder: Path, rows: list[tuple[str, str, Any]], *, profile: str = "ros1") -> Path:
    """A recording of ours whose messages were kept as JSON, one each 0.1 s."""
    made = OurFile(folder / "car_1.mcap", profile=profile)
    for n, (topic, type, message) in enumerate(rows):
        raw = message if isinstance(message, bytes) else orjson.dumps(message)
        made.write(BEGIN_NS + n * 10**8, topic, type, "{}", "json", raw)
    return made.close()


GOOD = [("/gps_fix", FIX, fix(32.0 + n / 1e5)) for n in range(20)] + [("/catvehicle/vel", SPEED, twist(1.5))] * 20


def exported(path: Path, format: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    out = path.parent / f"out.{format}"
    code = main(["export", str(path), "--format", format, "--out", str(out)])
    assert out.exists() is (code != 2)
    return code, capsys.readouterr().err


@pytest.mark.parametrize("format", sorted({*FORMATS} - {"ros2"}))
def test_nothing_left_out_is_answered_with_0(tmp_path: Path, capsys: pytest.CaptureFixture[str], format: str) -> None:
    path = record(tmp_path / "car_1.mcap", alarms=[(5.0, "critical")])
    assert exported(path, format, capsys) == (0, NOTICES.get(format, ""))


@pytest.mark.parametrize(
    ("format", "row", "named"),
    [
        ("csv", ("/tf", "tf2_msgs/TFMessage", {"transforms": []}), "/tf (tf2_msgs/TFMessage, 1 messages)"),
        ("csv", ("/catvehicle/vel", SPEED, twist("fast")), "1 of 21 messages for speed"),
        ("csv", ("/gps_fix", FIX, b"{"), "1 messages on /gps_fix could not be decoded"),
        ("gpx", ("/gps_fix", FIX, b"{"), "1 messages on /gps_fix could not be decoded"),
        ("gpx", ("/gps_fix", FIX, fix(32.0) | {"latitude": "north"}), "1 of 21 messages for position"),
        ("geojson", ("/gps_fix", FIX, b"{"), "1 messages on /gps_fix could not be decoded"),
        ("geojson", ("/catgraph/phone", "", {"phone": "a", "fix": {"lat_deg": 95.0, "lon_deg": 0.0}}), "1 positions"),
        ("html", ("/gps_fix", FIX, b"{"), "1 messages on /gps_fix could not be decoded"),
    ],
)  # fmt: skip
def test_what_is_left_out_is_named_and_answered_with_1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], format: str, row: tuple[str, str, Any], named: str
) -> None:
    code, output = exported(drive(tmp_path, [*GOOD, row]), format, capsys)
    assert code == 1, output
    assert named in output
    assert output.endswith("catgraph export: the export is incomplete.\n")


@pytest.mark.parametrize(("format", "profile"), [("bag", "ros1"), ("bag", "ros2"), ("ros2", "ros2")])
def test_a_bag_without_the_messages_kept_as_json_is_not_whole(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], format: str, profile: str
) -> None:
    made = OurFile(tmp_path / "car_1.mcap", profile=profile)
    kind, encoding, raw = (
        ("std_msgs/Int32", "ros1", b"\7\0\0\0") if profile == "ros1" else
        ("std_msgs/msg/Int32", "cdr", b"\0\1\0\0\7\0\0\0")
    )  # fmt: skip
    for n in range(100):
        made.write(BEGIN_NS + n * 10**8, "/n", kind, "int32 data", encoding, raw)
        made.write(BEGIN_NS + n * 10**8, "/tf", "tf2_msgs/TFMessage", "{}", "json", b'{"transforms":[]}')
    code, output = exported(made.close(), format, capsys)
    assert code == 1
    assert "/tf (100 messages) is left out" in output


@pytest.mark.field
async def test_a_server_s_export_reports_whether_it_is_whole(tmp_path: Path) -> None:
    path = drive(tmp_path, [*GOOD, ("/tf", "tf2_msgs/TFMessage", {"transforms": []})])
    made = await make_export([path], "csv", tmp_path)
    assert made.is_whole is False
    assert made.notes == ["/tf (tf2_msgs/TFMessage, 1 messages) fills no signal and has no table."]
    assert (await make_export([path], "gpx", tmp_path)).is_whole is True


async def test_a_mail_names_what_is_not_in_it(tmp_path: Path) -> None:
    shelf = Shelf(tmp_path / "recordings")
    shelf.put("car_1")
    shelf.notes = ["/tf (27331 messages) is left out: it was recorded as JSON."]
    pack = Pack(path=tmp_path, name="car_1.zip", size_bytes=1, sha256="0")
    (text,) = mail_text.attached("Hello", ["car_1"], "csv", pack, [Stretch(start=0, length=1, name="x")], shelf.notes)
    assert "Not all of the recording is in the file:\n- /tf (27331 messages) is left out" in text
    linked = mail_text.linked("Hello", ["car_1"], "csv", pack, ["http://x"], [f"note {n}" for n in range(40)])
    assert "- note 29\n- and 10 more." in linked
    async with posting(tmp_path / "post") as post, mailing(tmp_path / "mail", shelf) as mailer:
        await mailer.change(settings(post.port))
        await over(mailer, (await mailer.order("key-0001", order("car_1", format="csv"))).n)
        body = post.mails()[0].get_body(("plain",))
        assert body is not None
        assert "car_1: /tf (27331 messages) is left out" in body.get_content()
