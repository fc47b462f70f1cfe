"""The description of the JSON interface as a page of our own: FastAPI's loads its scripts from the internet."""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, JSONResponse
from fastapi.templating import Jinja2Templates

from server.system.page_files import templates_dir

router = APIRouter(include_in_schema=False)  # making the description takes half a second: in a thread, by `def`


@router.get("/openapi.json")
def described(request: Request) -> JSONResponse:
    return JSONResponse(request.app.openapi())


@router.get("/docs", response_class=HTMLResponse)
def docs(request: Request) -> HTMLResponse:
    schema = request.app.openapi()
    context = {
        "info": schema["info"],
        "paths": schema["paths"],
        "schemas": schema.get("components", {}).get("schemas", {}),
    }
    return Jinja2Templates(directory=templates_dir()).TemplateResponse(request, "docs.html", context)
