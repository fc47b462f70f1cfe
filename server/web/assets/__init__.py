"""The page's own files: joined, drawn, cached."""
