"""Names and places of recordings: unique, safe, and no way out of the folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.recording.folder import RecordingsFolder, id_of, is_id, part_id, writing_path

AT_MS = 1_700_000_000_500  # 2023-11-14 22:13:20.5 UTC


def put(folder: RecordingsFolder, name: str, vehicle: str = "car") -> Path:
    path = folder.root / vehicle / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"x")
    return path


def test_a_name_holds_whose_and_when(tmp_path: Path) -> None:
    folder = RecordingsFolder(tmp_path / "recordings")
    assert folder.new_id("car", AT_MS) == "car_20231114T221320Z"
    assert not folder.root.exists(), "asking for a name makes nothing"
    assert part_id("car_20231114T221320Z", 1) == "car_20231114T221320Z"
    assert part_id("car_20231114T221320Z", 2) == "car_20231114T221320Z_p2"


@pytest.mark.parametrize("ending", [".mcap", ".mcap.writing", ".mcap.damaged", ".mcap.recovering"])
def test_a_name_is_given_once(tmp_path: Path, ending: str) -> None:
    folder = RecordingsFolder(tmp_path)
    put(folder, f"car_20231114T221320Z{ending}", vehicle="other")
    assert folder.new_id("car", AT_MS) == "car_20231114T221320Z-2"


def test_a_name_in_the_trash_is_taken_too(tmp_path: Path) -> None:
    folder = RecordingsFolder(tmp_path)
    put(folder, "car_20231114T221320Z.mcap", vehicle=".trash")
    assert folder.new_id("car", AT_MS) == "car_20231114T221320Z-2"
    assert folder.path_of("car_20231114T221320Z") is None


@pytest.mark.parametrize(
    ("vehicle", "start"),
    [("car", "car_"), ("größe", "gr--e_"), ("_x", "v_x_"), ("日本", "v--_"), ("a" * 40, "a" * 40 + "_")],
)
def test_every_vehicle_has_names_that_are_names(tmp_path: Path, vehicle: str, start: str) -> None:
    folder = RecordingsFolder(tmp_path)
    id = part_id(folder.new_id(vehicle, AT_MS), 999)
    assert id.startswith(start)
    assert is_id(id)
    assert folder.place(vehicle, id).parent.parent == tmp_path


@pytest.mark.parametrize(
    "id",
    ["", ".", "..", "../car/a", "a/b", "a\\b", "/etc/passwd", "a.mcap", "a\0", "a\n", "-a", "_a", "a" * 81, "é", "a b"],
)
def test_no_name_leads_out(tmp_path: Path, id: str) -> None:
    folder = RecordingsFolder(tmp_path / "recordings")
    put(folder, "a.mcap")
    (tmp_path / "a.mcap").write_bytes(b"x")
    assert folder.path_of(id) is None
    with pytest.raises(ValueError, match="not a valid name"):
        folder.place("car", id)


def test_what_is_finished_is_distinguished_from_what_is_not(tmp_path: Path) -> None:
    folder = RecordingsFolder(tmp_path)
    done = put(folder, "a_p2.mcap")
    other = put(folder, "b.mcap", vehicle="bus")
    half = put(folder, "c.mcap.writing")
    bad = put(folder, "d.mcap.damaged")
    put(folder, "e.mcap", vehicle=".trash")
    put(folder, "notes.txt")
    (tmp_path / "car" / "f.mcap").mkdir()
    assert sorted(folder.finished()) == sorted([other, done])
    assert folder.unfinished() == [half]
    assert folder.damaged() == [bad]
    assert folder.path_of("b") == other
    assert folder.path_of("c") is None
    assert (id_of(done), id_of(half), id_of(bad)) == ("a_p2", "c", "d")
    assert writing_path(tmp_path / "car" / "c.mcap") == half


def test_a_link_to_elsewhere_is_no_vehicle(tmp_path: Path) -> None:
    folder = RecordingsFolder(tmp_path / "recordings")
    folder.root.mkdir()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "a.mcap").write_bytes(b"x")
    (folder.root / "link").symlink_to(tmp_path / "elsewhere")
    assert folder.finished() == []
