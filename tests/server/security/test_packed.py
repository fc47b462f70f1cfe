"""Files whose parts are larger, unpacked, than may be read: each is refused in a sentence. With a bound of 0.9 MB."""

from __future__ import annotations

import re
import sqlite3
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest
import zstandard

from server.cli.main import main
from server.recording import space
from server.recording.catalog.survey import survey
from server.recording.folder import RecordingsFolder
from server.recording.mcap.chunks import MAGIC
from server.recording.read import bag2_metadata, temporary_copy, unpack
from server.recording.read.read import RecordingUnreadable, open_recording
from server.recording.read.unpack import MOST_BYTES
from server.recording.recover import recover
from tests.server.recording import packed
from tests.server.recording.bags import Drive, write_ros2

pytestmark = pytest.mark.world(n=24)

MB = 1 << 20
BOUND_BYTES = 900_000
Make = Callable[[Path], Path]

TOO_LARGE: dict[str, tuple[Make, str]] = {
    "bz2": (lambda to: packed.bag(to / "a.bag", "bz2", MB), r"would take more than \d+ MB, unpacked"),
    "lz4": (lambda to: packed.bag(to / "a.bag", "lz4", MB), r"would take more than \d+ MB, unpacked"),
    "bz2 that lies": (lambda to: packed.bag(to / "a.bag", "bz2", MB, declared=1000), "cannot be unpacked"),
    "lz4 that lies": (lambda to: packed.bag(to / "a.bag", "lz4", MB, declared=1000), "cannot be unpacked"),
    "mcap zstd": (lambda to: packed.mcap(to / "a.mcap", "zstd", MB), "larger, unpacked, than may be read"),
    "mcap lz4": (lambda to: packed.mcap(to / "a.mcap", "lz4", MB), "larger, unpacked, than may be read"),
    "mcap zstd that lies": (lambda to: packed.mcap(to / "a.mcap", "zstd", MB, declared=1000), "none of its 1 parts"),
    "mcap lz4 that lies": (lambda to: packed.mcap(to / "a.mcap", "lz4", MB, declared=1000), "none of its 1 parts"),
    "mcap that declares too much": (
        lambda to: packed.mcap(to / "a.mcap", "zstd", MB, declared=2 * MB),
        "larger, unpacked, than may be read",
    ),
    "mcap never closed": (
        lambda to: packed.mcap(to / "a.mcap", "zstd", MB, is_closed=False),
        "none of its 1 parts can be read",
    ),
    "mcap of ROS 2": (lambda to: packed.mcap(to / "a.mcap", "zstd", MB, profile="ros2"), "larger, unpacked"),
    "mcap of ROS 2 without an index": (
        lambda to: packed.mcap(to / "a.mcap", "zstd", MB, profile="ros2", has_index=False),
        r"would take more than \d+ MB, unpacked",
    ),
    "mcap with an index that points outside": (
        lambda to: packed.mcap(to / "a.mcap", "zstd", MB, chunk_at=MB),
        "none of its 1 parts",
    ),
}


@pytest.fixture
def bound(monkeypatch: pytest.MonkeyPatch) -> None:
    """No part may have more than BOUND_BYTES."""
    monkeypatch.setattr(unpack, "UNASKED_BYTES", 0)
    monkeypatch.setattr(unpack, "free_bytes", lambda: int(BOUND_BYTES / unpack.FREE_PART))


