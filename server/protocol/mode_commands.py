"""Describing an intervention: what happened, by whom it was begun, of which kind it was."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from monitor.interventions import By
from server.protocol.command_base import Needs, OfCar
from server.protocol.doc import doc

MOST_LETTERS = 2000


class DescribeIntervention(OfCar):
    """Says what made somebody intervene; sent again it replaces what was said before."""

    needs: ClassVar[Needs] = "operator"
    http: ClassVar[str] = "Say what made somebody intervene"
    path: ClassVar[str] = "/api/interventions/{intervention}/describe"
    kind: Literal["describe_intervention"]
    intervention: Annotated[str, Field(pattern=r"^[A-Za-z0-9-]{1,40}$", description="its id, as the state names it")]
    what: Annotated[
        str, Field(max_length=MOST_LETTERS, description="in words; empty where the category says enough")
    ] = ""
    category: Annotated[str, Field(min_length=1, max_length=40)] | None = None
    initiated_by: Annotated[By | None, doc("where the data say otherwise; null: as they say")] = None
