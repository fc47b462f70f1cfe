"""What `catgraph serve` refuses before it serves."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.cli.main import main


@pytest.mark.parametrize(
    ("options", "why"),
    [
        (
            ["--vehicle", "ocelot=http://192.168.4.1:11311"],
            "--vehicle ocelot: This is a ROS master address; catgraph connects to rosbridge. "
            "Most likely ws://192.168.4.1:9090.",
        ),
        (["--vehicle", "ws:/192.168.4.1"], "--vehicle car: After ws: write two slashes."),
        (
            ["--vehicle", "ws://192.168.4.1:9090", "--only", "192.168.4.2"],
            "--vehicle car: 192.168.4.1:9090 is not among the vehicles that this server may connect to. "
            "Name its host with --only too.",
        ),
    ],
)
def test_an_address_that_cannot_be_dialled_is_refused_with_a_sentence(
    options: list[str], why: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["serve", "--port", "0", "--data", str(tmp_path), *options]) == 2
    assert capsys.readouterr().err.startswith(f"catgraph: {why}")
