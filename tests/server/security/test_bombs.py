"""Files of some kilobytes that would take gigabytes or hours: each is refused or read within bounds, in a sentence."""

from __future__ import annotations

import os
import re
import resource
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import orjson
import pytest

from server.recording import rosbags_bounds, unpack
from server.recording.chunks import LARGEST_CHUNK
from server.recording.folder import RecordingsFolder
from server.recording.read import RecordingUnreadable, open_recording
from server.recording.recover import recover
from server.recording.unpack import MOST_BYTES
from tests.server.recording import bombs
from tests.server.recording.bags import Drive, write_ros2

pytestmark = pytest.mark.world(n=24)

G = 1 << 30
LARGEST_MB = 250  # what the process may take; one that unpacks takes gigabytes
LONGEST_S = 20.0
Make = Callable[[Path], Path]

BOMBS: dict[str, tuple[Make, str]] = {
    "bz2": (lambda to: bombs.bag(to / "a.bag", "bz2", G + (1 << 20)), r"would take more than \d+ MB, unpacked"),
    "lz4": (lambda to: bombs.bag(to / "a.bag", "lz4", 2 * G), r"would take more than \d+ MB, unpacked"),
    "bz2 that lies": (lambda to: bombs.bag(to / "a.bag", "bz2", G + (1 << 20), says=1000), "cannot be unpacked"),
    "lz4 that lies": (lambda to: bombs.bag(to / "a.bag", "lz4", 2 * G, says=1000), "cannot be unpacked"),
    "mcap zstd": (lambda to: bombs.mcap(to / "a.mcap", "zstd", 4 * G), "larger, unpacked, than may be read"),
    "mcap lz4": (lambda to: bombs.mcap(to / "a.mcap", "lz4", 2 * G), "larger, unpacked, than may be read"),
    "mcap zstd that lies": (lambda to: bombs.mcap(to / "a.mcap", "zstd", 4 * G, says=1000), "none of its 1 parts"),
    "mcap lz4 that lies": (lambda to: bombs.mcap(to / "a.mcap", "lz4", 2 * G, says=1000), "none of its 1 parts"),
    "mcap of 2^60 bytes": (lambda to: bombs.mcap(to / "a.mcap", "zstd", 1 << 20, says=1 << 60), "larger, unpacked"),
    "mcap never closed": (
        lambda to: bombs.mcap(to / "a.mcap", "zstd", 4 * G, is_closed=False),
        "none of its 1 parts can be read",
    ),
    "mcap of ROS 2": (lambda to: bombs.mcap(to / "a.mcap", "zstd", 4 * G, profile="ros2"), "larger, unpacked"),
    "mcap of ROS 2 without an index": (
        lambda to: bombs.mcap(to / "a.mcap", "zstd", 4 * G, profile="ros2", has_index=False),
        r"would take more than \d+ MB, unpacked",
    ),
    "mcap with an index that points outside": (
        lambda to: bombs.mcap(to / "a.mcap", "zstd", 1 << 20, chunk_at=1 << 40),
        "none of its 1 parts",
    ),
    "mcap with an index that points below zero": (
        lambda to: bombs.mcap(to / "a.mcap", "zstd", 1 << 20, chunk_at=(1 << 64) - 1),
        "none of its 1 parts",
    ),
    "mcap with 2^60 messages": (
        lambda to: bombs.mcap(to / "a.mcap", "zstd", 1 << 20, messages=1 << 60),
        "none of its 1 parts|has no message|0 bytes|its records",
    ),
}


