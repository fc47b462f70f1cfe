"""The list of paired devices: what of it is on the disk, and when."""

from __future__ import annotations

import asyncio
import contextlib
import os
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from server.access import invitations, secret_file
from server.access.devices import FORGOTTEN_AFTER_MS, MOST, Devices
from server.access.identity import Role
from server.storage.storage_thread import StorageThread
from tests.server.access.pairs import access_of, config


async def test_only_the_hash_of_a_secret_is_on_the_disk_and_only_for_the_servers_user(tmp_path: Path) -> None:
    os.umask(0)
    access = access_of(config(tmp_path), now=lambda: 0.0, wall_ms=lambda: 1000)
    device, secret = await access.pair(token=access.invitation().token, pin=None, name="Pixel", peer="")
    access.listens_at("http://192.168.4.1:8000/")
    invitations.lay_invitation(tmp_path / "access", Role.VIEWER, wall_ms=0)
    files = [path for path in (tmp_path / "access").rglob("*") if path.is_file()]
    assert {path.name for path in files} >= {"devices.json", "running.json"}
    assert [oct(path.stat().st_mode & 0o777) for path in files] == ["0o600"] * len(files)
    assert (tmp_path / "access").stat().st_mode & 0o077 == 0
    assert all(secret not in path.read_text() for path in files)
    again = Devices(tmp_path / "access")
    assert again.known(device.id, secret, now_ms=2000) == device
    assert again.known(device.id, secret[:-1], now_ms=2000) is None
    assert again.known("other", secret, now_ms=2000) is None
    assert again.known(device.id, secret, now_ms=1001 + FORGOTTEN_AFTER_MS) is None
    assert (again.server, again.signing_key) == (access.devices.server, access.devices.signing_key)


@pytest.mark.parametrize(
    "content", ["", "null", "[]", "{", '{"server": "x"}', '{"server":"12345678","signing_key":"short","devices":[]}']
)
def test_a_damaged_list_lets_nobody_in_and_is_kept(tmp_path: Path, content: str) -> None:
    (tmp_path / "devices.json").write_text(content)
    devices = Devices(tmp_path)
    assert devices.all() == []
    assert len(devices.signing_key) == 64
    if content != "null":
        assert (tmp_path / "devices.damaged.json").read_text() == content


def test_a_file_that_others_could_read_is_closed_and_a_link_is_not_followed(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text("{}")
    path.chmod(0o644)
    assert secret_file.read(path) == {}
    assert path.stat().st_mode & 0o777 == 0o600
    (tmp_path / "link.json").symlink_to(path)
    with pytest.raises(OSError, match="symbolic"):
        secret_file.read(tmp_path / "link.json")


async def test_who_is_removed_is_not_written_back_by_a_list_of_before(tmp_path: Path) -> None:
    storage = StorageThread()
    devices = Devices(tmp_path, storage=storage)
    device, _ = await devices.add("Pixel", Role.VIEWER, now_ms=0)
    disk_answers = threading.Event()
    storage.submit(lambda: disk_answers.wait() and None)
    devices.save_seen(now_ms=100_000)  # it is in this list
    devices.remove(device.id, now_ms=100_000)
    saving = asyncio.create_task(devices.save(now_ms=100_001))
    await asyncio.sleep(0)
    disk_answers.set()
    await saving
    storage.close()
    assert Devices(tmp_path).all() == []


async def test_when_it_was_last_seen_is_written_once_a_minute(tmp_path: Path) -> None:
    devices = Devices(tmp_path)
    device, _ = await devices.add("Pixel", Role.VIEWER, now_ms=0)
    devices.seen(device.id, now_ms=59_000)
    assert Devices(tmp_path).all()[0].seen_ms == 0
    devices.seen(device.id, now_ms=60_000)
    assert Devices(tmp_path).all()[0].seen_ms == 60_000


async def test_names_are_distinguished_and_the_list_is_bounded(tmp_path: Path) -> None:
    devices = Devices(None)
    names = [(await devices.add("Pixel 7", Role.VIEWER, now_ms=n))[0].name for n in range(MOST + 5)]
    assert names[:3] == ["Pixel 7", "Pixel 7 2", "Pixel 7 3"]
    assert len(devices.all()) == MOST
    assert len({one.name for one in devices.all()}) == MOST


async def test_a_device_that_cannot_be_kept_is_not_paired(tmp_path: Path) -> None:
    access = access_of(config(tmp_path), now=lambda: 0.0, wall_ms=lambda: 0)
    token = access.invitation().token
    with unwritable(tmp_path), pytest.raises(IsADirectoryError):
        await access.pair(token=token, pin=None, name="Pixel", peer="")
    assert access.devices.all() == []
    await access.pair(token=token, pin=None, name="Pixel", peer="")  # the invitation was not used up by that


@contextlib.contextmanager
def unwritable(data: Path) -> Iterator[None]:
    """Until the block ends nothing can take the place of the list of devices."""
    file = data / "access" / "devices.json"
    file.unlink()
    file.mkdir()
    try:
        yield
    finally:
        file.rmdir()


class HangingDisk:
    """A storage thread whose disk answers nothing until the block ends."""

    def __init__(self) -> None:
        self.storage = StorageThread()
        self._answers = threading.Event()

    async def __aenter__(self) -> StorageThread:
        self.storage.submit(lambda: self._answers.wait() and None)
        return self.storage

    async def __aexit__(self, *_: object) -> None:
        self._answers.set()
        await self.storage.run(lambda: None)


@pytest.mark.virtual_time
async def test_paired_is_answered_once_the_disk_has_the_device(tmp_path: Path) -> None:
    disk = HangingDisk()
    access = access_of(config(tmp_path), now=lambda: 0.0, wall_ms=lambda: 0, storage=disk.storage)
    async with disk:
        pairing = asyncio.create_task(access.pair(token=access.invitation().token, pin=None, name="Pixel", peer=""))
        done, _ = await asyncio.wait([pairing], timeout=0.05)
        assert not done
        assert Devices(tmp_path / "access").all() == []
    device, secret = await pairing
    assert Devices(tmp_path / "access").known(device.id, secret, now_ms=0) == device
    disk.storage.close()


@pytest.mark.virtual_time
async def test_who_is_removed_is_out_before_the_disk_answers_and_stays_out(tmp_path: Path) -> None:
    disk = HangingDisk()
    access = access_of(config(tmp_path), now=lambda: 0.0, wall_ms=lambda: 0, storage=disk.storage)
    device, secret = await access.pair(token=access.invitation().token, pin=None, name="Lost", peer="")
    cookie = access.cookie(device, secret, scheme="https", host="localhost").partition(";")[0]
    headers = {"host": "localhost", "cookie": cookie}
    assert access.known(headers, scheme="https") is not None
    async with disk:
        removing = asyncio.create_task(access.remove(device.id, by="Boss"))
        done, _ = await asyncio.wait([removing], timeout=0.05)
        assert access.known(headers, scheme="https") is None
        assert not done, "a restart would let it in again"
        removing.cancel()  # its caller is gone
    assert Devices(tmp_path / "access").all() == []
    disk.storage.close()


async def test_a_role_that_cannot_be_kept_stays_as_it_was(tmp_path: Path) -> None:
    access = access_of(config(tmp_path), now=lambda: 0.0, wall_ms=lambda: 0)
    device, _ = await access.pair(token=access.invitation().token, pin=None, name="Pixel", peer="")
    with unwritable(tmp_path), pytest.raises(IsADirectoryError):
        await access.change(device.id, role=Role.VIEWER, name="Tablet")
    assert access.devices.get(device.id) == device
