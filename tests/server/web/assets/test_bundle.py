"""The page's joined files: made of what lies here now, or not used."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from server.app.config import Config
from server.system.page_files import static_dir
from server.web.assets.bundle import FLEET_STYLES, STYLES, find, join
from server.web.routes.pages import parts_of
from tests.http import http_client
from tests.server.conftest import serving
from tests.tree import PROJECT

TOOLS = PROJECT / "node_modules" / ".bin"
NODE = shutil.which("node") or "node"
STYLE_BYTES = 72_984  # 0.8 of the 91 230 that it had with sizes in px and without nested rules


@pytest.fixture
def static(tmp_path: Path) -> Path:
    """A small page that loads a part of itself later."""
    for folder in ("boot", "core", "scan", "shell"):
        (tmp_path / "js" / folder).mkdir(parents=True)
    (tmp_path / "css").mkdir()
    (tmp_path / "js" / "main.js").write_text(
        "import { greeting } from './core/format.js';\nconsole.log(greeting);\n"
        "globalThis.later = () => import('./later.js');\nglobalThis.theirs = () => import('../vendor/theirs.js');\n"
        "const styled = (name) => `/static/css/${name}.css`;\n"
        "globalThis.styles = [styled('menu'), '/static/css/map-drawn.css'];\n"
        "import './boot/threads.js';\n"
    )
    (tmp_path / "js" / "boot" / "threads.js").write_text(
        "globalThis.thread = new URL('../scan/scan-painter.js', import.meta.url).href;\n"
    )
    (tmp_path / "js" / "scan" / "scan-painter.js").write_text(
        "import { greeting } from '../core/format.js';\nconsole.log('painting', greeting);\n"
    )
    (tmp_path / "js" / "core" / "format.js").write_text("// at once\nexport const greeting = 'hello';\n")
    (tmp_path / "js" / "later.js").write_text(
        "import { greeting } from './core/format.js';\nexport const later = greeting + ' later';\n"
    )
    (tmp_path / "js" / "boot" / "early.js").write_text(
        "// before all others\n(() => {\n  globalThis.early = 'first';\n})();\n"
    )
    (tmp_path / "js" / "shell" / "fleet.js").write_text(
        "import { greeting } from '../core/format.js';\nconsole.log(greeting, 'to all cars');\n"
    )
    for name in {*STYLES, *FLEET_STYLES}:
        (tmp_path / "css" / f"{name}.css").write_text(f".{name} {{ color: red; }}\n")
    (tmp_path / "css" / "menu.css").write_text(".menu { color: red; }\n")
    (tmp_path / "css" / "map-drawn.css").write_text(".map-drawn { color: red; }\n")
    (tmp_path / "vendor").mkdir()
    (tmp_path / "vendor" / "theirs.js").write_text("export const theirs = 'not joined';\n")
    (tmp_path / "fonts").mkdir()
    (tmp_path / "fonts" / "n.woff2").write_bytes(b"a font")
    (tmp_path / "css" / "tokens.css").write_text("@font-face { font-family: n; src: url('../fonts/n.woff2'); }\n")
    join(TOOLS, tmp_path)
    return tmp_path


def test_what_is_installed_here_is_current() -> None:
    built = find(static_dir())
    assert built is not None, "run `make test`, or `python -m server.web.assets.bundle node_modules/.bin`"
    assert all((static_dir() / name).is_file() for name in (built.script, built.style, *built.needed))


def test_the_style_sheet_of_the_first_picture_is_small() -> None:
    built = find(static_dir())
    assert built is not None
    assert (static_dir() / built.style).stat().st_size <= STYLE_BYTES


def test_the_joined_script_says_what_the_many_said_and_the_rest_comes_later(static: Path) -> None:
    built = find(static)
    assert built is not None
    program = (
        f"await import({json.dumps(str(static / built.script))}); console.log((await later()).later);"
        "console.log((await theirs()).theirs);"
    )
    done = subprocess.run([NODE, "--input-type=module", "-e", program], capture_output=True, text=True, check=True)
    first, second, third = done.stdout.splitlines()
    assert (first, second) == ("hello", "hello later")
    assert third == "not joined", "others' files are found from here too"
    assert " later" not in (static / built.script).read_text() + "".join((static / n).read_text() for n in built.needed)
    style = (static / built.style).read_text()
    assert re.findall(r"\.(\w+)\{", style) == list(STYLES[1:]), "in their order"
    (font,) = built.fonts
    assert f'"./{font.removeprefix("built/")}"' in style
    assert (static / font).read_bytes() == b"a font"
    assert "first" in built.early
    assert "before" not in built.early, "without comments"
    assert "\n" not in built.early


def test_the_page_of_all_cars_is_joined_for_itself(static: Path) -> None:
    built = find(static)
    assert built is not None
    program = f"await import({json.dumps(str(static / built.fleet.script))});"
    done = subprocess.run([NODE, "--input-type=module", "-e", program], capture_output=True, text=True, check=True)
    assert done.stdout == "hello to all cars\n"
    style = (static / built.fleet.style).read_text()
    assert re.findall(r"\.(\w+)\{", style) == list(FLEET_STYLES[1:])
    assert "all cars" not in "".join((static / name).read_text() for name in (built.script, *built.needed))
    assert parts_of(built, str, is_fleet=True)["script"] == f"/static/{built.fleet.script}"


def test_what_is_fetched_later_has_the_hash_of_its_content_in_its_address(static: Path) -> None:
    def addresses() -> list[str]:
        built = find(static)
        assert built is not None
        program = f"await import({json.dumps(str(static / built.script))}); console.log(JSON.stringify(styles));"
        done = subprocess.run([NODE, "--input-type=module", "-e", program], capture_output=True, text=True, check=True)
        scripts = "".join(path.read_text() for path in (static / "built").glob("*.js"))
        styles: list[str] = json.loads(done.stdout.splitlines()[-1])
        return [*styles, *re.findall(r"vendor/theirs\.js\?v=[0-9a-f]{12}", scripts)]

    menu, drawn, theirs = addresses()
    assert (static / menu.removeprefix("/static/")).read_text() == ".menu{color:red}\n"
    assert (static / drawn.removeprefix("/static/")).read_text() == ".map-drawn{color:red}\n"
    (static / "css" / "menu.css").write_text(".menu { color: blue; }\n")
    (static / "vendor" / "theirs.js").write_text("export const theirs = 'another';\n")
    join(TOOLS, static)
    renewed = addresses()
    assert renewed[0] != menu
    assert renewed[1] == drawn
    assert renewed[2] != theirs


def test_the_page_fetches_only_what_may_be_kept_for_ever() -> None:
    built = static_dir() / "built"
    scripts = "".join(path.read_text() for path in built.glob("*.js"))
    plain = re.findall(r"/static/(?!built/)[^\"'`]+", scripts)
    assert set(plain) == {"/static/license.txt"}, "shown on request only"
    vendor = re.findall(r"vendor/[^\"'`]+", scripts)
    assert [address for address in vendor if not re.fullmatch(r"vendor/[\w.]+\?v=[0-9a-f]{12}", address)] == []
    sources = "".join(path.read_text() for path in (static_dir() / "js").rglob("*.js"))
    assert re.findall(r"(?<!function )\bstyled\([^')][^)]*\)", sources) == [], "an address is found by its text"


@pytest.mark.field
def test_the_script_of_a_thread_is_whole_in_itself_and_named_by_its_content(static: Path) -> None:
    built = find(static)
    assert built is not None

    def thread() -> Path:
        found = find(static)
        assert found is not None
        program = f"await import({json.dumps(str(static / found.script))}); console.log(globalThis.thread);"
        done = subprocess.run([NODE, "--input-type=module", "-e", program], capture_output=True, text=True, check=True)
        return Path(done.stdout.splitlines()[-1].removeprefix("file://"))

    first = thread()
    ran = subprocess.run([NODE, "--input-type=module", "-e", first.read_text()], capture_output=True, text=True)
    assert ran.stdout == "painting hello\n"
    (static / "js" / "scan" / "scan-painter.js").write_text("console.log('painting anew');\n")
    join(TOOLS, static)
    second = thread()
    assert second.name != first.name
    assert second.is_file()
    renewed = find(static)
    assert renewed is not None
    assert renewed.script != built.script, "a script that loads another thread is another script"


@pytest.mark.field
@pytest.mark.parametrize(
    "changed", ["js/core/format.js", "js/later.js", "css/wide.css", "fonts/n.woff2", "vendor/theirs.js"]
)
def test_after_a_change_the_joined_files_are_not_used(static: Path, changed: str) -> None:
    assert find(static) is not None
    before = (static / changed).read_text()
    (static / changed).write_text(before + "\n/* new */\n")
    assert find(static) is None
    (static / changed).write_text(before)
    assert find(static) is not None, "it is the content that counts, and no time"
    (static / "js" / "new.js").write_text("export {};\n")
    assert find(static) is None


@pytest.mark.field
@pytest.mark.parametrize("what", ["absent", "torn", "foreign", "lost", "without its font"])
def test_a_damaged_folder_is_no_folder(static: Path, what: str) -> None:
    listed = static / "built" / "built.json"
    match what:
        case "absent":
            listed.unlink()
        case "torn":
            listed.write_text(listed.read_text()[:40])
        case "foreign":
            listed.write_text('["built"]')
        case "lost":
            next((static / "built").glob("main-*.js")).unlink()
        case "without its font":
            next((static / "built").glob("*.woff2")).unlink()
    assert find(static) is None


def test_what_cannot_be_joined_is_said_with_the_reason(static: Path) -> None:
    (static / "js" / "later.js").write_text("import './nowhere.js';\n")
    with pytest.raises(SystemExit, match=r"nowhere\.js"):
        join(TOOLS, static)
    assert find(static) is None


@pytest.mark.parametrize("page", ["/", "/fleet"])
async def test_the_page_begins_with_few_files_that_may_be_kept_for_ever(page: str) -> None:
    async with serving(Config()) as base, http_client(base_url=base) as client:
        served = await client.get(page)
        assert "script-src 'self' 'sha256-" in served.headers["content-security-policy"]
        text = served.text
        named = re.findall(r'(?:src|href)="(/static/built/[^"]+)"', text)
        assert 2 <= len(named) <= 20
        assert "/static/fonts/" not in text
        style = (await client.get(re.findall(r'rel="stylesheet" href="([^"]+)"', text)[0])).text
        fonts = {f"/static/built/{name}" for name in re.findall(r'url\("\./([^"]+\.woff2)"\)', style)}
        assert fonts == set(re.findall(r'rel="preload" href="([^"]+)"', text)), "each is loaded once"
        for path in named:
            answer = await client.get(path, headers={"Accept-Encoding": "gzip"})
            assert answer.status_code == 200
            assert answer.headers["cache-control"] == "public, max-age=31536000, immutable"
            assert not (path in fonts and answer.headers.keys() & {"etag", "last-modified"}), "without a use"


def test_without_joined_files_all_are_named_and_none_may_be_kept_unasked() -> None:
    parts = parts_of(None, lambda name: f"/static/{name}?v=1")
    assert parts["script"] == "/static/js/main.js?v=1"
    assert parts["styles"] == [f"/static/css/{name}.css?v=1" for name in STYLES]
    assert parts["needed"] == []
    tokens = (static_dir() / "css" / "tokens.css").read_text()
    assert parts["fonts"] == [f"/static/{font}" for font in re.findall(r'url\("\.\./([^"]+)"\)', tokens)]
