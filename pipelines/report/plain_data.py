"""Figures as plain data that JSON can hold."""

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from navreplay.evaluation.metrics import Consistency, Statistics

__all__ = ["plain_data"]


def plain_data(value: object) -> Any:
    """Data classes and mappings as dictionaries, figures to nine digits, what is not finite as None."""
    if isinstance(value, Statistics | Consistency):
        return plain_data(asdict(value))
    if isinstance(value, Mapping):
        return {str(key): plain_data(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain_data(item) for item in value]
    if isinstance(value, float):
        return float(f"{value:.9g}") if math.isfinite(value) else None
    return value
