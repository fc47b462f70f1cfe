"""What was just recorded is listed when `list_fresh` returns, whichever thread lists it."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from server.recording.catalog.catalog_db import Entry
from server.recording.catalog.entries import Entries
from server.recording.catalog.folder_listing import FolderListing


class SlowDisk(FolderListing):
    """Its first look at a file waits for `goes_on`."""

    def __init__(self, folder: Path, entries: Entries) -> None:
        super().__init__(folder, entries, wall_ms=lambda: 0)
        self.looks, self.goes_on = threading.Event(), threading.Event()

    def look(self, path: Path, known: Entry | None) -> Entry | None:
        if not self.looks.is_set():
            self.looks.set()
            assert self.goes_on.wait(10)
        return super().look(path, known)


def test_a_second_thread_finds_listed_what_a_first_one_is_listing(tmp_path: Path) -> None:
    (tmp_path / "car-2026.mcap").write_bytes(b"x")
    entries = Entries(None)
    listing = SlowDisk(tmp_path, entries)
    listing.add(tmp_path / "car-2026.mcap")

    def seen_by_the_second() -> int:
        listing.list_fresh()
        return len(entries.select("", []))

    with ThreadPoolExecutor(2) as threads:
        first = threads.submit(listing.list_fresh)
        assert listing.looks.wait(10)
        assert listing.has_fresh, "it still waits to be listed"
        second = threads.submit(seen_by_the_second)
        threading.Timer(0.05, listing.goes_on.set).start()
        assert second.result(10) == 1
        first.result(10)
    assert not listing.has_fresh


def test_a_file_of_another_folder_is_left_out(tmp_path: Path) -> None:
    (tmp_path / "other.mcap").write_bytes(b"x")
    entries = Entries(None)
    listing = FolderListing(tmp_path / "inner", entries, wall_ms=lambda: 0)
    listing.add(tmp_path / "other.mcap")
    listing.list_fresh()
    assert not listing.has_fresh
    assert entries.select("", []) == []
