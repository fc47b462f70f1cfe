"""Every check over a recording, faster than it happened and by the same road as live."""
