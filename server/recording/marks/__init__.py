"""Marks of recordings: in their own file, and beside it what came after it was complete."""
