"""The page and its files."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

from fastapi import FastAPI, Request
from fastapi.responses import HTMLResponse, Response
from fastapi.templating import Jinja2Templates
from starlette.exceptions import HTTPException
from starlette.responses import FileResponse

from server.web.api import running, vehicle_of
from server.web.assets import check_vendor, static_dir, templates_dir
from server.web.built import ENTRY, STYLES, Built, find
from server.web.static_files import StaticText, answer, packed


def parts_of(built: Built | None, asset: Callable[[str], str]) -> dict[str, object]:
    """The addresses of what the page begins with: few joined files, or all that there are."""
    if built is None:
        return {"styles": [asset(f"css/{name}.css") for name in STYLES], "script": asset(f"js/{ENTRY}"), "needed": []}
    style, script, *needed = (f"/static/{name}" for name in (built.style, built.script, *built.needed))
    return {"styles": [style], "script": script, "needed": needed}


def install(app: FastAPI) -> None:
    """Serves `/`, `/static/…` and the manifest. Raises AssetsMissing when the page's files are not there."""
    check_vendor()
    static = static_dir()
    templates = Jinja2Templates(directory=templates_dir())

    @lru_cache(maxsize=512)
    def digest(path: Path, changed_ns: int) -> str:
        return hashlib.sha256(path.read_bytes()).hexdigest()[:12]

    def asset(name: str) -> str:
        """The address of a static file, with the hash of its content so that no stale copy is ever used."""
        path = static / name
        return f"/static/{name}?v={digest(path, path.stat().st_mtime_ns)}"

    templates.env.globals["asset"] = asset
    app.mount("/static", StaticText(directory=static), name="static")

    @app.get("/", response_class=HTMLResponse, include_in_schema=False)
    async def page(request: Request, vehicle: str | None = None) -> Response:
        one, built = running(request), find(static)
        access = "open" if one.access.is_open else "paired"
        context = {"version": one.version, "vehicle": vehicle_of(one, vehicle), "access": access}
        body = page_of("page.html", request, built, worker=built is not None and one.config.worker, **context)
        return answer(packed(body), request.headers, _HTML, "no-cache")

    @app.get(OFFLINE, response_class=HTMLResponse, include_in_schema=False)
    async def offline(request: Request, v: str | None = None) -> Response:
        """What a phone shows while the server does not answer; `v` names the shell it is to belong to."""
        built = find(static)
        if v is not None and (built is None or shell(request, built).version != v):
            raise HTTPException(404, "The page has changed since.")
        return answer(packed(page_of("offline.html", request, built)), request.headers, _HTML, "no-cache")

    @app.get(WORKER, include_in_schema=False)
    async def worker(request: Request) -> Response:
        """The worker that keeps the shell; with single modules, or where there shall be none, the one that goes."""
        built = find(static)
        is_kept = built is not None and running(request).config.worker
        script = shell(request, built).worker(static) if built is not None and is_kept else withdrawn(static)
        sent = answer(packed(script.encode()), request.headers, "text/javascript; charset=utf-8", "no-cache")
        sent.headers["Service-Worker-Allowed"] = "/"
        return sent

    @app.get("/manifest.webmanifest", include_in_schema=False)
    async def manifest() -> FileResponse:
        path = static / "manifest.webmanifest"
        if not path.is_file():
            raise HTTPException(404, "There is no manifest.")
        return FileResponse(path, media_type="application/manifest+json")
