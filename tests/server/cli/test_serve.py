"""What `catgraph serve` refuses before it serves."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.app import process
from server.cli.main import main


@pytest.fixture(autouse=True)
def _never_serves(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the refusal a server would go on until the test times out."""

    async def serve(*_: object, **__: object) -> None:
        pytest.fail("it was not refused")

    monkeypatch.setattr(process.Server, "serve", serve)


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


@pytest.mark.parametrize("name", ["a/b", "", "öl"])
def test_a_web_node_expects_no_car_whose_name_no_agent_can_have(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    node = ["web", "--broker", "nats://127.0.0.1:1", "--port", "0", "--data", str(tmp_path)]
    assert main([*node, "--expect", "ocelot", "--expect", name]) == 2
    assert "name" in capsys.readouterr().err


def test_a_port_that_is_none_is_refused_with_one_full_stop(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["serve", "--port", "99999", "--data", str(tmp_path)]) == 2
    assert capsys.readouterr().err == "catgraph: Nothing can listen on 127.0.0.1:99999: bind(): port must be 0-65535.\n"
