"""The page and its files."""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Callable
from functools import lru_cache, partial
from pathlib import Path

from fastapi import APIRouter, FastAPI, Request, WebSocket
from fastapi.responses import HTMLResponse, Response
from fastapi.templating import Jinja2Templates
from markupsafe import Markup
from starlette.exceptions import HTTPException
from starlette.responses import FileResponse

from server.access.identity import is_known, principal_of
from server.protocol import page_messages
from server.protocol.messages import Hello, Identity, RoleName
from server.system.page_files import check_vendor, static_dir, templates_dir
from server.web.assets.bundle import EARLY, ENTRY, FLEET_ENTRY, FLEET_STYLES, FONTS, STYLES, Built, find
from server.web.assets.icons import FOLDER as DRAWN
from server.web.assets.icons import WITHOUT, are_drawn
from server.web.assets.icons import manifest as manifest_of
from server.web.assets.service_worker import OFFLINE, WORKER, Shell, build_of, shell_of, withdrawn
from server.web.assets.static_files import StaticText, answer, packed
from server.web.middleware.headers import policy_of
from server.web.services import services
from server.web.tabs import TABS

log = logging.getLogger("catgraph.page")

_HTML = "text/html; charset=utf-8"
FLEET = "fleet.html"
_FONTS = [f"/static/{FONTS}/catgraph-numerals-{weight}.woff2" for weight in (500, 700)]  # as single styles name them


def parts_of(built: Built | None, asset: Callable[[str], str], *, is_fleet: bool = False) -> dict[str, object]:
    """What a page begins with: its tabs, and the addresses of few joined files, or of all that there are."""
    if built is None:
        styles = [asset(f"css/{name}.css") for name in (FLEET_STYLES if is_fleet else STYLES)]
        script = asset(f"js/{FLEET_ENTRY if is_fleet else ENTRY}")
        return {"tabs": TABS, "styles": styles, "script": script, "needed": [], "fonts": _FONTS}
    entry = built.fleet if is_fleet else built
    style, script, *needed = (f"/static/{name}" for name in (entry.style, entry.script, *entry.needed))
    fonts = [f"/static/{name}" for name in built.fonts]
    return {"tabs": TABS, "styles": [style], "script": script, "needed": needed, "fonts": fonts}


def early_of(built: Built | None, static: Path) -> str:
    """The inline script of a page; as a separate file it would block everything after it."""
    return built.early if built is not None else (static / "js" / EARLY).read_text(encoding="utf-8")


class PageFiles:
    """The page, its offline form and its worker, filled in from templates and the static folder.

    All of it reads files: it is for threads, and so none of the routes below is `async`.
    """

    def __init__(self, static: Path, templates: Jinja2Templates) -> None:
        self.static = static
        self._templates = templates
        self._templates.env.globals["asset"] = self.asset
        self._digest = lru_cache(maxsize=512)(_digest)

    def asset(self, name: str) -> str:
        """The address of a static file, with the hash of its content so that no stale copy is ever used."""
        path = self.static / name
        return f"/static/{name}?v={self._digest(path, path.stat().st_mtime_ns)}"

    def render(self, template: str, request: Request, built: Built | None, **context: object) -> bytes:
        """A template as HTML; `built` None: with single modules."""
        parts = parts_of(built, self.asset, is_fleet=template == FLEET)
        context |= parts | {"build": build_of(built), "icons": are_drawn(self.static)}
        context["early"] = Markup(early_of(built, self.static))
        return bytes(self._templates.TemplateResponse(request, template, context).body)

    def warm(self) -> None:
        """Compile all templates, for which the first page would wait a quarter of a second."""
        for name in self._templates.env.list_templates(extensions=["html"]):
            try:
                self._templates.env.get_template(name)
            except Exception:  # whatever is wrong with one shows where it is used
                log.exception("template_not_compiled name=%s", name)

    def response(self, body: bytes, request: Request, built: Built | None) -> Response:
        """HTML with the policy that allows its early script, and nothing else of that kind."""
        answered = answer(packed(body), request.headers, _HTML, "no-cache")
        answered.headers["Content-Security-Policy"] = policy_of(early_of(built, self.static))
        return answered

    def shell(self, request: Request, built: Built) -> Shell:
        """What a phone keeps of the page."""
        return shell_of(self.static, built, self.asset, self.render("offline.html", request, built))


