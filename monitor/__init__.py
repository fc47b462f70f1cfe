"""The judge: what is known of a vehicle, what is wrong with it, and what the operator is told.

Pure Python, numpy and pydantic: no clock, no input or output, no logging; time is an argument everywhere. The way round
is `State.receive` → `State.snapshot` → `Monitor.step` → transitions; `Monitor.standing`, `.findings` and `.tiles` are
what to show.
"""
