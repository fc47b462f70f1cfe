"""The plain HTTP page with instructions for trusting this server. It serves our authority's certificate only.

An attacker on the network can change this page. It therefore has no secret, links only to itself, and instructs the
user to compare the fingerprint with the one on the server's terminal. An iPhone, an iPad and a Mac take the authority
as a configuration profile.

The page tests by a request whether HTTPS works. It has another origin, which the server's routes refuse. So the
answer is outside the application: it has no data of the car. A browser that does not trust the certificate gets none.
"""

from __future__ import annotations

import ipaddress
import plistlib
import uuid
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from io import BytesIO

import segno
from jinja2 import Environment, FileSystemLoader, select_autoescape
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp, Receive, Scope, Send

from server.system.page_files import static_dir, templates_dir
from server.tls.authority import Authority
from server.tls.steps import PLATFORMS, Platform, platform_of

MEDIA_TYPE = "application/x-apple-aspen-config"
_OUR_PROFILES = uuid.UUID("5a1d3c5e-60a5-4f0c-9a44-4a0f9fb1f7a5")  # under it the ids of all our profiles are made

PROBE_PATH = "/trusted"
_PROBE_HEADERS = [(b"cross-origin-resource-policy", b"cross-origin"), (b"cache-control", b"no-store")]

CERTIFICATE = "application/x-x509-ca-cert"
FONTS = ("catgraph-numerals-500.woff2", "catgraph-numerals-700.woff2")


def mobileconfig(authority: Authority) -> bytes:
    """Our authority as a configuration profile.

    The profile, unsigned, because the signer would not be trusted yet. An authority always has the same ids, so that
    a second installation replaces the first.
    """
    id = authority.fingerprint.replace(":", "").lower()
    root = {
        "PayloadType": "com.apple.security.root",
        "PayloadVersion": 1,
        "PayloadIdentifier": f"catgraph.{id[:16]}.authority",
        "PayloadUUID": str(uuid.uuid5(_OUR_PROFILES, f"{id} authority")).upper(),
        "PayloadDisplayName": authority.name,
        "PayloadDescription": "Lets this device trust the page of one catgraph server. Private addresses only.",
        "PayloadCertificateFileName": "catgraph-ca.crt",
        "PayloadContent": authority.der,
    }
    profile = {
        "PayloadType": "Configuration",
        "PayloadVersion": 1,
        "PayloadIdentifier": f"catgraph.{id[:16]}",
        "PayloadUUID": str(uuid.uuid5(_OUR_PROFILES, f"{id} profile")).upper(),
        "PayloadDisplayName": authority.name,
        "PayloadDescription": "Then switch it on in Settings, General, About, Certificate Trust Settings.",
        "PayloadRemovalDisallowed": False,
        "PayloadContent": [root],
    }
    return plistlib.dumps(profile)


class Probe:
    """Answers the instruction page that HTTPS works.

    Around the whole application.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http" and scope["path"] == PROBE_PATH and scope["method"] in ("GET", "HEAD"):
            await send({"type": "http.response.start", "status": 204, "headers": _PROBE_HEADERS})
            await send({"type": "http.response.body"})
            return
        await self._app(scope, receive, send)


@dataclass(frozen=True, slots=True, kw_only=True)
class SetupAddresses:
    """Where a server is found: hosts as people type them, IPv6 without brackets, the likeliest first."""

    hosts: tuple[str, ...]
    port: int  # of the page, HTTPS
    setup_port: int  # of this one

    def secure(self, host: str | None = None) -> str:
        """The page's address at `host`, if it is ours, else at the likeliest."""
        return f"https://{self._host(host)}:{self.port}/"

    def setup(self, host: str | None = None) -> str:
        return f"http://{self._host(host)}:{self.setup_port}/"

    def _host(self, host: str | None) -> str:
        found = host if host in self.hosts else self.hosts[0]
        return f"[{found}]" if ":" in found else found


