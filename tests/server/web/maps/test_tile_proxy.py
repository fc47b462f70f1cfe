"""Tiles that are fetched: politely, once, only what is looked at, and shown without internet ever after."""

from __future__ import annotations

import asyncio
import json
import logging
import re
import sqlite3
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, closing
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.app.app import create_app
from server.app.config import Config
from server.version import catgraph_version
from server.web.maps.map_options import MapUpstream, checked
from server.web.maps.mbtiles import MapFile, MapRefused
from server.web.maps.tile_cache import Kept, TileCache
from tests.http import http_client
from tests.server.web.maps.tile_server import picture

SERVER = Path(__file__).with_name("tile_server.py")


class Source:
    """The server of tiles, as a process."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.port = 0
        self._process: subprocess.Popen[str] | None = None
        folder.mkdir()
        self.be()

    def be(self, **mood: Any) -> None:
        """From now on it answers so."""
        (self.folder / "mood.new").write_text(json.dumps(mood))
        (self.folder / "mood.new").replace(self.folder / "mood.json")

    def start(self) -> None:
        command = [sys.executable, str(SERVER), str(self.folder), str(self.port)]
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert self._process.stdout is not None
        self.port = int(self._process.stdout.readline())

    def kill(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None

    @property
    def requests(self) -> list[dict[str, Any]]:
        path = self.folder / "requests.jsonl"
        return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []

    def upstream(self, **more: Any) -> MapUpstream:
        template = f"http://127.0.0.1:{self.port}/{{z}}/{{x}}/{{y}}.png?key=SECRET"
        return MapUpstream(**{"template": template, "attribution": "© <b>Testers</b>", "zoom": (0, 19), **more})


@pytest.fixture
def source(tmp_path: Path) -> Iterator[Source]:
    one = Source(tmp_path / "source")
    one.start()
    yield one
    one.kill()


class Clock:
    """The server's time, moved by the test."""

    def __init__(self) -> None:
        self.s = 1_790_000_000.0

    def now(self) -> float:
        return self.s

    def wall_ms(self) -> int:
        return int(self.s * 1000)


class Server:
    """Our own server, with requests as a page sends them."""

    def __init__(self, client: httpx.AsyncClient, clock: Clock) -> None:
        self.client = client
        self.clock = clock

    async def layer(self) -> dict[str, Any]:
        found: dict[str, Any] = (await self.client.get("/api/map")).json()["layers"][0]
        return found

    async def at(self, z: int, x: int, y: int) -> httpx.Response:
        return await self.client.get((await self.layer())["tiles"].format(z=z, x=x, y=y))

    async def problem(self) -> str | None:
        found: str | None = (await self.layer())["upstream"]["problem"]
        return found


@asynccontextmanager
async def serving(upstream: MapUpstream, data: Path, clock: Clock | None = None, **more: Any) -> AsyncIterator[Server]:
    clock = clock or Clock()
    app = create_app(Config(map_upstream=upstream, data=data, **more), now=clock.now, wall_ms=clock.wall_ms)
    try:
        async with http_client(transport=httpx.ASGITransport(app), base_url="http://localhost") as client:
            yield Server(client, clock)
    finally:
        app.state.services.ground.close()
        app.state.services.folder.close()


def drawn(path: str) -> bytes:
    return picture(f"{path}.png?key=SECRET")


async def until(holds: Any) -> None:
    async with asyncio.timeout(10):
        while not holds():
            await asyncio.sleep(0.02)


# -- fetched once, kept, shown without internet ------------------------------------------------------------------------


async def test_a_tile_is_fetched_once_and_shown_without_internet_ever_after(source: Source, tmp_path: Path) -> None:
    data = tmp_path / "data"
    async with serving(source.upstream(), data) as one:
        answer = await one.at(3, 5, 2)
        assert (answer.content, answer.headers["content-type"]) == (drawn("/3/5/2"), "image/png")
        assert answer.headers["cache-control"] == "private, max-age=86400"
        assert (await one.at(3, 5, 2)).content == drawn("/3/5/2")
        assert [one["path"] for one in source.requests] == ["/3/5/2.png?key=SECRET"]
    source.kill()
    async with serving(source.upstream(), data) as again:
        assert (await again.at(3, 5, 2)).content == drawn("/3/5/2")
        assert await again.problem() is None, "nothing was missing yet"
        missing = await again.at(3, 5, 3)
        assert (missing.status_code, missing.headers["cache-control"]) == (204, "no-store")
        assert await again.problem() == f"The map's server 127.0.0.1:{source.port} does not answer."
        assert (await again.at(3, 5, 2)).content == drawn("/3/5/2")


