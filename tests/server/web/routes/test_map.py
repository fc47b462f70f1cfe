"""Map files and the site's picture: the right tile in the right row, one clear sentence for what cannot be drawn."""

from __future__ import annotations

import gzip
import sqlite3
import subprocess
import sys
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, closing
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.app.app import create_app
from server.app.config import Config
from server.web.maps.image_type import media_type, plain_text
from server.web.maps.layers import site_image
from server.web.maps.mbtiles import MapFile, MapRefused
from tests.http import http_client
from tests.server.web import map_files as maps
from tests.server.web.map_files import png

NORTH, SOUTH = png(255, 0, 0, 8), png(0, 0, 255, 8)
HALVES = [(0, 0, 0, png(9, 9, 9, 8)), (1, 0, 0, SOUTH), (1, 0, 1, NORTH)]  # MBTiles counts rows from the south
JPEG, WEBP = b"\xff\xd8\xff\xe0" + bytes(20), b"RIFF\x10\x00\x00\x00WEBPVP8 " + bytes(8)
CORNERS = "[corners]\ntop_left = [32.24, -110.96]\ntop_right = [32.24, -110.95]\nbottom_left = [32.23, -110.96]\n"


@pytest.fixture
def halves(tmp_path: Path) -> Path:
    """A map of the world's western half in two zoom levels."""
    return maps.write(tmp_path / "halves.mbtiles", HALVES, format="png", name="Halves", bounds="-180,-85,0,85")


@asynccontextmanager
async def asking(**config: Any) -> AsyncIterator[httpx.AsyncClient]:
    app = create_app(Config(**config))
    async with http_client(transport=httpx.ASGITransport(app), base_url="http://localhost") as client:
        yield client
    app.state.services.ground.close()


@pytest.fixture
async def client(halves: Path) -> AsyncIterator[httpx.AsyncClient]:
    async with asking(maps=(halves,)) as one:
        yield one


async def ground(client: httpx.AsyncClient) -> Any:
    return (await client.get("/api/map")).json()


async def at(client: httpx.AsyncClient, z: object, x: object, y: object) -> httpx.Response:
    return await client.get((await ground(client))["layers"][0]["tiles"].format(z=z, x=x, y=y))


async def test_rows_are_counted_from_the_north(client: httpx.AsyncClient) -> None:
    """Row 0 of a browser is the north; an MBTiles file has it as its last."""
    assert (await at(client, 1, 0, 0)).content == NORTH
    assert (await at(client, 1, 0, 1)).content == SOUTH
    assert (await at(client, 0, 0, 0)).status_code == 200


async def test_a_tile_may_be_kept_for_ever_and_is_nothing_but_a_picture(client: httpx.AsyncClient) -> None:
    headers = (await at(client, 1, 0, 0)).headers
    assert headers["content-type"] == "image/png"
    assert headers["cache-control"] == "public, max-age=31536000, immutable"
    assert headers["x-content-type-options"] == "nosniff"


async def test_what_the_page_gets(client: httpx.AsyncClient) -> None:
    (layer,) = (await ground(client))["layers"]
    assert layer | {"tiles": ""} == {
        "title": "Halves", "tiles": "", "min_zoom": 0, "max_zoom": 1, "bounds": [-180, -85, 0, 85], "attribution": "",
    }  # fmt: skip
    assert (await ground(client))["image"] is None


def test_another_content_has_another_address(halves: Path) -> None:
    with closing(MapFile(halves)) as before:
        with closing(sqlite3.connect(halves)) as rows, rows:
            rows.execute("UPDATE tiles SET tile_data = ?", (png(1, 2, 3, 64),))
        with closing(MapFile(halves)) as after:
            assert before.layer.name != after.layer.name


async def test_a_place_without_a_tile_is_no_error(client: httpx.AsyncClient) -> None:
    answer = await at(client, 1, 1, 0)
    assert (answer.status_code, answer.content) == (204, b"")