def run(arguments: Sequence[str], stdin: bytes = b"") -> tuple[int, str, float]:
    """Exit code, all that it said, and the most memory it took [MB] beyond ours, which it is born with.

    Fails where it takes longer than LONGEST_S.
    """
    with tempfile.TemporaryFile() as said, tempfile.TemporaryFile() as given:
        given.write(stdin)
        given.seek(0)
        process = subprocess.Popen([sys.executable, "-m", *arguments], stdin=given, stdout=said, stderr=said)
        ends_s = time.monotonic() + LONGEST_S
        while (found := os.wait4(process.pid, os.WNOHANG))[0] == 0:
            if time.monotonic() > ends_s:
                process.kill()
                process.wait()
                pytest.fail(f"{arguments} took longer than {LONGEST_S} s")
            time.sleep(0.02)  # wait4 has no time limit of its own
        process.returncode = os.waitstatus_to_exitcode(found[1])
        said.seek(0)
        own_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return process.returncode, said.read().decode(), max(0, found[2].ru_maxrss - own_kb) / 1024


@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_is_read_within_bounds_and_said(name: str, tmp_path: Path) -> None:
    make, expected = BOMBS[name]
    path = make(tmp_path)
    code, said, mb = run(["server", "check", str(path)])
    assert code == 2
    assert re.search(expected, said), said
    assert "Traceback" not in said
    assert mb < LARGEST_MB
    code, said, mb = run(["server.recording.survey"], bytes(path).hex().encode() + b"\n")
    assert re.search(expected, orjson.loads(said).get("problem", "")), said
    assert mb < LARGEST_MB


def test_an_export_of_a_bomb_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    path = bombs.mcap(tmp_path / "a.mcap", "zstd", 4 * G)
    for form in ("csv", "bag"):
        out = tmp_path / f"out.{form}"
        code, said, mb = run(["server", "export", "--format", form, "--out", str(out), str(path)])
        assert (code, out.exists()) == (2, False)
        assert "larger, unpacked, than may be read" in said
        assert mb < LARGEST_MB
    assert [found.name for found in tmp_path.iterdir()] == ["a.mcap"]


def test_a_bomb_that_a_killed_server_seems_to_have_left_is_kept_aside(tmp_path: Path) -> None:
    folder = RecordingsFolder(tmp_path)
    (tmp_path / "car").mkdir()
    left = tmp_path / "car" / "car_20261123T101010Z.mcap.writing"
    bombs.mcap(left, "zstd", LARGEST_CHUNK + (1 << 20), is_closed=False)
    assert list(folder.unfinished()) == [left]
    recovered = recover(left)
    assert recovered.aside is not None
    assert recovered.aside.exists()


def test_how_much_is_unpacked_depends_on_the_free_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(unpack, "free_bytes", lambda: 200 << 20)
    packed = bombs.zeros("lz4", 64 << 20)
    with pytest.raises(unpack.PartTooLarge, match="50 MB"):
        unpack.unpack("lz4", packed, 64 << 20)
    monkeypatch.setattr(unpack, "free_bytes", lambda: 400 << 20)
    assert len(unpack.unpack("lz4", packed, 64 << 20)) == 64 << 20
    monkeypatch.setattr(unpack, "free_bytes", lambda: None)
    assert unpack.allowed_bytes(MOST_BYTES) == MOST_BYTES


@pytest.mark.parametrize("kind", ["bz2", "lz4", "zstd"])
@pytest.mark.parametrize(("off", "is_right"), [(0, True), (-1, False), (1, False)])
def test_only_what_has_the_size_that_it_says_is_unpacked(kind: bombs.Kind, off: int, is_right: bool) -> None:
    size = 3 << 20
    packed = bombs.zeros(kind, size)
    if is_right:
        assert unpack.unpack(kind, packed, size) == bytes(size)
        return
    with pytest.raises((ValueError, EOFError, unpack.zstandard.ZstdError)):
        unpack.unpack(kind, packed, size + off)


# -- rosbag2's metadata ------------------------------------------------------------------------------------------------

LAUGHS = "a0: &a0 [l,l,l,l,l,l,l,l,l,l]\n" + "".join(
    f"a{n}: &a{n} [{','.join([f'*a{n - 1}'] * 10)}]\n" for n in range(1, 10)
)
MERGES = "m0: &m0 {k0: 1}\n" + "".join(f"m{n}: &m{n} {{<<: [{','.join([f'*m{n - 1}'] * 10)}]}}\n" for n in range(1, 9))