async def test_what_is_kept_is_a_map_file_like_any_other(source: Source, tmp_path: Path) -> None:
    data = tmp_path / "data"
    async with serving(source.upstream(), data) as one:
        for z, x, y in ((2, 0, 1), (3, 5, 2), (3, 6, 2)):
            await one.at(z, x, y)
    (path,) = (data / "maps").iterdir()
    assert path.name.startswith("127.0.0.1-")
    with closing(MapFile(path)) as kept:
        assert kept.tile(3, 5, 2) == (drawn("/3/5/2"), "image/png")
        assert kept.tile(3, 5, 5) is None, "rows are counted from the south in the file"
        assert kept.layer.attribution == "© Testers"
        assert kept.layer.zoom == (2, 3)
        assert kept.layer.bounds == pytest.approx((45.0, 40.979898, 135.0, 66.513260))
    with closing(sqlite3.connect(path)) as rows:
        metadata = dict(rows.execute("SELECT name, value FROM metadata"))
        assert (metadata["format"], metadata["type"], metadata["name"]) == (
            "png",
            "baselayer",
            f"127.0.0.1:{source.port}",
        )
        assert rows.execute("PRAGMA application_id").fetchone()[0] == 0x4D504258
        assert rows.execute("PRAGMA journal_mode").fetchone()[0] == "delete", "one file, whole by itself"
        assert "SECRET" not in str(metadata)
    async with serving(source.upstream(), tmp_path / "other", maps=(path,)) as both:
        layers = (await both.client.get("/api/map")).json()["layers"]
        assert [("upstream" in layer) for layer in layers] == [True, False], "what may be fetched lies below the files"


async def test_the_source_is_told_who_asks_and_never_more_than_two_at_a_time(source: Source, tmp_path: Path) -> None:
    source.be(after_s=0.05)
    async with serving(source.upstream(), tmp_path / "data") as one:
        tiles = (await one.layer())["tiles"]
        wanted = [tiles.format(z=5, x=x, y=y) for x in range(4) for y in range(4)]
        answers = await asyncio.gather(*(one.client.get(url) for url in wanted * 2))
        assert {answer.status_code for answer in answers} == {200}
    assert len(source.requests) == 16, "requested by two phones at once, each is fetched once"
    assert max(one["at_once"] for one in source.requests) == 2
    headers = source.requests[0]["headers"]
    assert headers["User-Agent"] == f"catgraph/{catgraph_version()}"
    assert not {"Cookie", "Referer", "Authorization"} & set(headers)


# -- how long a tile holds ---------------------------------------------------------------------------------------------


async def test_an_old_tile_is_shown_at_once_and_requested_again_behind_it(source: Source, tmp_path: Path) -> None:
    source.be(headers={"Cache-Control": "max-age=600"}, etag='"a"')
    async with serving(source.upstream(), tmp_path / "data") as one:
        assert (await one.at(3, 5, 2)).headers["cache-control"] == "private, max-age=600"
        one.clock.s += 599
        await one.at(3, 5, 2)
        assert len(source.requests) == 1
        one.clock.s += 2
        old = await one.at(3, 5, 2)
        assert (old.content, old.headers["cache-control"]) == (drawn("/3/5/2"), "no-cache")
        await until(lambda: len(source.requests) == 2)
        assert source.requests[1]["headers"]["If-None-Match"] == '"a"'
        await fresh(one, 600)
        source.be(headers={"Cache-Control": "max-age=60"}, etag='"b"', edition="second")
        one.clock.s += 601
        assert (await one.at(3, 5, 2)).content == drawn("/3/5/2")
        await fresh(one, 60)
        assert (await one.at(3, 5, 2)).content == picture("/3/5/2.png?key=SECRETsecond")
        assert len(source.requests) == 3


async def fresh(one: Server, seconds: int) -> None:
    async with asyncio.timeout(10):
        while (await one.at(3, 5, 2)).headers["cache-control"] != f"private, max-age={seconds}":
            await asyncio.sleep(0.02)


async def test_what_must_not_be_kept_is_not(source: Source, tmp_path: Path) -> None:
    source.be(headers={"Cache-Control": "no-store"})
    async with serving(source.upstream(), tmp_path / "data") as one:
        for _ in range(2):
            assert (await one.at(3, 5, 2)).content == drawn("/3/5/2")
        assert len(source.requests) == 2
        assert (await one.layer())["upstream"]["kept_bytes"] == 0


