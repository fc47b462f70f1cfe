"""Replay in the page: a recording is decoded and judged like the live car, once per viewer."""
