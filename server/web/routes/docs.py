"""The description of the JSON interface as a page of our own: FastAPI's loads its scripts from the internet."""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from fastapi.templating import Jinja2Templates

from server.system.page_files import templates_dir

router = APIRouter()


@router.get("/docs", response_class=HTMLResponse, include_in_schema=False)
async def docs(request: Request) -> HTMLResponse:
    schema = request.app.openapi()
    context = {
        "info": schema["info"],
        "paths": schema["paths"],
        "schemas": schema.get("components", {}).get("schemas", {}),
    }
    return Jinja2Templates(directory=templates_dir()).TemplateResponse(request, "docs.html", context)
