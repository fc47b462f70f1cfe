"""The pages and a drive's report before the checkers of HTML, and the page before Lighthouse."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.chromium import FLAGS
from tests.http import http_client
from tests.peers.conftest import DRIVE, Tally
from tests.peers.environment import NODE_MODULES
from tests.peers.programs import output_of

NODE = shutil.which("node") or "node"
PAGES = {
    "page": "/",
    "fleet": "/fleet",
    "offline": "/offline",
    "docs": "/docs",
    "report": f"/api/recordings/{DRIVE}/report",
}
JUDGED = ("accessibility", "best-practices")  # speed is measured by make bench, on a machine with nothing beside


async def saved(base: str, folder: Path) -> list[Path]:
    """The pages as files, as they are served."""
    async with http_client(base_url=base, timeout=120) as client:
        for name, path in PAGES.items():
            answer = await client.get(path, headers={"accept": "text/html"}, follow_redirects=True)
            assert answer.status_code == 200, (path, answer.text[:300])
            assert answer.headers["content-type"].startswith("text/html"), path
            (folder / f"{name}.html").write_bytes(answer.content)
    return [folder / f"{name}.html" for name in PAGES]


@pytest.mark.peers("vnu")
@pytest.mark.timeout(400)
async def test_the_nu_html_checker(base: str, tally: Tally, tmp_path: Path) -> None:
    files = await saved(base, tmp_path)
    vnu = NODE_MODULES / "vnu-jar" / "build" / "dist" / "vnu.jar"
    command = ("java", "-jar", vnu, "--format", "json", "--exit-zero-always", "--stdout", *files)
    code, printed = await output_of(*command, within_s=300)
    assert code == 0, printed[-2000:]
    tally.tried(len(files))
    for one in json.loads(printed.splitlines()[-1])["messages"]:
        page = Path(one["url"]).stem
        text = f"{one['type']} {page}:{one.get('lastLine')}: {one['message']} | {one.get('extract', '')}"
        tally.found(text, page, is_advice=one["type"] == "info")
    assert tally.unexplained == []


@pytest.mark.peers("html-validate")
@pytest.mark.timeout(300)
async def test_html_validate(base: str, tally: Tally, tmp_path: Path) -> None:
    files = await saved(base, tmp_path)
    (tmp_path / ".htmlvalidate.json").write_text(json.dumps({"root": True, "extends": ["html-validate:standard"]}))
    program = NODE_MODULES / "html-validate" / "bin" / "html-validate.mjs"
    _, printed = await output_of(NODE, program, "--formatter", "json", *files, within_s=200)
    tally.tried(len(files))
    for one in json.loads(printed.splitlines()[-1]):
        for message in one["messages"]:
            page = Path(one["filePath"]).stem
            text = f"{message['ruleId']} {page}:{message['line']}: {message['message']} | {message.get('selector')}"
            tally.found(text, page)
    assert tally.unexplained == []


@pytest.mark.peers("lighthouse")
@pytest.mark.timeout(400)
async def test_lighthouse(
    base: str, tally: Tally, tmp_path: Path, chromium: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CHROME_PATH", chromium)
    out = tmp_path / "lighthouse.json"
    program = NODE_MODULES / "lighthouse" / "cli" / "index.js"
    options = ("--output", "json", "--output-path", out, "--quiet", f"--only-categories={','.join(JUDGED)}")
    flags = f"--chrome-flags={' '.join(FLAGS)}"
    code, printed = await output_of(NODE, program, base, *options, flags, within_s=300)
    assert code == 0, printed[-2000:]
    found = json.loads(out.read_text())
    for name, audit in judged(found):
        tally.tried()
        if audit["score"] < 1:
            tally.found(f"{name}: {audit['title']} {json.dumps(audit.get('details', {}).get('items'))[:600]}")
    assert tally.unexplained == []
    assert tally.run > 20


def judged(found: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """The audits that count for the two figures."""
    for category in JUDGED:
        for one in found["categories"][category]["auditRefs"]:
            audit = found["audits"][one["id"]]
            if one["weight"] and audit["score"] is not None:
                yield one["id"], audit
