"""A finding about a log: what is odd, the likely cause, and what to set."""

from dataclasses import dataclass
from typing import Literal

__all__ = ["Finding"]


@dataclass(frozen=True, slots=True)
class Finding:
    """level: an ``error`` makes a run pointless, a ``warning`` makes it doubtful. code: short and stable, for programs.
    text: one plain sentence with the likely cause. hint: what to set or type, empty where nothing can be done."""

    level: Literal["info", "warning", "error"]
    code: str
    text: str
    hint: str
