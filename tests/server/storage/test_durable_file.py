"""A small file is replaced whole or not at all."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from server.storage import durable_file

KILLED_AT_REPLACE = """
import os, signal, sys
from pathlib import Path
from server.storage import durable_file
os.replace = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
durable_file.write(Path(sys.argv[1]), b"new")
"""


def mode_of(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def test_content_and_mode_are_those_requested_whatever_the_umask(tmp_path: Path) -> None:
    path = tmp_path / "devices.json"
    path.write_bytes(b"old")
    path.chmod(0o666)
    umask = os.umask(0o277)
    try:
        durable_file.write(path, b"new", mode=0o600)
    finally:
        os.umask(umask)
    assert path.read_bytes() == b"new"
    assert mode_of(path) == 0o600


def test_without_a_mode_the_umask_decides(tmp_path: Path) -> None:
    umask = os.umask(0o027)
    try:
        durable_file.write(tmp_path / "settings.toml", b"x")
    finally:
        os.umask(umask)
    assert mode_of(tmp_path / "settings.toml") == 0o640


@pytest.mark.parametrize("failing", ["fsync", "replace"])
def test_a_disk_that_refuses_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: str
) -> None:
    path = tmp_path / "settings.toml"
    path.write_bytes(b"old")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, failing, full)
    with pytest.raises(OSError, match="No space"):
        durable_file.write(path, b"new")
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["settings.toml"]


def test_a_process_killed_before_the_last_step_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "settings.toml"
    path.write_bytes(b"old")
    ended = subprocess.run([sys.executable, "-c", KILLED_AT_REPLACE, str(path)], check=False)
    assert ended.returncode == -9
    assert path.read_bytes() == b"old"


def test_names_of_any_length_and_bytes(tmp_path: Path) -> None:
    path = tmp_path / os.fsdecode("ä".encode() * 120 + b"\xff.json")
    durable_file.write(path, b"x")
    assert path.read_bytes() == b"x"


def test_of_many_writers_one_wins_whole(tmp_path: Path) -> None:
    path = tmp_path / "settings.toml"
    contents = [bytes([n]) * 50_000 for n in range(8)]
    threads = [threading.Thread(target=durable_file.write, args=(path, content)) for content in contents]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert path.read_bytes() in contents
    assert os.listdir(tmp_path) == ["settings.toml"]


@pytest.mark.parametrize("links", [True, False])
def test_create_makes_a_file_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool) -> None:
    path = tmp_path / "authority.pem"
    if not links:

        def refused(*_: object) -> None:
            raise PermissionError(1, "Operation not permitted")  # as FAT answers

        monkeypatch.setattr(os, "link", refused)
    assert durable_file.create(path, b"first", mode=0o600)
    assert mode_of(path) == 0o600
    if links:
        assert not durable_file.create(path, b"second", mode=0o600)
        assert path.read_bytes() == b"first"
    assert os.listdir(tmp_path) == ["authority.pem"]
