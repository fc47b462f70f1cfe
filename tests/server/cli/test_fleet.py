"""The commands of a fleet: what they print, what they refuse."""

from __future__ import annotations

import re
import stat
from pathlib import Path

import pytest

from server.cli.main import main
from tests.server.bus.broker import nats_server


def fleet(folder: Path, *arguments: str) -> int:
    return main(["fleet", "--folder", str(folder), *arguments])


def test_add_prints_the_two_lines_and_keeps_no_secret(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert fleet(tmp_path, "add", "ocelot", "--broker", "tls://broker.example:4222") == 0
    printed = capsys.readouterr().out
    seed = re.search(r"umask 077; echo (SU[A-Z2-7]{56}) > ocelot.key", printed)
    assert seed, printed
    assert "catgraph agent --broker tls://broker.example:4222 --key ocelot.key --vehicle ocelot=ws://" in printed
    assert "reload" in printed
    assert fleet(tmp_path, "add", "room", "--web") == 0
    assert "catgraph web --broker" in capsys.readouterr().out
    assert fleet(tmp_path, "list") == 0
    listed = capsys.readouterr().out
    assert re.search(r"^ocelot +agent +since \d{4}-\d\d-\d\d  U[A-Z2-7]{55}$", listed, re.MULTILINE)
    assert seed[1] not in listed
    assert fleet(tmp_path, "remove", "ocelot") == 0
    capsys.readouterr()
    fleet(tmp_path, "list")
    assert "ocelot" not in capsys.readouterr().out


def test_what_is_refused_is_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in (("add", "a b"), ("remove", "nobody"), ("add", "x.y", "--web")):
        assert fleet(tmp_path, *arguments) == 2
        assert re.fullmatch(r"catgraph: .*\.\n", capsys.readouterr().err)
    taken = tmp_path / "file"
    taken.write_text("")
    assert fleet(taken / "below", "add", "ocelot") == 2
    assert "catgraph: " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["agent", "--broker", "http://x"], "no address of a broker"),
        (["agent", "--broker", "nats://x:port"], "no address of a broker"),
        (["agent", "--broker", "nats://x", "--broker-ca", "x.pem"], "no effect without tls://"),
        (["agent", "--broker", "nats://x", "--vehicle", "ü=ws://x"], "ASCII"),
        (["web", "--broker", "nats://x", "--key", "/nowhere"], "cannot be read"),
        (["web", "--broker", "tls://x", "--broker-ca", "/nowhere"], "cannot be used"),
    ],
)
def test_agent_and_web_refuse_with_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], why: str
) -> None:
    assert main([*arguments, "--port", "0", "--data", str(tmp_path / "data")]) == 2
    printed = capsys.readouterr().err
    assert printed.startswith("catgraph: ")
    assert why in printed


def test_the_folder_may_be_read_by_the_broker(tmp_path: Path) -> None:
    """It has public keys only, and the broker runs as a user of its own."""
    nats_server()
    fleet(tmp_path, "add", "ocelot")
    assert stat.S_IMODE((tmp_path / "fleet.conf").stat().st_mode) & 0o444 == 0o444
