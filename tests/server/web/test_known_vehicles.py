"""The names that a web node remembers."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.storage.storage_thread import StorageThread
from server.web.known_vehicles import FILE, MOST, MOST_OFF, KnownVehicles, OffVehicles


def known(folder: Path | None, *names: str, forget: tuple[str, ...] = ()) -> set[str]:
    """The vehicles of a node that got messages of these and was then started again."""
    storage = StorageThread()
    one = KnownVehicles(folder, storage)
    for name in names:
        one.note(name)
    storage.close()
    return KnownVehicles(folder, StorageThread(), forget=forget).names


def test_vehicles_that_sent_data_are_known_after_a_restart(tmp_path: Path) -> None:
    assert known(tmp_path, "ocelot", "margay", "ocelot") == {"ocelot", "margay"}
    assert known(tmp_path, "serval") == {"ocelot", "margay", "serval"}
    assert known(tmp_path, forget=("margay",)) == {"ocelot", "serval"}
    assert known(None, "ocelot") == set()


def test_names_that_are_none_and_too_many_are_left_out(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    found = known(tmp_path, "a.b", "", "x" * 41, "cars", *(f"car{i}" for i in range(MOST + 5)))
    assert len(found) == MOST
    assert not found & {"a.b", "", "cars"}
    assert [one.getMessage().split(":")[0] for one in caplog.records] == [
        f"vehicle_not_stored vehicle=car{MOST} most={MOST}"
    ]


def test_one_too_many_is_not_declared_off() -> None:
    off = OffVehicles(None, StorageThread(), wall_ms=lambda: 1)
    assert all(off.declare(f"car{i}", "Ann") for i in range(MOST_OFF))
    assert off.declare("car0", "Ben"), "it is off already"
    assert not off.declare("margay", "Ann")
    assert off.of("margay") is None
    off.withdraw("car0", "Ann")
    assert off.declare("margay", "Ann")


@pytest.mark.parametrize("text", ["", "{", "3", '{"a": 1}', "[1, 2]"])
def test_a_file_that_cannot_be_read_stops_no_node(tmp_path: Path, text: str) -> None:
    (tmp_path / FILE).write_text(text)
    assert known(tmp_path, "ocelot") == {"ocelot"}