def explaining(
    authority: Authority, where: Callable[[], SetupAddresses], typed: Callable[[str | None], None] = lambda host: None
) -> ASGIApp:
    """The application with the instructions for `authority`; `typed` is called with the host name of each request."""
    static = static_dir()
    templates = Environment(
        loader=FileSystemLoader(templates_dir()), autoescape=select_autoescape(), trim_blocks=True, lstrip_blocks=True
    )
    page = templates.get_template("setup.html")
    # Read once: the page must come while the disk is busy recording, and it never changes while the server runs.
    style = b"\n".join((static / "css" / name).read_bytes() for name in ("tokens.css", "setup.css"))
    script = (static / "js" / "boot" / "setup.js").read_bytes()
    fonts = {name: (static / "fonts" / name).read_bytes() for name in FONTS}
    profile = mobileconfig(authority)

    def explain(request: Request) -> Response:
        host = _host_of(request)
        typed(host)
        found = where()
        address = found.setup(host)
        drawn = page.render(
            name=authority.name,
            fingerprint=_in_lines(authority.fingerprint),
            secure=found.secure(host),
            setup=address,
            qr=_size(address),
            platforms=_likeliest_first(platform_of(request.headers.get("user-agent", ""))),
            ends=authority.cert.not_valid_after_utc,
        )
        headers = _headers(found.secure(host).rstrip("/"))
        return Response(drawn, media_type="text/html; charset=utf-8", headers=headers)

    def qr(request: Request) -> Response:
        out = BytesIO()
        address = where().setup(_host_of(request))
        segno.make(address, error="m").save(out, kind="svg", border=4, dark="#000", light="#fff", xmldecl=False)
        return Response(out.getvalue(), media_type="image/svg+xml", headers=_headers())

    def file(body: bytes, media_type: str, name: str = "") -> Callable[[Request], Response]:
        headers = _headers()
        if name:
            headers["Content-Disposition"] = f'inline; filename="{name}"'  # "attachment" would keep a phone from asking
        return lambda _: Response(body, media_type=media_type, headers=headers)

    routes = [
        Route("/", explain),
        Route("/ca.crt", file(authority.pem, CERTIFICATE, "catgraph-ca.crt")),
        Route("/ca.mobileconfig", file(profile, MEDIA_TYPE, "catgraph.mobileconfig")),
        Route("/qr.svg", qr),
        Route("/setup.css", file(style, "text/css; charset=utf-8")),
        Route("/setup.js", file(script, "text/javascript; charset=utf-8")),
        *(Route(f"/fonts/{name}", file(body, "font/woff2")) for name, body in fonts.items()),
    ]
    return _only(routes, lambda _: "/")


def leading(where: Callable[[], SetupAddresses]) -> ASGIApp:
    """The application for a certificate that browsers trust already: it leads to the page."""
    return _only([], lambda request: where().secure(_host_of(request)))


def _only(routes: Sequence[Route], to: Callable[[Request], str]) -> ASGIApp:
    async def elsewhere(request: Request) -> Response:
        return RedirectResponse(to(request), 303, headers=_headers())

    every = ["GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"]
    app = Starlette(routes=[*routes, Route("/{path:path}", elsewhere, methods=every)])
    app.router.redirect_slashes = False
    return app


def _host_of(request: Request) -> str | None:
    """What was typed to come here, without port and brackets. Used only if it is one of our own."""
    try:
        host = request.url.hostname
    except ValueError:
        return None
    try:
        return str(ipaddress.ip_address(host or ""))
    except ValueError:
        return host


def _headers(secure: str = "") -> dict[str, str]:
    # A policy cannot contain an IPv6 address, so any https is allowed; the page requests one address only.
    allowed = "https:" if "[" in secure else secure or "'none'"
    policy = (
        "default-src 'none'; style-src 'self'; script-src 'self'; font-src 'self'; img-src 'self' data:; "
        f"connect-src {allowed}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'; "
        "require-trusted-types-for 'script'; trusted-types 'none'"
    )
    return {
        "Content-Security-Policy": policy,
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "no-referrer",
        "Cache-Control": "no-store",
    }


def _likeliest_first(id: str) -> list[Platform]:
    return sorted(PLATFORMS, key=lambda platform: platform.id != id)


def _in_lines(fingerprint: str) -> list[str]:
    """Four lines of eight pairs, to be compared line by line."""
    pairs = fingerprint.split(":")
    return [" ".join(pairs[i : i + 8]) for i in range(0, len(pairs), 8)]


def _size(text: str) -> int:
    """How many modules a QR code has to a side, its quiet zone included."""
    return int(segno.make(text, error="m").symbol_size(border=4)[0])
