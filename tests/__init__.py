"""Tests of catgraph: they mirror the source."""
