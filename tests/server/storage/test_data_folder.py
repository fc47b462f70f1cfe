"""One data folder has one server, a newer version's data is not opened, and what cannot be read is not overwritten."""

from __future__ import annotations

import os
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from server.app.app import create_app
from server.app.config import Config
from server.judge.settings import Settings, SettingsFile
from server.mail.settings import MailSettings, MailSettingsFile
from server.storage.data_folder import DATABASES, DataFolder, DataFolderRefused
from server.storage.durable_file import set_aside
from tests.tree import PROJECT

pytestmark = pytest.mark.world(n=23)


def serve(folder: Path, *more: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "server", "serve", "--port", "0", "--data", str(folder), *more],
        cwd=PROJECT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_a_second_server_on_the_folder_refuses_with_a_sentence(tmp_path: Path) -> None:
    folder = tmp_path / "data"
    first = serve(folder)
    assert first.stdout is not None
    try:
        first.stdout.readline()
        second = serve(folder)
        _, error = second.communicate(timeout=60)
        assert second.returncode == 2
        assert error == (
            f"catgraph: Another catgraph (process {first.pid}) uses the data folder {folder}. "
            "Stop it, or start this one with --data and another folder.\n"
        )
    finally:
        first.kill()
        first.communicate()
    third = serve(folder)  # the lock of a killed server is gone with it
    assert third.stdout is not None
    assert third.stdout.readline() != ""
    third.kill()
    third.communicate()


def test_the_folder_of_a_newer_version_is_refused_and_left_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "format.json").write_text('{"format": 2, "catgraph": "3.1"}')
    started = serve(tmp_path)
    _, error = started.communicate(timeout=60)
    assert started.returncode == 2
    assert error == (
        f"catgraph: A newer catgraph wrote the data folder {tmp_path} (format 2, catgraph 3.1; this version reads "
        "format 1). Install that version, or start with --data and another folder.\n"
    )
    assert sorted(path.name for path in tmp_path.iterdir()) == ["format.json", "lock"]


@pytest.mark.parametrize("name", ["events.sqlite", "recordings.sqlite", "mail/outbox.sqlite"])
def test_a_database_of_a_newer_version_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "mail").mkdir()
    database = sqlite3.connect(tmp_path / name)
    database.execute("PRAGMA user_version = 99")
    database.execute("CREATE TABLE future (a)")
    database.commit()
    database.close()
    kept = (tmp_path / name).read_bytes()
    with pytest.raises(DataFolderRefused, match=f"{name} has format 99; this version reads format {DATABASES[name]}"):
        create_app(Config(data=tmp_path))
    assert (tmp_path / name).read_bytes() == kept


def test_a_folder_is_held_until_it_is_closed(tmp_path: Path) -> None:
    one = DataFolder(tmp_path)
    with pytest.raises(DataFolderRefused, match=f"process {os.getpid()}"):
        DataFolder(tmp_path)
    one.close()
    DataFolder(tmp_path).close()


def test_an_unreadable_mark_of_the_format_is_set_aside(tmp_path: Path) -> None:
    (tmp_path / "format.json").write_bytes(b"\x00\x00")
    DataFolder(tmp_path).close()
    assert (tmp_path / "format.unusable.json").read_bytes() == b"\x00\x00"
    assert b'"format":1' in (tmp_path / "format.json").read_bytes()


def test_each_file_set_aside_keeps_a_name_of_its_own(tmp_path: Path) -> None:
    names = []
    for content in ("a", "b", "c"):
        (tmp_path / "car.toml").write_text(content)
        names.append(set_aside(tmp_path / "car.toml").name)
    assert names == ["car.unusable.toml", "car.unusable-2.toml", "car.unusable-3.toml"]
    assert [(tmp_path / name).read_text() for name in names] == ["a", "b", "c"]


def test_settings_that_could_not_be_read_are_set_aside_before_anything_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "car.toml"
    path.write_text("[limits.speed_limit]\nmax_mps = 7.5\n")
    file = SettingsFile(path)
    with monkeypatch.context() as patch:
        patch.setattr("builtins.open", _refusing)
        assert file.read() == Settings()
    assert file.complaint is not None
    assert "cannot be read" in file.complaint
    file.write(Settings(version=1))
    assert (tmp_path / "car.unusable.toml").read_text() == "[limits.speed_limit]\nmax_mps = 7.5\n"
    assert "version = 1" in path.read_text()


def test_settings_that_cannot_be_set_aside_are_not_overwritten(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "car.toml"
    path.write_text("no toml at all [")
    file = SettingsFile(path)
    with monkeypatch.context() as patch:
        patch.setattr(os, "rename", _refusing)
        file.read()
        with pytest.raises(PermissionError):
            file.write(Settings(version=1))
    assert path.read_text() == "no toml at all ["


def test_mail_settings_that_could_not_be_read_are_set_aside_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "settings.toml"
    path.write_text('host = "mail.example.org"\n')
    file = MailSettingsFile(path)
    with monkeypatch.context() as patch:
        patch.setattr("builtins.open", _refusing)
        file.read()
    file.write(MailSettings())
    assert (tmp_path / "settings.unusable.toml").read_text() == 'host = "mail.example.org"\n'


def _refusing(*_: object, **__: object) -> None:
    raise PermissionError(13, "Permission denied")
