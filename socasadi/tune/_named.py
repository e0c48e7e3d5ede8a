"""Choosing a part by its name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

Part = TypeVar("Part")


def choose(what: str, known: Mapping[str, Part], name: str) -> Part:
    """Return `known[name]`, or raise ValueError with the list of known names."""
    try:
        return known[name]
    except (KeyError, TypeError):
        raise ValueError(f"unknown {what} {name!r}; known are {', '.join(map(repr, known))}") from None
