"""The page's files as they go out: small, never yesterday's, and the same scripts as they were written."""

from __future__ import annotations

import gzip
import shutil
import subprocess
from pathlib import Path

import httpx

from server.config import Config
from server.web.assets import static_dir
from server.web.static_files import _read, modules_of
from tests.server.conftest import serving

NODE = shutil.which("node") or "node"
PLAIN_TESTS = [*(Path(__file__).parents[2] / "page").glob("*.js")]
SCRIPTS = sorted((static_dir() / "js").glob("*.js"))


async def test_a_text_comes_small_to_whoever_can_unpack_it_and_is_asked_about_each_time() -> None:
    async with serving(Config()) as base, httpx.AsyncClient(base_url=base) as client:
        for path in ("/", "/static/js/store.js", "/static/css/frame.css", "/static/icons/catgraph.svg"):
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
            is_document = path == "/" or path.endswith(".svg")
            assert ("content-security-policy" in small.headers) == is_document  # a policy a module would be 25 kB
            assert small.headers["x-content-type-options"] == "nosniff"
        head = await client.head("/static/js/store.js")
        assert head.status_code == 200
        for path in ("/static/js/nothing.js", "/static/../server/app.py", "/static/js/%2e%2e/%2e%2e/server/app.py"):
            assert (await client.get(path)).status_code == 404
        font = await client.get("/static/fonts/catgraph-numerals-500.woff2", headers={"Accept-Encoding": "gzip"})
        assert "content-encoding" not in font.headers  # it is compressed already


def test_a_changed_file_goes_out_changed(tmp_path: Path) -> None:
    path = tmp_path / "a.js"
    path.write_text("// a word\n/** @type {number} */\nexport const a = 1; // kept\n")
    first = _read(path, path.stat().st_mtime_ns)
    assert first.plain == b"export const a = 1; // kept\n"
    assert gzip.decompress(first.small) == first.plain
    path.write_text("export const a = 2;\n")
    second = _read(path, path.stat().st_mtime_ns + 1)
    assert second.plain != first.plain
    assert second.etag != first.etag


def test_the_scripts_are_still_scripts_and_their_own_tests_pass(tmp_path: Path) -> None:
    """The tests of the plain functions, run upon the scripts as a phone gets them."""
    for script in SCRIPTS:
        _put(tmp_path / "static" / "js" / script.name, _read(script, 0).plain)
    for test in PLAIN_TESTS:
        _put(tmp_path / "tests" / "page" / test.name, test.read_bytes())
    (tmp_path / "package.json").write_text('{"type": "module"}')
    for script in SCRIPTS:
        checked = [NODE, "--check", str(tmp_path / "static" / "js" / script.name)]
        assert subprocess.run(checked, capture_output=True, check=False).returncode == 0, script.name
    tests = [str(path) for path in (tmp_path / "tests" / "page").glob("*.test.js")]
    assert tests
    done = subprocess.run([NODE, "--test", *tests], capture_output=True, text=True, check=False, timeout=170)
    assert done.returncode == 0, done.stdout[-3000:]


def _put(path: Path, body: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(body)


def test_the_head_names_what_the_page_begins_with_and_no_more() -> None:
    names = modules_of(static_dir() / "js" / "app.js")
    assert len(names) == len(set(names))
    assert {"store.js", "words.js", "dom.js"} <= set(names)
    assert not {"app.js", "map.js", "chart.js", "settings.js"} & set(names), "these are for later"
    assert sum(len(_read(static_dir() / "js" / name, 0).small) for name in names) < 75_000
