"""What is attached: parts join to the whole by `cat`, the whole is a zip of the files, the same each time."""

from __future__ import annotations

import hashlib
import shutil
import subprocess
import threading
import zipfile
from pathlib import Path

import pytest

from server.mail import mail_text
from server.mail.compose import Stopped
from server.mail.pack import NoRoom, Pack, cut, need_room, pack
from tests.server.mail.mailing import START_MS


def packed(tmp_path: Path, *files: Path, name: str = "drive") -> Pack:
    into = tmp_path / f"pack-{len(list(tmp_path.iterdir()))}.zip"
    return pack(files, into, name, START_MS, lambda _: None, threading.Event())


def noise(path: Path, size: int) -> Path:
    path.write_bytes(hashlib.shake_256(path.name.encode()).digest(size))
    return path


def test_the_parts_join_to_the_zip_by_cat_and_the_sum_is_right(tmp_path: Path) -> None:
    drive = noise(tmp_path / "drive.mcap", 250_001)
    whole = packed(tmp_path, drive)
    parts = cut(whole, 100_000)
    assert [part.name for part in parts] == ["drive.zip.001", "drive.zip.002", "drive.zip.003"]
    assert [part.length for part in parts[:2]] == [100_000, 100_000]
    content = whole.path.read_bytes()
    out = tmp_path / "out"
    out.mkdir()
    for part in parts:
        (out / part.name).write_bytes(content[part.start : part.start + part.length])
    subprocess.run("cat drive.zip.* > drive.zip", shell=True, cwd=out, check=True)
    assert hashlib.sha256((out / "drive.zip").read_bytes()).hexdigest() == whole.sha256
    with zipfile.ZipFile(out / "drive.zip") as archive:
        assert archive.testzip() is None
        assert archive.read("drive.mcap") == drive.read_bytes()


def test_seven_zip_joins_them_too(tmp_path: Path) -> None:
    seven = next(filter(None, map(shutil.which, ("7z", "7zz", "7za"))), None)
    if seven is None:
        pytest.skip("no 7z on this machine")
    whole = packed(tmp_path, noise(tmp_path / "drive.mcap", 50_000))
    content = whole.path.read_bytes()
    for part in cut(whole, 20_000):
        (tmp_path / part.name).write_bytes(content[part.start : part.start + part.length])
    subprocess.run([seven, "x", "-y", "drive.zip.001", "-oout"], cwd=tmp_path, check=True, capture_output=True)
    assert (tmp_path / "out" / "drive.mcap").read_bytes() == (tmp_path / "drive.mcap").read_bytes()


@pytest.mark.parametrize(
    ("size", "limit", "lengths"),
    [(0, 10, [0]), (9, 10, [9]), (10, 10, [10]), (11, 10, [10, 1]), (20, 10, [10, 10]), (21, 10, [10, 10, 1])],
)
def test_where_it_is_cut(tmp_path: Path, size: int, limit: int, lengths: list[int]) -> None:
    one = Pack(path=tmp_path, name="a.zip", size_bytes=size, sha256="")
    parts = cut(one, limit)
    assert [part.length for part in parts] == lengths
    assert [part.start for part in parts] == [limit * i for i in range(len(lengths))]
    assert (parts[0].name == "a.zip") is (len(lengths) == 1)


def test_the_same_files_make_the_same_bytes(tmp_path: Path) -> None:
    drive = noise(tmp_path / "drive.mcap", 5000)
    first = packed(tmp_path, drive)
    drive.touch()
    assert packed(tmp_path, drive).sha256 == first.sha256


def test_several_recordings_go_in_one_zip_and_a_zip_is_not_zipped_again(tmp_path: Path) -> None:
    a, b = noise(tmp_path / "a.mcap", 10), noise(tmp_path / "b.mcap", 20)
    both = packed(tmp_path, a, b)
    with zipfile.ZipFile(both.path) as archive:
        assert archive.namelist() == ["a.mcap", "b.mcap"]
    assert packed(tmp_path, both.path, name="tables").path == both.path
    assert packed(tmp_path, both.path, name="tables").name == "tables.zip"


def test_it_is_compressed_and_told_how_far_it_is(tmp_path: Path) -> None:
    drive = tmp_path / "drive.mcap"
    drive.write_bytes(b"speed 4.2 m/s\n" * 300_000)
    reported: list[float] = []
    whole = pack([drive], tmp_path / "p.zip", "drive", START_MS, reported.append, threading.Event())
    assert whole.size_bytes < 0.05 * drive.stat().st_size
    assert reported == sorted(reported)
    assert reported[-1] == pytest.approx(1.0)


def test_packing_can_be_broken_off(tmp_path: Path) -> None:
    stop = threading.Event()
    stop.set()
    with pytest.raises(Stopped):
        pack([noise(tmp_path / "a.mcap", 10)], tmp_path / "p.zip", "a", START_MS, lambda _: None, stop)


def test_a_disk_that_would_be_filled_is_not(tmp_path: Path) -> None:
    need_room(tmp_path, 0)
    with pytest.raises(NoRoom, match=r"The disk has \d+ MB left; \d+ MB are required\."):
        need_room(tmp_path, shutil.disk_usage(tmp_path).free)


def test_the_words_say_how_parts_are_joined(tmp_path: Path) -> None:
    one = Pack(path=tmp_path, name="drive.zip", size_bytes=60_000_000, sha256="ab" * 32)
    texts = mail_text.attached("See alarm 3.", ["drive"], "mcap", one, cut(one, 18_000_000))
    assert len(texts) == 4
    for number, text in enumerate(texts, 1):
        assert text.startswith("See alarm 3.\n\n")
        assert f"drive.zip.00{number}, {'18.0' if number < 4 else '6.0'} MB: part {number} of 4" in text
        assert "cat drive.zip.* > drive.zip" in text
        assert "7-Zip" in text
        assert "ab" * 32 in text
