"""`--store` on the command line, and what of a car decides whether its recordings are uploaded."""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from monitor.catalog import AllLimits
from server.app import store
from server.app.store import situation
from server.cli.main import main
from server.recording.store.rules import Place, WholeFiles

LOGIN = {"AWS_ACCESS_KEY_ID": "an-id", "AWS_SECRET_ACCESS_KEY": "a-secret"}


def parsed(*arguments: str, uploads: bool = True) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    store.add_arguments(parser, uploads=uploads)
    return parser.parse_args(arguments)


def test_a_store_and_the_network_of_the_depot() -> None:
    assert store.read_options(parsed(), LOGIN) is None
    found = store.read_options(parsed("--store", "s3://b-1/x", "--depot-interface", "wlan0"), LOGIN)
    assert found is not None
    assert (found.address.text, found.depot_interface) == ("s3://b-1/x", "wlan0")
    node = store.read_options(parsed("--store", "s3://b-1", uploads=False), LOGIN)
    assert node is not None
    assert node.depot_interface is None


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--store-region", "x"), "--store-region has no effect without --store."),
        (("--depot-interface", "wlan0"), "--depot-interface has no effect without --store."),
        (("--store", "s3://b-1", "--depot-interface", "../x"), "no name of a network interface"),
        (("--store", "s3://b-1", "--store-ca", "/nowhere.pem"), "There is no certificate"),
        (("--store", "b"), "no address of a store"),
    ],
)
def test_what_cannot_be_is_refused(arguments: tuple[str, ...], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        store.read_options(parsed(*arguments), LOGIN)


def test_the_client_that_is_not_installed_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "find_spec", lambda name: None)
    with pytest.raises(ValueError, match=r"pip install '\.\[store\]'"):
        store.read_options(parsed("--store", "s3://b-1"), LOGIN)


def test_a_server_without_a_login_reports_it(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in LOGIN:
        monkeypatch.delenv(name, raising=False)
    assert main(["serve", "--store", "s3://b-1", "--store-key", "/nowhere.toml"]) == 2
    assert capsys.readouterr().err == (
        "catgraph: The login of the store cannot be read from /nowhere.toml: No such file or directory.\n"
    )


def test_obstore_is_not_imported_without_a_store() -> None:
    code = "import sys, server.app.app, server.cli.main; sys.exit('obstore' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=Path(__file__).parents[3], check=False).returncode == 0


def car(*, age_s: float = 0.0, status: int = 0, speed: bool = True) -> Any:
    """A session as `situation` sees it."""

    def reading(**values: float) -> SimpleNamespace:
        return SimpleNamespace(value=SimpleNamespace(**values), is_fresh=lambda now_s: now_s - 100.0 + age_s < 1.0)

    readings = {"position": reading(lat_deg=32.0, lon_deg=-110.0, status=status)}
    if speed:
        readings["speed"] = reading(speed_mps=0.0)
    state = SimpleNamespace(snapshot=lambda now_s: SimpleNamespace(readings=readings))
    return SimpleNamespace(judgement=SimpleNamespace(state=state), limits=AllLimits())


@pytest.mark.parametrize(
    ("session", "place"),
    [
        (car(), Place(lat_deg=32.0, lon_deg=-110.0, speed_mps=0.0)),
        (car(age_s=5.0), Place()),
        (car(status=-1), Place(speed_mps=0.0)),
        (car(speed=False), Place(lat_deg=32.0, lon_deg=-110.0)),
    ],
)
def test_the_place_of_a_car_is_known_only_while_it_is_fresh(session: Any, place: Place) -> None:
    found = situation(session, 100.0)
    assert found.place == place
    assert (found.rule.whole, found.rule.deletes, found.rule.bytes_per_s) == (WholeFiles.ON_REQUEST, False, 1e6)