def _digest(path: Path, changed_ns: int) -> str:
    """The hash of a file's content; `changed_ns` makes a changed file another one for the cache."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:12]


def install(app: FastAPI) -> PageFiles:
    """Serves `/`, `/static/…` and what installs the page on a phone.

    Raises AssetsMissing when the page's files are not there.
    """
    check_vendor()
    static = static_dir()
    files = PageFiles(static, Jinja2Templates(directory=templates_dir()))
    app.mount("/static", StaticText(directory=static), name="static")
    if not are_drawn(static):
        log.warning(WITHOUT)
    app.include_router(_page_routes(files))
    app.include_router(_install_routes(files))
    return files


def _page_routes(files: PageFiles) -> APIRouter:
    router, static = APIRouter(include_in_schema=False), files.static

    @router.get("/", response_class=HTMLResponse)
    def page(request: Request, vehicle: str | None = None) -> Response:
        one, built = services(request), find(static)
        one.build = build_of(built)
        access = "open" if one.access.is_open else "paired"
        names = list(one.vehicles) if is_known(request) else []
        if not one.may_be(vehicle) if vehicle is not None else not one.vehicles:
            body = files.render("no_car.html", request, built, name=(vehicle or "")[:40], vehicles=names)
            answered = files.response(body, request, built)
            answered.status_code = 404 if one.vehicles else 503
            return answered
        context = {"version": one.version, "vehicle": vehicle or one.vehicles[0], "access": access, "vehicles": names}
        worker = built is not None and one.keeps_shell
        parts = {"worker": worker, "at_agents": one.agents is not None, "has_store": one.stored is not None}
        body = files.render("page.html", request, built, **parts, **context)
        return files.response(body, request, built)

    @router.get("/fleet", response_class=HTMLResponse)
    def fleet(request: Request) -> Response:
        """All cars for one person. Its socket is admitted as that of one car is."""
        one, built = services(request), find(static)
        one.build = build_of(built)
        access = "open" if one.access.is_open else "paired"
        return files.response(files.render(FLEET, request, built, version=one.version, access=access), request, built)

    @router.get(OFFLINE, response_class=HTMLResponse)
    def offline(request: Request, v: str | None = None) -> Response:
        """What a phone shows while the server does not answer; `v` names the shell it is to belong to."""
        built = find(static)
        if v is not None and (built is None or files.shell(request, built).version != v):
            raise HTTPException(404, "The page has changed.")
        return files.response(files.render("offline.html", request, built), request, built)

    @router.get(WORKER)
    def worker(request: Request) -> Response:
        """The service worker; with single modules or `--no-worker`, a script that removes it."""
        built = find(static)
        services(request).build = build_of(built)
        is_kept = built is not None and services(request).keeps_shell
        script = files.shell(request, built).worker(static) if built is not None and is_kept else withdrawn(static)
        answered = answer(packed(script.encode()), request.headers, "text/javascript; charset=utf-8", "no-cache")
        answered.headers["Service-Worker-Allowed"] = "/"
        return answered

    return router


def _install_routes(files: PageFiles) -> APIRouter:
    """The web app manifest."""
    router, static = APIRouter(include_in_schema=False), files.static

    @router.get("/manifest.webmanifest")
    def manifest(request: Request) -> Response:
        body = json.dumps(manifest_of(files.asset, are_drawn=are_drawn(static)), indent=1).encode()
        return answer(packed(body), request.headers, "application/manifest+json", "no-cache")

    @router.get("/favicon.ico")
    @router.get("/apple-touch-icon.png")
    def requested_by_name(request: Request) -> FileResponse:
        """Icons that browsers request at fixed addresses."""
        name = "favicon.png" if request.url.path == "/favicon.ico" else "apple-touch-icon.png"
        path = static / DRAWN / name
        if not path.is_file():
            raise HTTPException(404, "This icon was not rendered when catgraph was installed.")
        return FileResponse(path, media_type="image/png", headers={"Cache-Control": "no-cache"})

    return router


socket = APIRouter()


@socket.websocket("/ws")
async def page_socket(
    socket: WebSocket,
    vehicle: str | None = None,
    replay: str | None = None,
    t: str | None = None,
    fleet: str | None = None,
) -> None:
    """The page's socket; docs/protocol.md. `replay`: the recording it begins with, `t` seconds after its beginning.
    `fleet` "1": of a page of all cars."""
    app = services(socket)
    principal = principal_of(socket)
    role: RoleName = "operator" if principal.is_operator else "viewer"
    name = vehicle if vehicle is not None else next(iter(app.vehicles), None)
    if fleet != "1" and (name is None or not app.may_be(name)):
        raise HTTPException(
            404, f"No vehicle is named {name[:40]}." if name is not None else "There is no vehicle yet."
        )
    with app.access.next_ticket(principal) as ticket:

        def hello(name: str) -> Hello:
            who: Identity = {"id": principal.id, "name": principal.name, "role": role}
            return {**app.hello(name), "who": who, "ticket": ticket}

        if fleet == "1" or name is None:
            await app.hub.serve_fleet(socket, partial(hello, ""), principal=principal)
        else:
            opening = page_messages.opening(replay, t)
            await app.hub.serve(socket, name, partial(hello, name), principal=principal, replay=opening)