async def test_a_tile_that_does_not_exist_is_not_requested_again_and_again(source: Source, tmp_path: Path) -> None:
    source.be(status=404)
    async with serving(source.upstream(), tmp_path / "data") as one:
        for _ in range(3):
            assert (await one.at(3, 5, 2)).status_code == 204
        assert len(source.requests) == 1
        assert await one.problem() is None
        one.clock.s += 86_401
        source.be()
        await one.at(3, 5, 2)
        await until(lambda: len(source.requests) == 2)


# -- when it does not want, or should not be believed ------------------------------------------------------------------


BAD: dict[str, tuple[dict[str, Any], str, float]] = {
    "requests a pause": ({"status": 429, "headers": {"Retry-After": "120"}}, "requests a pause", 120),
    "requests a pause, by a date": (
        {"status": 503, "headers": {"Retry-After": "Mon, 21 Sep 2026 14:16:40 GMT"}}, "requests a pause", 200
    ),
    "requests a pause, of no length": ({"status": 429}, "requests a pause", 5),
    "refuses the key": ({"status": 403}, r"refuses \(403\): check the key\.", 600),
    "fails": ({"status": 500}, "answers with status 500", 5),
    "points elsewhere": (
        {"status": 302, "headers": {"Location": "http://169.254.169.254/latest"}}, "redirects", 5
    ),
    "a page to log in": ({"body": "<html>log in</html>"}, "something that is not an image", 5),
    "a drawing with a script": ({"body": "<svg onload='alert(1)'/>"}, "something that is not an image", 5),
    "nothing": ({"body": ""}, "something that is not an image", 5),
    "too much": ({"body": "\x89PNG" + "x" * 1000, "times": 2200}, "larger than 2 MB", 5),
    "less than its header states": ({"length": 100_000}, "does not answer", 5),
    "304 without a condition": ({"status": 304, "body": ""}, "answers with status 304", 5),
}  # fmt: skip


@pytest.mark.parametrize(("mood", "sentence", "pause_s"), BAD.values(), ids=BAD)
async def test_a_source_in_a_bad_mood_is_left_alone_for_a_while(
    source: Source, tmp_path: Path, mood: dict[str, Any], sentence: str, pause_s: float
) -> None:
    source.be(**mood)
    async with serving(source.upstream(), tmp_path / "data") as one:
        assert (await one.at(3, 5, 2)).status_code == 204
        problem = await one.problem()
        assert problem is not None
        assert re.search(sentence, problem), problem
        assert problem.endswith((".", "?"))
        assert "SECRET" not in problem
        source.be()
        one.clock.s += pause_s - 1
        assert (await one.at(3, 5, 3)).status_code == 204
        assert len(source.requests) == 1, "no request is sent meanwhile"
        one.clock.s += 2
        assert (await one.at(3, 5, 3)).content == drawn("/3/5/3")
        assert await one.problem() is None


async def test_no_redirect_is_followed_and_no_other_host_dialled(source: Source, tmp_path: Path) -> None:
    other = Source(tmp_path / "elsewhere")
    other.start()
    try:
        source.be(status=302, headers={"Location": f"http://127.0.0.1:{other.port}/3/5/2.png"})
        async with serving(source.upstream(), tmp_path / "data") as one:
            assert (await one.at(3, 5, 2)).status_code == 204
        assert other.requests == []
    finally:
        other.kill()


