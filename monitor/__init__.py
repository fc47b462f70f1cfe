"""State, checks and alarms of a vehicle.

Pure Python, numpy and pydantic: no clock, no input or output, no logging; time is always an argument. The data flow is
`State.receive` → `State.snapshot` → `Monitor.step` → transitions; `Monitor.standing`, `.findings` and `.tiles` are for
display.
"""