@pytest.mark.usefixtures("bound")
@pytest.mark.parametrize("name", TOO_LARGE)
def test_a_part_beyond_the_bound_is_refused_and_said(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make, expected = TOO_LARGE[name]
    path = make(tmp_path)
    assert main(["check", str(path)]) == 2
    output = "".join(capsys.readouterr())
    assert re.search(expected, output), output
    assert "Traceback" not in output
    found = survey(path)
    assert re.search(expected, str(found.get("problem"))), found


@pytest.mark.usefixtures("bound")
def test_an_export_of_such_a_part_is_refused_and_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = packed.mcap(tmp_path / "a.mcap", "zstd", MB)
    for form in ("csv", "bag"):
        out = tmp_path / f"out.{form}"
        assert main(["export", "--format", form, "--out", str(out), str(path)]) == 2
        assert "larger, unpacked, than may be read" in "".join(capsys.readouterr())
        assert not out.exists()
    assert [found.name for found in tmp_path.iterdir()] == ["a.mcap"]


@pytest.mark.usefixtures("bound")
def test_one_that_a_killed_server_seems_to_have_left_is_kept_aside(tmp_path: Path) -> None:
    folder = RecordingsFolder(tmp_path)
    (tmp_path / "car").mkdir()
    left = tmp_path / "car" / "car_20261123T101010Z.mcap.writing"
    packed.mcap(left, "zstd", MB, is_closed=False)
    assert list(folder.unfinished()) == [left]
    recovered = recover(left)
    assert recovered.aside is not None
    assert recovered.aside.exists()


def test_how_much_is_unpacked_depends_on_the_free_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    size = 20 * MB
    monkeypatch.setattr(unpack, "free_bytes", lambda: 76 * MB)
    zeros = packed.zeros("lz4", size)
    with pytest.raises(unpack.PartTooLarge, match="19 MB"):
        unpack.unpack("lz4", zeros, size)
    monkeypatch.setattr(unpack, "free_bytes", lambda: 80 * MB)
    assert len(unpack.unpack("lz4", zeros, size)) == size
    monkeypatch.setattr(unpack, "free_bytes", lambda: None)
    assert unpack.allowed_bytes(MOST_BYTES) == MOST_BYTES


@pytest.mark.parametrize("kind", ["bz2", "lz4", "zstd"])
@pytest.mark.parametrize(("off", "is_right"), [(0, True), (-1, False), (1, False)])
def test_only_what_has_the_size_that_it_says_is_unpacked(kind: packed.Kind, off: int, is_right: bool) -> None:
    size = 3 << 20
    zeros = packed.zeros(kind, size)
    if is_right:
        assert unpack.unpack(kind, zeros, size) == bytes(size)
        return
    with pytest.raises((ValueError, EOFError, zstandard.ZstdError)):
        unpack.unpack(kind, zeros, size + off)


# -- rosbag2's metadata ------------------------------------------------------------------------------------------------


def metadata_of(to: Path) -> Path:
    twist = {"linear": {"x": 1.0}}
    drive = Drive(messages=[(n / 10, "/vel", "geometry_msgs/msg/Twist", twist) for n in range(20)])
    return write_ros2(to / "drive", drive) / "metadata.yaml"


NESTED = "[" * (bag2_metadata.DEEPEST + 1) + "]" * (bag2_metadata.DEEPEST + 1)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda text: f"x: {NESTED}\n{text}", "nested too deeply"),
        (lambda text: "- " * (bag2_metadata.DEEPEST + 1) + "x\n", "nested too deeply"),
        (lambda text: f"x: &one y\nz: *one\n{text}", "refers to parts"),
        (lambda text: "x: [" + "1," * 1000 + f"1]\n{text}", "more than 900 entries"),
        (lambda text: "x: " + "y" * bag2_metadata.MOST_METADATA + f"\n{text}", "larger than 2 MB"),
    ],
    ids=["deep", "dashes", "reference", "entries", "long line"],
)
def test_metadata_beyond_the_bounds_are_refused(
    change: Callable[[str], str],
    expected: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(bag2_metadata, "MOST_ENTRIES", 900)
    metadata = metadata_of(tmp_path)
    metadata.write_text(change(metadata.read_text()))
    assert main(["check", str(metadata.parent)]) == 2
    output = "".join(capsys.readouterr())
    assert re.search(rf"metadata\.yaml cannot be read: .*({expected})", output), output


def test_a_bag_of_files_packed_one_by_one_does_not_fill_the_disk(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A disk with 3 MB free, of which half is left free, and a file of 4 MB."""
    metadata = metadata_of(tmp_path)
    plain = next(metadata.parent.glob("*.mcap"))
    content = MAGIC + bytes(4 * MB)
    plain.with_name(plain.name + ".zstd").write_bytes(zstandard.ZstdCompressor().compress(content))
    plain.unlink()
    text = re.sub(r"compression_mode:.*", "compression_mode: file", metadata.read_text())
    text = re.sub(r"compression_format:.*", "compression_format: zstd", text)
    metadata.write_text(re.sub(r"(\S+)\.mcap\b", r"\1.mcap.zstd", text))
    beside = tmp_path / "temporary"
    beside.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(beside))
    monkeypatch.setattr(temporary_copy, "LEAVE_FREE", MB)
    monkeypatch.setattr(temporary_copy, "LOOK_EVERY", MB // 4)

    def free(_: Path) -> int:
        return 3 * MB - sum(file.stat().st_size for file in beside.rglob("*") if file.is_file())

    most = 0

    def watched(path: Path) -> int:
        nonlocal most
        most = max(most, 3 * MB - free(path))
        return free(path)

    monkeypatch.setattr(space, "free_at", watched)
    with pytest.raises(RecordingUnreadable, match="does not fit on the disk"):
        open_recording([metadata.parent])
    assert 0 < most < 2.5 * MB
    assert list(beside.iterdir()) == []


@pytest.mark.usefixtures("bound")
def test_a_message_beyond_the_bound_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    drive = Drive(messages=[(0.1, "/vel", "geometry_msgs/msg/Twist", {})], compression="zstd")
    folder = write_ros2(tmp_path / "drive", drive, storage="sqlite3")
    rows = sqlite3.connect(next(folder.glob("*.db3")))
    rows.execute("UPDATE messages SET data = ?", (packed.zeros("zstd", MB),))
    rows.commit()
    rows.close()
    assert main(["check", str(folder)]) == 2
    output = "".join(capsys.readouterr())
    assert re.search(r"cannot be read: of a part of it, it would take more than \d+ MB, unpacked", output), output


def test_quality_of_service_beyond_the_bounds_is_not_known() -> None:
    one = "- history: 1\n  depth: 5\n  reliability: 1\n  durability: 1\n"
    assert bag2_metadata.is_latched(one)
    assert not bag2_metadata.is_latched("- &one {durability: 1}\n- *one\n")
    assert not bag2_metadata.is_latched(one * (bag2_metadata.MOST_QOS // len(one) + 1))
    assert not bag2_metadata.is_latched("[" * 40 + "]" * 40)
