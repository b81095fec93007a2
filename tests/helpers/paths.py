"""Where tests find what is not code."""

from pathlib import Path

__all__ = ["DATA", "ROOT"]

ROOT = Path(__file__).parents[2]
"""Of the checkout."""

DATA = ROOT / "tests" / "data"
"""Samples that are committed, each with its source and licence beside it."""
