"""A driver that leaves the status of its fix at −2, not known: what is left out is counted and named."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.cli.main import main
from server.recording.catalog.survey import survey
from tests.reports.cases import judged, made, raised


@pytest.fixture(scope="module")
def drive() -> Path:
    return made("case_16_status_unknown.py") / "16-status-unknown" / "unknown"


@pytest.mark.parametrize("kind", ["gpx", "geojson"])
def test_a_track_states_what_it_leaves_out(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str
) -> None:
    out = tmp_path / f"track.{kind}"
    assert main(["export", str(drive), "--format", kind, "--out", str(out)]) == 2
    assert "Left out: 400 positions without a known status." in capsys.readouterr().err
    assert not out.exists()


def test_list_and_check_agree_with_the_exports(drive: Path) -> None:
    assert survey(next(drive.glob("*.mcap")))["sketch"] is None
    report = judged(drive)
    assert report.run.snapshot.track == ()
    assert "gps_fix" in raised(report)
    assert any("does not report whether it has a fix" in one.why for one in report.run.unchecked)
