"""One file a check, or a family of checks; `catalog` finds them here and nothing else lists them."""
