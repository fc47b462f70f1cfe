"""What every request passes: errors, headers, limits."""
