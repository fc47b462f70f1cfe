"""Recordings in the forms that others read: ROS 1 bag, tables, tracks, a page; and the minute around an alarm."""

from __future__ import annotations
