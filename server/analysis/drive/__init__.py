"""The drive's report: what its page, its tables and its mail show."""
