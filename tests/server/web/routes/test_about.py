"""Whose work is in catgraph: nothing delivered is left out, and each has its licence."""

from __future__ import annotations

import re
from email.message import Message
from importlib import metadata
from urllib.parse import quote

import pytest
from packaging.utils import canonicalize_name

from server.app.config import Config
from server.system.page_files import static_dir
from server.web.routes.about import _license, parts
from tests.http import http_client
from tests.server.conftest import serving


def test_all_that_is_required_is_named_with_version_and_licence() -> None:
    found = {canonicalize_name(part.name): part for part in parts(static_dir() / "vendor")}
    required = {
        canonicalize_name(re.split(r"[^\w.-]", one)[0])
        for one in metadata.requires("catgraph") or ()
        if "extra ==" not in one
    }
    assert required <= set(found)
    assert {"autobahn", "starlette"} <= set(found), "what is required by what is required"
    assert {"leaflet", "uplot"} <= set(found)
    assert "catgraph" not in found
    assert "pytest" not in found
    for part in found.values():
        assert part.version[0].isdigit(), part
        assert part.license != "see its text" or part.text, part
        assert len(part.license) < 100
    assert "Volodymyr Agafonkin" in found["leaflet"].text or "Vladimir Agafonkin" in found["leaflet"].text
    assert found["roslibpy"].version == "2.1.0"


@pytest.mark.parametrize(
    ("headers", "name"),
    [
        ({"License-Expression": "MIT"}, "MIT"),
        ({"License": "BSD\nwith a long text"}, "see its text"),
        ({"License": "x" * 61, "Classifier": "License :: OSI Approved :: MIT License"}, "MIT License"),
        ({}, "see its text"),
    ],
)
def test_how_a_licence_is_called(headers: dict[str, str], name: str) -> None:
    about = Message()
    for key, value in headers.items():
        about[key] = value
    assert _license(about) == name  # type: ignore[arg-type]


async def test_the_page_is_told_versions_and_texts() -> None:
    async with serving(Config()) as base, http_client(base_url=base) as client:
        about = (await client.get("/api/about")).json()
        assert about["python"].startswith("3.")
        assert {"name", "version", "license", "where"} == set(about["parts"][0])
        for part in about["parts"]:
            text = await client.get(f"/api/notices/{quote(part['name'], safe='')}")
            assert text.status_code == 200
            assert text.headers["content-type"].startswith("text/plain")
            assert len(text.text) > 40
        for name in ("nothing", "..%2f..%2fetc%2fpasswd", "x" * 300):
            assert (await client.get(f"/api/notices/{name}")).status_code == 404
