"""`--tls` and `--setup-port` as they are typed."""

from __future__ import annotations

import argparse
from pathlib import Path

import pytest

from server.app import tls_process
from server.app.config import Config, Tls


def read(*typed: str) -> Tls | None:
    parser = argparse.ArgumentParser()
    tls_process.add_arguments(parser)
    return tls_process.read_options(parser.parse_args(typed))


@pytest.mark.parametrize(
    ("typed", "tls"),
    [
        ((), None),
        (("--tls", "auto"), Tls(mode="auto")),
        (("--tls", "off"), Tls(mode="off")),
        (("--tls", "c.pem", "k.pem"), Tls(mode="files", cert=Path("c.pem"), key=Path("k.pem"))),
        (("--setup-port", "80"), Tls(mode="auto", setup_port=80)),
        (("--tls", "auto", "--setup-port", "0"), Tls(mode="auto", setup_port=0)),
    ],
)
def test_possible_options(typed: tuple[str, ...], tls: Tls | None) -> None:
    assert read(*typed) == tls


@pytest.mark.parametrize("typed", [("on",), ("c.pem",), ("c.pem", "k.pem", "x"), ("auto", "off", "x")])
def test_impossible_options_are_refused_with_a_reason(typed: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match="takes auto, off, or two files"):
        read("--tls", *typed)


def test_a_port_to_explain_needs_something_to_explain() -> None:
    with pytest.raises(ValueError, match="no effect with --tls off"):
        read("--tls", "off", "--setup-port", "80")


@pytest.mark.parametrize(
    ("host", "tls", "is_tls"),
    [
        ("127.0.0.1", None, False),
        ("127.8.8.8", None, False),
        ("::1", None, False),
        ("localhost", None, False),
        ("0.0.0.0", None, True),
        ("::", None, True),
        ("192.168.4.1", None, True),
        ("pit.local", None, True),
        ("", None, True),
        ("127.0.0.1", Tls(mode="auto"), True),
        ("0.0.0.0", Tls(mode="off"), False),
        ("0.0.0.0", Tls(mode="files"), True),
    ],
)
def test_https_is_the_default_where_others_can_come(host: str, tls: Tls | None, is_tls: bool) -> None:
    assert Config(host=host, tls=tls).is_tls is is_tls
