"""Runs every check over a recording, faster than real time and with the same code as live."""
