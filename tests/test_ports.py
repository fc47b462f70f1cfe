"""Ports for the tests are given once."""

from __future__ import annotations

import socket
import subprocess
import sys

from tests.ports import FIRST, LAST, free_port


def test_no_port_is_given_twice_and_each_can_be_listened_on() -> None:
    ports = [free_port() for _ in range(50)]
    assert len(set(ports)) == len(ports)
    assert all(FIRST <= port < LAST for port in ports)
    with socket.create_server(("127.0.0.1", ports[0])):
        pass


def test_a_port_of_this_process_is_not_given_to_another() -> None:
    taken = {free_port() for _ in range(200)}
    script = "from tests.ports import free_port; print(*(free_port() for _ in range(250)))"
    given = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True).stdout.split()
    assert len(given) == 250
    assert taken.isdisjoint(int(port) for port in given)
