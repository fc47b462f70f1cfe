"""The page's files as they go out: small, and never yesterday's."""

from __future__ import annotations

import gzip
import hashlib
from pathlib import Path
from unittest.mock import patch

from server.app.config import Config
from server.web.assets.static_files import _read, packed
from tests.http import http_client
from tests.server.conftest import serving
from tests.tree import PROJECT


async def test_a_text_comes_small_to_whoever_can_unpack_it_and_is_asked_about_each_time() -> None:
    async with serving(Config()) as base, http_client(base_url=base) as client:
        for path in ("/", "/static/js/core/store.js", "/static/css/frame.css", "/static/icons/catgraph.svg"):
            small = await client.get(path, headers={"Accept-Encoding": "gzip"})
            plain = await client.get(path, headers={"Accept-Encoding": "identity"})
            assert small.headers["content-encoding"] == "gzip"
            assert "content-encoding" not in plain.headers
            assert small.text == plain.text
            assert small.headers["vary"] == plain.headers["vary"] == "Accept-Encoding"
            assert small.headers["cache-control"] == "no-cache"
            assert small.headers["content-type"] == plain.headers["content-type"]
            assert small.headers["etag"] != plain.headers["etag"], (
                "two texts under one name would be mixed up by a cache"
            )
            again = await client.get(path, headers={"Accept-Encoding": "gzip", "If-None-Match": small.headers["etag"]})
            assert (again.status_code, again.content) == (304, b"")
            other = await client.get(path, headers={"Accept-Encoding": "gzip", "If-None-Match": '"yesterday"'})
            assert other.status_code == 200
            is_document = path == "/"
            assert (
                "require-trusted-types-for" in small.headers["content-security-policy"]
            ) == is_document  # short for the parts
            assert small.headers["x-content-type-options"] == "nosniff"
        head = await client.head("/static/js/core/store.js")
        assert head.status_code == 200
        for path in (
            "/static/js/nothing.js",
            "/static/../server/app/app.py",
            "/static/js/%2e%2e/%2e%2e/server/app/app.py",
        ):
            assert (await client.get(path)).status_code == 404
        font = await client.get("/static/fonts/catgraph-numerals-500.woff2", headers={"Accept-Encoding": "gzip"})
        assert "content-encoding" not in font.headers  # it is compressed already


async def test_only_what_its_address_has_the_hash_of_is_kept_for_ever() -> None:
    """Of a page whose server was upgraded meanwhile, an address names another content than there is now."""
    names = ("js/core/store.js", "fonts/catgraph-numerals-500.woff2")
    async with serving(Config()) as base, http_client(base_url=base) as client:
        for name in names:
            digest = hashlib.sha256((PROJECT / "static" / name).read_bytes()).hexdigest()[:12]
            kept = await client.get(f"/static/{name}?v={digest}")
            assert "immutable" in kept.headers["cache-control"]
            for version in ("0" * 12, digest[:6], "", "1"):
                other = await client.get(f"/static/{name}?v={version}")
                assert (other.status_code, other.headers["cache-control"]) == (200, "no-cache"), version
        part = {"Range": "bytes=0-9", "If-Range": '"a"'}
        assert (await client.get(f"/static/{name}?v={digest}", headers=part)).status_code in (200, 206)


def test_a_changed_file_goes_out_changed(tmp_path: Path) -> None:
    path = tmp_path / "a.js"
    path.write_text("export const a = 1;\n")
    first = _read(path, path.stat().st_mtime_ns)
    assert first.plain == b"export const a = 1;\n"
    assert gzip.decompress(first.small) == first.plain
    path.write_text("export const a = 2;\n")
    second = _read(path, path.stat().st_mtime_ns + 1)
    assert second.plain != first.plain
    assert second.etag != first.etag


def test_a_page_that_is_rendered_as_before_is_not_compressed_again() -> None:
    body = b"<!doctype html><title>rendered for each request</title>"
    first = packed(bytes(body))
    with patch("gzip.compress", side_effect=AssertionError("compressed again")):
        assert packed(bytes(bytearray(body))) == first
