"""A failed test runs again by itself: what is green, what is red, and what is listed. Each run here is a real one."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.stages import Stage, run

FAILS_ONCE = """
import pathlib
import pytest

@pytest.mark.parametrize("name", {names})
def test_once(name):
    seen = pathlib.Path(__file__).with_name(name)
    if not seen.exists():
        seen.touch()
        raise AssertionError(f"{{name}} was too late")
"""
ALWAYS_FAILS = "def test_always():\n    assert 1 == 2\n"
PASSES = "def test_right():\n    pass\n"
HANGS = "import threading\n\ndef test_hangs():\n    threading.Event().wait()\n"
CRASHES = "import os\n\ndef test_crashes():\n    os._exit(3)\n"


def run_in(
    folder: Path,
    *files: str,
    options: tuple[str, ...] = (),
    selection: tuple[str, ...] = (".",),
    environment: Mapping[str, str] | None = None,
) -> int:
    """Run these made-up test files as one stage."""
    folder.joinpath("pytest.ini").write_text(
        "[pytest]\nasyncio_default_fixture_loop_scope = function\n", encoding="utf-8"
    )
    for number, text in enumerate(files):
        folder.joinpath(f"test_{number}.py").write_text(text, encoding="utf-8")
    plain = ("-p", "no:cacheprovider", "-p", "no:schemathesis")
    return run([Stage("made", selection, (*plain, *options), environment or {})], folder / "out", folder)


def unstable(folder: Path) -> list[str]:
    return folder.joinpath("out/unstable.txt").read_text(encoding="utf-8").splitlines()


def runs_alone(shown: str) -> int:
    return shown.count("by itself: ")


def test_what_passes_runs_once(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run_in(tmp_path, PASSES) == 0
    assert unstable(tmp_path) == []
    assert runs_alone(capfd.readouterr().out) == 0


def test_what_always_fails_is_red(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run_in(tmp_path, PASSES, ALWAYS_FAILS) == 1
    shown = capfd.readouterr()
    assert runs_alone(shown.out) == 2
    assert shown.err.endswith("FAILED test_1.py::test_always: assert 1 == 2\n")
    assert unstable(tmp_path) == []


def test_what_fails_once_is_green_and_listed_with_its_first_reason(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert run_in(tmp_path, PASSES, FAILS_ONCE.format(names=["a b", "c"])) == 0
    shown = capfd.readouterr()
    listed = [f"test_1.py::test_once[{name}]: AssertionError: {name} was too late" for name in ("a b", "c")]
    assert unstable(tmp_path) == listed
    assert "\n".join(["2 unstable", *listed]) in shown.out
    assert shown.err == ""


def test_six_unstable_tests_are_red(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run_in(tmp_path, FAILS_ONCE.format(names=list("abcdef"))) == 1
    assert len(unstable(tmp_path)) == 6
    assert capfd.readouterr().err == "UNSTABLE 6 tests, at most 5 are allowed\n"


def test_what_hangs_is_red_at_once(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run_in(tmp_path, HANGS, options=("--timeout", "1")) == 1
    shown = capfd.readouterr()
    assert runs_alone(shown.out) == 0
    assert "FAILED test_0.py::test_hangs: Failed: Timeout" in shown.err


@pytest.mark.parametrize("workers", [(), ("-n", "1")])
def test_what_crashes_is_red_at_once(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], workers: tuple[str, ...]
) -> None:
    assert run_in(tmp_path, CRASHES, selection=(".", *workers)) == 1
    shown = capfd.readouterr()
    assert runs_alone(shown.out) == 0
    assert "NEVER ENDED test_0.py::test_crashes" in shown.err or "crashed while running" in shown.err


def test_a_stage_without_tests_is_red(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run_in(tmp_path, PASSES, selection=(".", "-k", "nothing")) == 1
    assert capfd.readouterr().err == "STAGE made ended with exit code 5\nNO TESTS in stage made\n"


def test_a_file_that_cannot_be_read_is_red(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run_in(tmp_path, PASSES, "import nothing_of_this_name\n") == 1
    assert "STAGE made ended with exit code 2" in capfd.readouterr().err


def test_the_environment_of_a_stage_holds_in_both_runs_of_a_test(tmp_path: Path) -> None:
    made = f"{FAILS_ONCE.format(names=['it'])}    import os\n    assert os.environ['MADE'] == 'here'\n"
    assert run_in(tmp_path, made, environment={"MADE": "here"}) == 0
    assert len(unstable(tmp_path)) == 1
