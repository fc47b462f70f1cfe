"""TOML from outside is bounded before it is parsed, at each door by which it comes."""

from __future__ import annotations

import asyncio
import random
import time
import tomllib
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest

from server.analysis.thresholds import BadSettingsFile, read_override
from server.app.config import Config
from server.judge.active_settings import recorded_override
from server.judge.settings import BadSetting, SettingsFile, from_toml, salvage
from server.mail.settings import MailSettingsFile
from server.recording.event_channels import MOST_SETTINGS, read_recorded_events
from server.storage.bounded_toml import MAX_BYTES, MAX_ENTRIES, MAX_LINE, MAX_NESTING, MAX_PARTS, BadToml, loads
from server.web.maps.layers import site_image
from server.web.maps.mbtiles import MapRefused
from tests.server.conftest import serving
from tests.tree import PROJECT

pytestmark = pytest.mark.world(n=21)

WITHIN_S = 0.25  # measured: 0.03 s; the rest is for machines that are busy
NINE = ".".join("a" * (MAX_PARTS + 1))  # a name of nine parts, where eight are allowed
DOTTED = f"{NINE}=1"
BEYOND = {  # by one
    "one name": DOTTED,
    "names a line": "b=1\nc.d=1\n" + DOTTED,
    "a heading": f"[{NINE}]",
    "in a table": f"x={{{NINE}=1}}",
    "with spaces": f"{NINE.replace('.', ' . ')}=1",
    "quoted": "a" + '."a"' * MAX_PARTS + "=1",
    "behind a text": f'x={{y="""a""",{NINE}=1}}',
    "behind an escape": f'x={{y="\\"",{NINE}=1}}',
    "behind a literal": f"x={{y='\\',{NINE}=1}}",
    "arrays": "a=" + "[" * (MAX_NESTING + 1) + "]" * (MAX_NESTING + 1),
    "tables": "a=" + "{a=" * (MAX_NESTING + 1) + "1" + "}" * (MAX_NESTING + 1),
}
SLOWEST = {  # within the bounds
    "dotted names": "".join(f"{'a.' * (MAX_PARTS - 2)}k{i}=1\n" for i in range(MAX_ENTRIES - 10)),
    "headings": "".join(f"[{'a.' * (MAX_PARTS - 1)}k{i}]\n" for i in range(MAX_ENTRIES - 10)),
    "headings and names": "".join(f"[h{i}]\na.b.c.d.e.f.g.h=1\n" for i in range(MAX_ENTRIES // 2 - 10)),
    "comments": "#\n" * 32_000,
    "lines": "\n" * 65_000,
    "a long text": 'a="""' + "\\\n" * 30_000 + '"""',
    "an open text": 'a="""' + '"" x\n' * 12_000,
    "times": "".join(f"k{i}=1979-05-27T07:32:00.999999-07:00\n" for i in range(1500)),
    "digits": "".join(f"k{i}={'1' * 2000}.{'1' * 1900}e1\n" for i in range(16)),
    "a late error": "".join(f"k{i}=1\n" for i in range(MAX_ENTRIES - 2)) + "k1=1",
}


def taken(read: Callable[[str], object], text: str) -> object:
    """What a reader makes of a text, or why it does not."""
    try:
        return read(text)
    except (ValueError, RecursionError) as why:
        return why


def took_s(text: str) -> float:
    began_s = time.thread_time()
    try:
        loads(text)
    except BadToml:
        pass
    return time.thread_time() - began_s


@pytest.mark.parametrize("name", BEYOND)
def test_what_is_beyond_a_bound_is_refused_before_it_is_parsed(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each is TOML, which the library would read."""
    assert tomllib.loads(BEYOND[name])
    monkeypatch.delattr(tomllib, "loads")
    with pytest.raises(BadToml, match=r"(parts|deep)\.$"):
        loads(BEYOND[name])


@pytest.mark.parametrize("quotes", ['"""', "'''"])
@pytest.mark.parametrize("more", [0, 1, 2])
def test_no_text_hides_a_name(quotes: str, more: int) -> None:
    """A text may end with two quotes more, which belong to it."""
    text = f"x={{y={quotes}a{quotes}{quotes[:more]},{NINE}=1}}"
    assert tomllib.loads(text)
    with pytest.raises(BadToml, match="parts"):
        loads(text)


@pytest.mark.parametrize("name", SLOWEST)
def test_the_slowest_text_within_the_bounds_is_quick(name: str) -> None:
    assert len(SLOWEST[name]) <= MAX_BYTES
    assert min(took_s(SLOWEST[name]) for _ in range(3)) < WITHIN_S


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("#" * (MAX_BYTES + 1), "at most 64 kB"),
        ("#" + "é" * (MAX_BYTES // 2), "at most 64 kB"),
        ("#" * (MAX_LINE + 1), "at most 4096 characters"),
        (".".join("a" * (MAX_PARTS + 1)) + "=1", "at most 8 parts"),
        ("a=" + "[" * (MAX_NESTING + 1) + "]" * (MAX_NESTING + 1), "nest at most 8 deep"),
        ("a=[" + "1," * (MAX_ENTRIES + 1) + "]", "at most 2000 entries"),
        (b"a='\xff'", "not UTF-8 text"),
        ("a='\x1b[2J'", "This is not TOML: Found invalid character"),
        ("a=" + "1" * 4301, "at most 4096 characters|This is not TOML"),
    ],
)
def test_each_bound_has_its_sentence(text: str | bytes, why: str) -> None:
    with pytest.raises(BadToml, match=why) as caught:
        loads(text)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 200


def test_what_people_write_is_read_as_before() -> None:
    for path in [*PROJECT.glob("server/profiles/*.toml"), PROJECT / "pyproject.toml"]:
        text = path.read_text(encoding="utf-8")
        assert loads(text) == tomllib.loads(text)
    at_the_bounds = ".".join("a" * MAX_PARTS) + "=" + "[" * MAX_NESTING + "]" * MAX_NESTING
    assert loads(at_the_bounds)["a"]
    assert loads('a="""it\'s a.b.c.d.e.f.g.h.i.j [[[[[[[[["""') == tomllib.loads(
        'a="""it\'s a.b.c.d.e.f.g.h.i.j [[[[[[[[["""'
    )


def test_any_mixture_of_signs_is_quick_and_read_as_tomllib_reads_it() -> None:
    """What tomllib takes is taken with the same result, or refused for its bounds; nothing takes long."""
    chance = random.Random(21)
    pieces = ["a", ".", "=", "1", "\n", "[", "]", "{", "}", ",", '"', "'", '"""', "'''", "\\", "#", " ", "é", "a.b=1\n"]
    read = 0
    for _ in range(4000):
        text = "".join(chance.choices(pieces, k=chance.randrange(1, 40)))
        expected, found = taken(tomllib.loads, text), taken(loads, text)
        assert found == expected or "at most" in str(found) or isinstance(expected, Exception), text
        read += isinstance(found, dict)
    assert read > 50


# -- each door ---


def test_every_reader_of_toml_is_bounded(tmp_path: Path) -> None:
    with pytest.raises(BadSetting, match="8 parts"):
        from_toml(DOTTED)
    assert salvage(DOTTED, {})[1] == ["A name in TOML has at most 8 parts."]
    assert any("8 parts" in sentence for sentence in recorded_override(DOTTED)[1])
    file = tmp_path / "settings.toml"
    file.write_text(DOTTED)
    with pytest.raises(BadSettingsFile, match="8 parts"):
        read_override(file)
    kept = SettingsFile(file)
    kept.read()
    assert "8 parts" in (kept.complaint or "")
    mail = tmp_path / "mail.toml"
    mail.write_text(DOTTED)
    found = MailSettingsFile(mail)
    found.read()
    assert found.complaint is not None
    picture = tmp_path / "site.png"
    picture.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    picture.with_name("site.png.toml").write_text(DOTTED)
    with pytest.raises(MapRefused, match="8 parts"):
        site_image(picture)


def test_only_one_module_parses_toml_from_outside() -> None:
    """`server/profiles` reads the files that are shipped with it."""
    users = {
        str(path.relative_to(PROJECT))
        for folder in ("server", "monitor", "vehicle")
        for path in (PROJECT / folder).rglob("*.py")
        if "import tomllib" in path.read_text(encoding="utf-8")
    }
    assert users == {"server/storage/bounded_toml.py", "server/judge/profiles/__init__.py"}


async def test_no_settings_file_holds_the_server_up() -> None:
    """Sent as an operator's program sends it: the slowest texts, while the loop's thread counts its own work."""
    longest_s = 0.0
    async with serving(Config()) as base, httpx.AsyncClient(base_url=base, timeout=20) as client:

        async def watch() -> None:
            nonlocal longest_s
            while True:
                before_s = time.thread_time()
                await asyncio.sleep(0.005)
                longest_s = max(longest_s, time.thread_time() - before_s)

        watcher = asyncio.create_task(watch())
        for text in (*BEYOND.values(), *SLOWEST.values()):
            answer = await client.put("/api/settings.toml", content=text[:MAX_BYTES].encode())
            assert answer.status_code in (200, 422), answer.text
            assert "detail" in answer.json() or text.startswith(("#", "\n"))
        good = await client.put("/api/settings.toml", content=b"[limits.speed_limit]\nmax_mps = 7.0\n")
        assert good.json()["values"]["speed_limit.max_mps"] == 7.0
        watcher.cancel()
    assert longest_s < 0.5


@pytest.mark.field
async def test_settings_are_read_beside_the_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    """A file that takes long, as none should, delays its own answer only."""
    from server.judge import active_settings

    def slow(*_: object) -> object:
        time.sleep(0.5)
        raise BadSetting("", "Too slow.")

    monkeypatch.setattr(active_settings, "from_toml", slow)
    async with serving(Config()) as base, httpx.AsyncClient(base_url=base, timeout=20) as client:
        order = asyncio.create_task(client.put("/api/settings.toml", content=b"[limits]\n"))
        await asyncio.sleep(0.05)
        assert (await client.get("/api/health")).status_code == 200
        assert not order.done()
        assert (await order).json()["detail"] == "Too slow."


class ManySettings:
    """A recording whose settings change without end."""

    def __init__(self) -> None:
        self.metadata: dict[str, str] = {}
        self.start_s = 0.0

    def own(self, topic: str) -> object:
        return ((float(i), {"toml": f"version = {i}"}) for i in range(5000) if topic == "/catgraph/settings")


def test_a_recordings_settings_are_read_so_many_times_and_the_rest_is_named() -> None:
    recorded = read_recorded_events(ManySettings())  # type: ignore[arg-type]
    assert len(recorded.events) == MOST_SETTINGS
    assert recorded.notes == (f"{5000 - 1 - MOST_SETTINGS} invalid entries of catgraph's own channels are left out.",)


def test_the_bounds_leave_room_for_all_settings() -> None:
    from monitor import catalog

    assert len(catalog.schema()) * 5 < MAX_ENTRIES
