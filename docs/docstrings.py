"""Docstrings of the package as Markdown, for mkdocstrings: doctests become code, described names a list."""

from __future__ import annotations

import re
from typing import Any

import griffe

_NAMES = re.compile(r"([\w*]+(?:, [\w*]+)*): ")


def as_markdown(text: str) -> str:
    """A docstring in which runs of ``>>>`` lines are code, and paragraphs of names are lists."""
    return "\n\n".join(map(_paragraph, re.split(r"\n\s*\n", text)))


def _paragraph(text: str) -> str:
    if text.startswith(">>>"):
        return f"```pycon\n{text}\n```"
    if _NAMES.match(text):
        return re.sub(rf"(?:^|\n){_NAMES.pattern}", r"\n- `\1`: ", text).strip()
    return text


class Docstrings(griffe.Extension):
    """Turns each docstring into Markdown when it is loaded."""

    def on_instance(self, *, obj: Any, **_: Any) -> None:
        if obj.docstring:
            obj.docstring.value = as_markdown(obj.docstring.value)