@pytest.mark.parametrize(
    ("z", "x", "y", "status"),
    [
        (1, 2, 0, 204), (1, 0, 2, 204), (25, 0, 0, 204), (999999999, 0, 0, 204), (24, 999999999, 0, 204),
        (1, -1, 0, 404), ("1.0", 0, 0, 404), ("x", 0, 0, 404), ("1e1", 0, 0, 404), ("٣", 0, 0, 404),
        ("9" * 5000, 0, 0, 404), (0, "9" * 5000, 0, 404), (1, 0, "0 OR 1=1", 404), (1, 0, "0%00", 404),
        (1, 0, "%2e%2e%2f%2e%2e%2fetc%2fpasswd", 404),
    ],
)  # fmt: skip
async def test_hostile_numbers_are_no_tile(
    client: httpx.AsyncClient, z: object, x: object, y: object, status: int
) -> None:
    assert (await at(client, z, x, y)).status_code == status


@pytest.mark.parametrize("name", ["0123456789ab", "..", "halves.mbtiles", "%00"])
async def test_only_files_that_were_named_are_served(client: httpx.AsyncClient, name: str) -> None:
    assert (await client.get(f"/map/{name}/0/0/0")).status_code == 404
    assert (await client.get(f"/map/site/{name}")).status_code == 404


async def test_several_maps_keep_their_order_and_one_named_twice_is_one(tmp_path: Path, halves: Path) -> None:
    other = maps.write(tmp_path / "other.mbtiles", [(5, 1, 1, JPEG)], format="jpg", name="Other")
    async with asking(maps=(halves, other, halves)) as client:
        layers = (await ground(client))["layers"]
        assert [layer["title"] for layer in layers] == ["Halves", "Other"]
        answer = await client.get(layers[1]["tiles"].format(z=5, x=1, y=30))
        assert (answer.content, answer.headers["content-type"]) == (JPEG, "image/jpeg")


# -- what a file tells of itself ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("stated", "bounds"),
    [
        ("-111,32,-110.5,32.5", (-111, 32, -110.5, 32.5)),
        (" -111, 32, -110.5, 32.5 ", (-111, 32, -110.5, 32.5)),
        ("170,-20,-170,-10", (-180, -90, 180, 90)),  # across the antimeridian: no rectangle of degrees
        ("1,2,3", (-180, -90, 180, 90)),
        ("nan,nan,nan,nan", (-180, -90, 180, 90)),
        ("-inf,-90,inf,90", (-180, -90, 180, 90)),
        ("west,south,east,north", (-180, -90, 180, 90)),
        ("-181,0,0,1", (-180, -90, 180, 90)),
    ],
)
def test_bounds(tmp_path: Path, stated: str, bounds: tuple[float, ...]) -> None:
    with closing(MapFile(maps.write(tmp_path / "a.mbtiles", HALVES, bounds=stated))) as one:
        assert one.layer.bounds == bounds


def test_zoom_levels_are_looked_up_where_the_file_does_not_say(tmp_path: Path) -> None:
    with closing(MapFile(maps.write(tmp_path / "a.mbtiles", [(7, 1, 1, NORTH), (9, 1, 1, NORTH)]))) as one:
        assert one.layer.zoom == (7, 9)
    with closing(MapFile(maps.write(tmp_path / "b.mbtiles", HALVES, minzoom="0", maxzoom="14"))) as one:
        assert one.layer.zoom == (0, 14)


@pytest.mark.parametrize(
    ("markup", "text"),
    [
        ('<a href="https://osm.example/c">© OpenStreetMap</a> contributors', "© OpenStreetMap contributors"),
        ("&copy; Survey &amp; Sons", "© Survey & Sons"),
        ("<script>alert(1)</script>by us<img src=x onerror=alert(1)>", "by us"),
        ("<style>*{}</style>a\n\n\tb", "a b"),
        ("&lt;b&gt;", "<b>"),  # as letters: the page writes text, not markup
        ("\u202eabc\x00\x1b[0m", "abc[0m"),
        ("x" * 900, "x" * 200),
        ("</script></style>left", "left"),
        ("", ""),
    ],
)
def test_an_attribution_is_plain_text(tmp_path: Path, markup: str, text: str) -> None:
    assert plain_text(markup) == text
    with closing(MapFile(maps.write(tmp_path / "a.mbtiles", HALVES, attribution=markup, name=markup or "n"))) as one:
        assert one.layer.attribution == text


