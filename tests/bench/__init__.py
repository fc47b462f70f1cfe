"""Latency, bytes and load of catgraph, beside a bare client on the bridge and beside one bridge connection a viewer.

`make bench` runs all of it in under five minutes, `python -m tests.bench --quick` a rough one in under 20 s.
"""
