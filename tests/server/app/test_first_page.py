"""The first page after a start does not wait for what the server could prepare."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from fastapi.templating import Jinja2Templates
from jinja2 import Environment
from starlette.requests import Request

from server.system.page_files import static_dir, templates_dir
from server.web.routes.pages import FLEET, PageFiles
from tests.tree import PROJECT

#: A server that ends once it has prepared its pages.
SERVER = """
import os
from server.cli.main import main
from server.web.routes.pages import PageFiles

def warm(files, warm=PageFiles.warm):
    warm(files)
    print("warm", flush=True)
    os._exit(0)

PageFiles.warm = warm
main(["serve", "--port", "0", "--data", "DATA"])
"""


@pytest.mark.parametrize("template", ["page.html", FLEET, "no_car.html", "offline.html"])
def test_no_page_compiles_a_template_once_they_are_warm(monkeypatch: pytest.MonkeyPatch, template: str) -> None:
    files = PageFiles(static_dir(), Jinja2Templates(directory=templates_dir()))
    files.warm()
    compiled: list[str | None] = []
    monkeypatch.setattr(Environment, "compile", lambda _self, _source, name=None, *_: compiled.append(name))
    request = Request({"type": "http", "method": "GET", "path": "/", "query_string": b"", "headers": []})
    context = {"version": "1", "vehicle": "car", "vehicles": ["car"], "access": "open", "name": "car"}
    assert b"</html>" in files.render(template, request, None, **context)
    assert compiled == []


@pytest.mark.field
def test_a_server_prepares_its_pages_once_it_listens(tmp_path: Path) -> None:
    program = SERVER.replace("DATA", str(tmp_path))
    ended = subprocess.run(
        [sys.executable, "-c", program], cwd=PROJECT, capture_output=True, text=True, timeout=60, check=False
    )
    address, *_, last = ended.stdout.splitlines()
    assert "http://127.0.0.1:" in address
    assert last == "warm"
