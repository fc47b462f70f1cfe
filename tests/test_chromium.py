"""Which browser the page's tests get, by stubs on an otherwise empty PATH."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.chromium import NoChromium, find_chromium, main

STARTS = "#!/bin/sh\necho '<html><head></head><body></body></html>'\n"
STUB = "#!/bin/sh\necho 'Command requires the chromium snap to be installed' >&2\nexit 1\n"


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A machine without a browser; its PATH is bin/, its Playwright keeps browsers in cache/."""
    (tmp_path / "bin").mkdir()
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    monkeypatch.setenv("PLAYWRIGHT_BROWSERS_PATH", str(tmp_path / "cache"))
    monkeypatch.delenv("CATGRAPH_CHROMIUM", raising=False)
    return tmp_path


def put(path: Path, script: str) -> str:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(script)
    path.chmod(0o755)
    return str(path)


def test_the_systems_own_comes_first(machine: Path) -> None:
    put(machine / "cache/chromium-1200/chrome-linux64/chrome", STARTS)
    chromium = put(machine / "bin/chromium", STARTS)
    put(machine / "bin/google-chrome", STARTS)
    assert find_chromium() == chromium


def test_one_that_does_not_start_is_passed_over(machine: Path) -> None:
    put(machine / "bin/chromium-browser", STUB)
    chrome = put(machine / "bin/google-chrome", STARTS)
    assert find_chromium() == chrome


@pytest.mark.parametrize("folder", ["chrome-linux", "chrome-linux64"])
def test_playwrights_own_is_found(machine: Path, folder: str) -> None:
    put(machine / "bin/chromium-browser", STUB)
    own = put(machine / "cache/chromium-1200" / folder / "chrome", STARTS)
    assert find_chromium() == own


def test_none_is_said(machine: Path) -> None:
    with pytest.raises(NoChromium, match=r"python -m tests\.chromium"):
        find_chromium()


def test_one_that_is_there_and_does_not_start_is_named(machine: Path) -> None:
    stub = put(machine / "bin/chromium-browser", STUB)
    with pytest.raises(NoChromium, match=f"{stub} does not start"):
        find_chromium()


def test_the_one_that_was_named_is_taken_or_nothing(
    machine: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    put(machine / "bin/chromium", STARTS)
    monkeypatch.setenv("CATGRAPH_CHROMIUM", put(machine / "mine", STARTS))
    assert find_chromium() == str(machine / "mine")
    put(machine / "mine", STUB)
    assert main() == 1  # and installs nothing
    assert "mine, which does not start" in capsys.readouterr().err
