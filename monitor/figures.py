"""Numbers as the operator reads them: a value that passed its limit never reads the same as the limit."""

from __future__ import annotations

FINEST = 3  # digits after the point; what is nearer to its limit than that is at it
APART = 2.0  # numbers that are further apart never read the same


def beside(value: float, limit: float, digits: int = 1) -> str:
    """Format `value` with the given decimals, or with as many as distinguish it from `limit`: 4.97 beside 5.0."""
    if 0.0 < abs(value - limit) < APART:
        for finer in range(digits, FINEST + 1):
            text = f"{value:.{finer}f}"
            if float(text) != round(limit, finer):
                return text
    return f"{value:.{digits}f}"
