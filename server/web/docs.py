"""The description of the JSON interface as a page of our own: FastAPI's loads its scripts from the internet."""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from jinja2 import Environment

router = APIRouter()
_PAGE = Environment(autoescape=True).from_string("""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>catgraph: JSON interface</title></head><body>
<h1>{{ info.title }} {{ info.version }}</h1>
<p>{{ info.description }} The whole description: <a href="/openapi.json">openapi.json</a>. Errors are problem documents (RFC 9457).</p>
{% for path, methods in paths.items() %}{% for method, operation in methods.items() %}
<h2><code>{{ method | upper }} {{ path }}</code></h2>
<p>{{ operation.summary }}</p>
{% if operation.parameters %}<ul>{% for parameter in operation.parameters %}
<li><code>{{ parameter.name }}</code> ({{ parameter.in }}{% if parameter.required %}, required{% endif %}) {{ parameter.description or "" }}</li>
{% endfor %}</ul>{% endif %}
{% if operation.requestBody %}<p>Body: <code>{{ operation.requestBody.content["application/json"].schema["$ref"].split("/")[-1] }}</code>
{% set model = schemas[operation.requestBody.content["application/json"].schema["$ref"].split("/")[-1]] %}
with {% for name, field in model.properties.items() %}<code>{{ name }}</code> ({{ field.type }}) {{ field.description or "" }}{{ ", " if not loop.last }}{% endfor %}</p>{% endif %}
{% endfor %}{% endfor %}
<h2><code>WebSocket /ws</code></h2><p>What a page is told and may ask: docs/protocol.md of the project.</p>
</body></html>""")


@router.get("/docs", response_class=HTMLResponse, include_in_schema=False)
async def docs(request: Request) -> HTMLResponse:
    schema = request.app.openapi()
    models = schema.get("components", {}).get("schemas", {})
    return HTMLResponse(_PAGE.render(info=schema["info"], paths=schema["paths"], schemas=models))
