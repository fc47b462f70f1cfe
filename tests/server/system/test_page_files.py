"""The server reports in one sentence what is wrong with the page's third-party files."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.system.page_files import check_vendor, static_dir, templates_dir, vendor_problem, write_stamp


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A project whose vendor folder is complete and current."""
    (tmp_path / "package.json").write_text('{"vendor": {}}')
    (tmp_path / "package-lock.json").write_text("{}")
    vendor = tmp_path / "vendor"
    (vendor / "images").mkdir(parents=True)
    (vendor / "leaflet.js").write_text("L = 1")
    (vendor / "images" / "marker.png").write_bytes(b"\x89PNG")
    write_stamp(vendor, tmp_path)
    return tmp_path


def test_a_complete_folder_has_no_problem(project: Path) -> None:
    assert vendor_problem(project / "vendor", project) is None


def test_writing_the_stamp_again_changes_nothing(project: Path) -> None:
    before = (project / "vendor" / "stamp").read_text()
    write_stamp(project / "vendor", project)
    assert (project / "vendor" / "stamp").read_text() == before
    assert vendor_problem(project / "vendor", project) is None


@pytest.mark.parametrize("name", ["package.json", "package-lock.json"])
def test_another_package_file_makes_it_old(project: Path, name: str) -> None:
    (project / name).write_text('{"other": 1}')
    assert "older than package.json" in (vendor_problem(project / "vendor", project) or "")


def test_an_installed_copy_needs_no_package_file(project: Path) -> None:
    (project / "package.json").unlink()
    assert vendor_problem(project / "vendor", None) is None


def test_a_lost_file_is_named(project: Path) -> None:
    (project / "vendor" / "images" / "marker.png").unlink()
    assert "lacks images/marker.png" in (vendor_problem(project / "vendor", project) or "")


@pytest.mark.parametrize("content", [None, b"", b"\xff\xfe\x00"], ids=["no stamp", "empty", "noise"])
def test_a_folder_without_a_readable_stamp_is_missing(project: Path, content: bytes | None) -> None:
    stamp = project / "vendor" / "stamp"
    stamp.unlink()
    if content is not None:
        stamp.write_bytes(content)
    assert "is missing" in (vendor_problem(project / "vendor", project) or "")


def test_this_project_is_complete() -> None:
    check_vendor()
    assert (static_dir() / "vendor" / "leaflet.js").is_file()
    assert templates_dir().is_dir()