@pytest.mark.field
async def test_a_source_that_hangs_keeps_nobody_waiting_but_its_own(
    source: Source, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server.web.maps.tile_proxy.WAITS_S", 1.5)
    async with serving(source.upstream(), tmp_path / "data") as one:
        await one.at(3, 5, 2)
        source.be(after_s=30)
        began_s = time.monotonic()
        hanging = [asyncio.create_task(one.at(4, x, 0)) for x in range(8)]
        waits_s = []
        while not all(task.done() for task in hanging):
            at_s = time.monotonic()
            assert (await one.at(3, 5, 2)).status_code == 200
            waits_s.append(time.monotonic() - at_s)
            await asyncio.sleep(0.01)
        assert {(await task).status_code for task in hanging} == {204}
        assert time.monotonic() - began_s < 8
        waits_s.sort()
        assert waits_s[-2] < 1.0, "nobody waits as long as the hanging ones do; once the machine itself may stand still"
        assert len(waits_s) > 20
    assert time.monotonic() - began_s < 9, "nor does the end of the server wait for it"


async def test_older_wishes_give_way_when_there_are_too_many(
    source: Source, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server.web.maps.tile_proxy.LONGEST_QUEUE", 4)
    async with serving(source.upstream(), tmp_path / "data") as one:
        tiles = (await one.layer())["tiles"]
        source.be(held=True)
        older = {asyncio.create_task(one.client.get(tiles.format(z=6, x=x, y=0))) for x in range(11)}
        while sum(task.done() for task in older) < 5:  # two are fetched, four wait
            await asyncio.wait({task for task in older if not task.done()}, return_when=asyncio.FIRST_COMPLETED)
        newest = asyncio.create_task(one.client.get(tiles.format(z=6, x=11, y=0)))
        while sum(task.done() for task in older) < 6:
            await asyncio.wait({task for task in older if not task.done()}, return_when=asyncio.FIRST_COMPLETED)
        source.be()
        assert sorted([(await task).status_code for task in older]) == [200] * 5 + [204] * 6
        assert (await newest).status_code == 200, "the newest is of what is in sight"


async def test_nobody_fetches_a_whole_country(source: Source, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("server.web.maps.tile_fetcher.MOST", 5)
    async with serving(source.upstream(), tmp_path / "data") as one:
        for x in range(8):
            await one.at(6, x, 0)
        assert len(source.requests) == 5
        assert "more come later" in str(await one.problem())
        one.clock.s += 601
        assert (await one.at(6, 7, 0)).status_code == 200


@pytest.mark.parametrize(("z", "x", "y"), [(4, 0, 0), (9, 0, 0), (6, 64, 0), (6, 0, 64), (30, 0, 0)])
async def test_beyond_its_levels_nothing_is_requested(source: Source, tmp_path: Path, z: int, x: int, y: int) -> None:
    async with serving(source.upstream(zoom=(5, 8)), tmp_path / "data") as one:
        layer = await one.layer()
        assert (layer["min_zoom"], layer["max_zoom"]) == (5, 8)
        assert (await one.at(z, x, y)).status_code == 204
        assert source.requests == []


async def test_a_key_in_the_address_is_never_shown(
    source: Source, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG)
    async with serving(source.upstream(), tmp_path / "data") as one:
        await one.at(3, 5, 2)
        source.kill()
        await one.at(3, 5, 3)
        texts = [
            (await one.client.get(path)).text for path in ("/api/map", "/api/state", "/api/about", "/metrics", "/")
        ]
    assert [text for text in texts if "SECRET" in text] == []
    assert [record for record in caplog.records if "SECRET" in record.getMessage() and "catgraph" in record.name] == []
    assert "SECRET" not in "".join(path.name for path in tmp_path.rglob("*"))


# -- the file ----------------------------------------------------------------------------------------------------------


def cache(path: Path, limit_bytes: int = 10_000_000) -> TileCache:
    return TileCache(path, title="t", attribution="© t", limit_bytes=limit_bytes)


def kept(size: int = 1000, until_s: float = 1e12) -> Kept:
    return Kept(data=b"\x89PNG\r\n\x1a\n" + bytes(size - 8), until_s=until_s, etag=None, modified=None)


def test_the_longest_unseen_are_evicted_and_counted(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with closing(cache(tmp_path / "a.mbtiles", limit_bytes=20_000)) as one:
        for x in range(16):
            one.put((8, x, 0), kept(), now_s=1000.0 + x)
        assert one.evicted == 0
        one.get((8, 0, 0), now_s=10_000.0)  # somebody looks at the oldest
        one.put((8, 16, 0), kept(), now_s=10_001.0)
        assert 0 < one.evicted <= 3
        assert one.size_bytes <= 20_000
        assert one.get((8, 0, 0), now_s=10_002.0) is not None
        assert one.get((8, 1, 0), now_s=10_002.0) is None
        size = one.size_bytes
        assert "map tiles deleted" in caplog.text
    with closing(cache(tmp_path / "a.mbtiles")) as again:
        assert again.size_bytes == size
    with closing(MapFile(tmp_path / "a.mbtiles")) as file:
        assert file.tile(8, 1, 0) is None, "gone from the map, too"
        assert file.tile(8, 16, 0) is not None


def test_a_writer_that_is_killed_leaves_a_file_that_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.mbtiles"
    program = (
        "import os, sys\nfrom pathlib import Path\nfrom server.web.maps.tile_cache import Kept, TileCache\n"
        "one = TileCache(Path(sys.argv[1]), title='t', attribution='', limit_bytes=10**7)\n"
        "data = b'\\x89PNG\\r\\n\\x1a\\n' + bytes(9)\n"
        "one.put((5, 1, 2), Kept(data=data, until_s=9e9, etag=None, modified=None), 1.0)\n"
        "os.kill(os.getpid(), 9)\n"
    )
    subprocess.run([sys.executable, "-c", program, str(path)], check=False)
    with closing(cache(path)) as one:
        found = one.get((5, 1, 2), 2.0)
        assert found is not None
        assert found.data is not None


def test_a_file_that_is_none_is_put_aside(tmp_path: Path) -> None:
    path = tmp_path / "a.mbtiles"
    path.write_bytes(b"no database at all" * 100)
    with closing(cache(path)) as one:
        one.put((5, 1, 2), kept(), 1.0)
        assert one.get((5, 1, 2), 2.0) is not None
    assert path.with_name("a.mbtiles.damaged").read_bytes().startswith(b"no database")


def test_what_cannot_be_written_is_reported_and_not_waited_for(tmp_path: Path) -> None:
    with closing(cache(tmp_path / "a.mbtiles")) as one:
        one.put((5, 1, 2), kept(), 1.0)
        one._rows.execute("PRAGMA max_page_count = 1")  # as on a disk that is full
        one.put((5, 1, 3), kept(500_000), 1.0)
        assert one.problem == "Tiles cannot be stored: check the disk space."
        assert one.get((5, 1, 2), 2.0) is not None
        assert one.get((5, 1, 3), 2.0) is None
    one.put((5, 1, 3), kept(), 1.0)  # after the end: nothing
    assert one.get((5, 1, 2), 2.0) is None


# -- how it is requested -----------------------------------------------------------------------------------------------


GOOD = "https://tiles.example/{z}/{x}/{y}.png?key=1"


@pytest.mark.parametrize(
    ("template", "attribution", "zoom", "limit_mb", "sentence"),
    [
        ("ftp://tiles.example/{z}/{x}/{y}", "©", "0-19", 500, "must begin with https"),
        ("https:///{z}/{x}/{y}", "©", "0-19", 500, "must begin with https"),
        ("https://tiles.example:99999/{z}/{x}/{y}", "©", "0-19", 500, "not valid|must begin"),
        ("https://me:pw@tiles.example/{z}/{x}/{y}", "©", "0-19", 500, "name and password"),
        ("https://{s}.tiles.example/{z}/{x}/{y}", "©", "0-19", 500, "one host"),
        ("https://{x}.tiles.example/{z}/{y}", "©", "0-19", 500, "one host"),
        ("https://tiles.example/{z}/{x}", "©", "0-19", 500, "once each"),
        ("https://tiles.example/{z}/{x}/{y}/{y}", "©", "0-19", 500, "once each"),
        ("https://tiles.example/{z}/{x}/{y}{r}", "©", "0-19", 500, "once each"),
        ("https://tiles.example/{z}/{x}/{y}#a", "©", "0-19", 500, "a #"),
        ("https://tiles.example/{z}/{x}/{y}\r\nHost: evil", "©", "0-19", 500, "characters that are not allowed"),
        ("https://tiles.example/{z}/{x}/{y}?" + "k" * 600, "©", "0-19", 500, "too long"),
        (GOOD, " ", "0-19", 500, "--map-attribution"),
        (GOOD, "©", "9-3", 500, "two levels"),
        (GOOD, "©", "0-99", 500, "two levels"),
        (GOOD, "©", "all", 500, "two levels"),
        (GOOD, "©", "0-19", 1, "from 10"),
    ],
)
def test_what_cannot_be_an_upstream(template: str, attribution: str, zoom: str, limit_mb: int, sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence) as why:
        checked(template, attribution, zoom, limit_mb)
    assert "key=1" not in str(why.value)
    assert "\n" not in str(why.value)


def test_what_can_be_one() -> None:
    found = checked("http://[::1]:8080/{z}/{x}/{-y}.jpg", "© us", "3-17", 100)
    assert (found.host, found.zoom, found.limit_mb) == ("[::1]:8080", (3, 17), 100)


async def test_rows_counted_from_the_south_where_the_source_does_so(source: Source, tmp_path: Path) -> None:
    upstream = source.upstream(template=f"http://127.0.0.1:{source.port}/{{z}}/{{x}}/{{-y}}.png")
    async with serving(upstream, tmp_path / "data") as one:
        assert (await one.at(3, 5, 2)).content == picture("/3/5/5.png")


def test_without_a_data_folder_there_is_no_upstream(source: Source) -> None:
    with pytest.raises(MapRefused, match="needs a data folder"):
        create_app(Config(map_upstream=source.upstream()))


@pytest.mark.field
@pytest.mark.parametrize("command", ["serve", "demo"])
def test_the_command_reports_what_is_missing(tmp_path: Path, command: str) -> None:
    arguments = ["--port", "0", "--data", str(tmp_path), "--map-upstream", GOOD]
    done = subprocess.run(
        [sys.executable, "-m", "server", command, *arguments],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr == "catgraph: --map-upstream needs --map-attribution, which is shown on the map.\n"