@pytest.mark.parametrize(
    ("data", "kind"),
    [
        (NORTH, "image/png"),
        (JPEG, "image/jpeg"),
        (WEBP, "image/webp"),
        (b"<svg xmlns=", None),
        (b"GIF89a", None),
        (b"", None),
    ],
)
def test_the_kind_of_a_picture(data: bytes, kind: str | None) -> None:
    assert media_type(data) == kind


# -- what cannot be drawn ----------------------------------------------------------------------------------------------


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:700])


def overwrite(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[2000:] = b"\xa5" * (len(data) - 2000)
    path.write_bytes(data)


def drop_tiles(path: Path) -> None:
    with closing(sqlite3.connect(path)) as rows:
        rows.execute("DROP TABLE tiles")


BAD: dict[str, tuple[Callable[[Path], Any], str]] = {
    "not there": (lambda path: path.unlink(), "There is no map"),
    "a folder": (lambda path: (path.unlink(), path.mkdir()), "There is no map"),
    "no database": (lambda path: path.write_text("tiles"), "is not an MBTiles file, or is damaged"),
    "cut off": (cut, "damaged|cannot be read"),
    "overwritten": (overwrite, "damaged|cannot be read|holds tiles that are neither"),
    "empty": (lambda path: path.write_bytes(b""), "has no tiles"),
    "another database": (drop_tiles, "is not an MBTiles file: it has no tiles"),
    "vector by its format": (
        lambda path: (path.unlink(), maps.write(path, [(0, 0, 0, b"\x1a\x02")], format="pbf")), "has vector tiles"
    ),
    "vector by its bytes": (
        lambda path: (path.unlink(), maps.write(path, [(0, 0, 0, gzip.compress(b"\x1a"))], format="png")),
        "has vector tiles",
    ),
    "no tile in it": (lambda path: (path.unlink(), maps.write(path, [], format="png")), "has no tiles"),
    "no pictures": (
        lambda path: (path.unlink(), maps.write(path, [(0, 0, 0, b"<svg/>")], format="svg")), "neither png, nor jpg"
    ),
    "a text for a tile": (
        lambda path: (path.unlink(), maps.write(path, [(0, 0, 0, "text")])), "neither png"  # type: ignore[list-item]
    ),
    "absurd zoom levels": (
        lambda path: (path.unlink(), maps.write(path, HALVES, minzoom="9", maxzoom="3")), "zoom levels: 9 to 3"
    ),
    "a zoom level far beyond": (
        lambda path: (path.unlink(), maps.write(path, HALVES, minzoom="0", maxzoom="99")), "zoom levels: 0 to 99"
    ),
}  # fmt: skip


@pytest.mark.parametrize(("spoil", "sentence"), BAD.values(), ids=BAD)
def test_a_file_that_cannot_be_drawn_is_refused(halves: Path, spoil: Callable[[Path], Any], sentence: str) -> None:
    spoil(halves)
    with pytest.raises(MapRefused, match=sentence) as why:
        create_app(Config(maps=(halves,)))
    assert str(why.value).endswith(".")
    assert "\n" not in str(why.value)


def test_a_file_damaged_later_has_no_tile_there_and_is_logged_once(
    halves: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with closing(MapFile(halves)) as one:
        with halves.open("r+b") as file:
            file.truncate(4096)
        one._rows.execute("PRAGMA shrink_memory")  # else SQLite would answer out of what it has read
        found = [one.tile(1, 0, 0), one.tile(1, 0, 1)]
    assert None in found
    assert len([record for record in caplog.records if "map damaged" in record.message]) == 1


def test_a_file_whose_writer_left_it_in_wal_mode_is_read(halves: Path) -> None:
    with closing(sqlite3.connect(halves)) as rows:
        rows.execute("PRAGMA journal_mode = wal")
    with closing(MapFile(halves)) as one:
        assert one.tile(1, 0, 0) == (NORTH, "image/png")


def test_nothing_is_written_to_a_map(halves: Path) -> None:
    with closing(MapFile(halves)) as one, pytest.raises(sqlite3.OperationalError):
        one._rows.execute("DELETE FROM tiles")


@pytest.mark.parametrize("command", ["serve", "demo"])
def test_the_command_ends_with_one_sentence(tmp_path: Path, command: str) -> None:
    wrong = tmp_path / "wrong.mbtiles"
    wrong.write_text("no")
    done = subprocess.run(
        [sys.executable, "-m", "server", command, "--port", "0", "--data", str(tmp_path / "data"), "--map", str(wrong)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.startswith(f"catgraph: {wrong} is not an MBTiles file, or is damaged")
    assert done.stderr.count("\n") == 1


# -- the picture of the site -------------------------------------------------------------------------------------------


def picture(folder: Path, beside: str | None = CORNERS, data: bytes = NORTH) -> Path:
    path = folder / "site.png"
    path.write_bytes(data)
    if beside is not None:
        path.with_name("site.png.toml").write_text(beside)
    return path


async def test_a_site_image_is_served_with_its_corners(tmp_path: Path) -> None:
    path = picture(tmp_path, 'attribution = "Survey <b>2026</b>"\n' + CORNERS)
    async with asking(site_image=path) as client:
        image = (await ground(client))["image"]
        assert image["corners"] == [[32.24, -110.96], [32.24, -110.95], [32.23, -110.96]]
        assert image["attribution"] == "Survey 2026"
        answer = await client.get(image["source"])
        assert (answer.content, answer.headers["content-type"]) == (NORTH, "image/png")
        assert "immutable" in answer.headers["cache-control"]
        assert (await client.get("/map/site/0123456789ab")).status_code == 404


@pytest.mark.parametrize(
    ("beside", "sentence"),
    [
        (None, "must be in .*site.png.toml: No such file"),
        ("", "corners: Field required"),
        ("corners = 5", "corners"),
        ("[corners", "are not usable"),
        (CORNERS.replace("32.24, -110.96", "92.24, -110.96"), "corners.top_left.0: Input should be less than"),
        (CORNERS.replace("32.24, -110.96", "nan, -110.96"), "corners.top_left.0"),
        (CORNERS.replace("32.24, -110.96", "32.24"), "corners.top_left"),
        (CORNERS.replace("bottom_left", "bottom"), "corners.bottom"),
        (CORNERS.replace("-110.95]", "-110.96]"), "are 0 m apart"),
        (CORNERS.replace("-110.95]", "-100.95]"), "m apart"),
        (CORNERS.replace("bottom_left = [32.23, -110.96]", "bottom_left = [32.24, -110.97]"), "are on one line"),
        (CORNERS + "[more]\n", "more: Extra inputs"),
    ],
)
def test_corners_that_are_none(tmp_path: Path, beside: str | None, sentence: str) -> None:
    with pytest.raises(MapRefused, match=sentence) as why:
        site_image(picture(tmp_path, beside))
    assert str(why.value).endswith(".")


def test_a_site_image_across_the_antimeridian_lies_where_it_should(tmp_path: Path) -> None:
    far = "[corners]\ntop_left = [-17, 179.995]\ntop_right = [-17, -179.995]\nbottom_left = [-17.01, 179.995]\n"
    assert site_image(picture(tmp_path, far)).corners[1] == (-17, -179.995)


def test_a_site_image_that_is_no_picture(tmp_path: Path) -> None:
    with pytest.raises(MapRefused, match="neither png, nor jpg, nor webp"):
        site_image(picture(tmp_path, data=b"<svg onload=alert(1)>"))
    with pytest.raises(MapRefused, match=r"cannot be read: No such file or directory\.$"):
        site_image(tmp_path / "none.png")