def metadata_of(to: Path) -> Path:
    twist = {"linear": {"x": 1.0}}
    drive = Drive(messages=[(n / 10, "/vel", "geometry_msgs/msg/Twist", twist) for n in range(20)])
    return write_ros2(to / "drive", drive) / "metadata.yaml"


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda text: "[" * 100_000, "nested too deeply"),
        (lambda text: "- " * 5000 + text, "nested too deeply"),
        (lambda text: LAUGHS + re.sub(r"storage_identifier:.*", "storage_identifier: *a9", text), "refers to parts"),
        (lambda text: LAUGHS + re.sub(r"compression_mode:.*", "compression_mode: *a9", text), "refers to parts"),
        (lambda text: MERGES + text, "refers to parts"),
        (lambda text: "x: [" + "1," * 1_500_000 + "1]\n" + text, "larger than 2 MB"),
        (lambda text: "x: [" + "1," * 900_000 + "1]\n" + text, "more than 100000 entries"),
        (lambda text: "x: " + "y" * 30_000_000 + "\n" + text, "larger than 2 MB"),
    ],
    ids=["deep", "dashes", "repr", "mode", "merges", "megabytes", "entries", "long line"],
)
def test_a_metadata_file_that_is_a_bomb_is_refused(change: Callable[[str], str], expected: str, tmp_path: Path) -> None:
    metadata = metadata_of(tmp_path)
    metadata.write_text(change(metadata.read_text()))
    code, said, mb = run(["server", "check", str(metadata.parent)])
    assert code == 2
    assert re.search(rf"metadata\.yaml cannot be read: .*({expected})", said), said
    assert mb < LARGEST_MB


def test_a_bag_of_files_packed_one_by_one_does_not_fill_the_disk(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    metadata = metadata_of(tmp_path)
    plain = next(metadata.parent.glob("*.mcap"))
    plain.with_name(plain.name + ".zstd").write_bytes(bombs.zeros("zstd", 4 * G))
    plain.unlink()
    text = re.sub(r"compression_mode:.*", "compression_mode: file", metadata.read_text())
    text = re.sub(r"compression_format:.*", "compression_format: zstd", text)
    metadata.write_text(re.sub(r"(\S+)\.mcap\b", r"\1.mcap.zstd", text))
    beside = tmp_path / "temporary"
    beside.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(beside))

    def free(_: Path) -> int:
        return 3 * G - sum(file.stat().st_size for file in beside.rglob("*") if file.is_file())

    most = 0

    def watched(path: Path) -> int:
        nonlocal most
        most = max(most, 3 * G - free(path))
        return free(path)

    monkeypatch.setattr(rosbags_bounds.space, "free_at", watched)
    with pytest.raises(RecordingUnreadable, match="does not fit on the disk"):
        open_recording([metadata.parent])
    assert 0 < most < 2 * G
    assert list(beside.iterdir()) == []


def test_a_message_that_unpacks_to_gigabytes_is_refused(tmp_path: Path) -> None:
    drive = Drive(messages=[(0.1, "/vel", "geometry_msgs/msg/Twist", {})], compression="zstd")
    folder = write_ros2(tmp_path / "drive", drive, storage="sqlite3")
    rows = sqlite3.connect(next(folder.glob("*.db3")))
    rows.execute("UPDATE messages SET data = ?", (bombs.zeros("zstd", 4 * G),))
    rows.commit()
    rows.close()
    code, said, _ = run(["server", "check", str(folder)])
    assert code == 2
    assert re.search(r"cannot be read: of a part of it, it would take more than \d+ MB, unpacked", said), said


def test_quality_of_service_that_refers_to_itself_without_end_is_not_known(tmp_path: Path) -> None:
    assert rosbags_bounds._bounded_qos(MERGES) == []
    assert rosbags_bounds._bounded_qos("- history: 1\n  depth: 5\n  reliability: 1\n  durability: 1\n" * 10_000) == []
