"""Numbers in the fields of cards: as many digits as fit, and the number that is read back."""

from __future__ import annotations

import math
import re

from dvr_cli.files.numbers_in_text import fitted

_EXPONENT = re.compile(r"(?<=[\d.])[dDeE]?([+-])")


def field_text(value: float, width: int) -> str:
    """The text of at most ``width`` characters nearest to ``value``, with a decimal point and no blanks.

    The same as ``fitted`` gives, or as near; ordinary numbers go a quicker way.
    """
    size = abs(value)
    sign = 1 if math.copysign(1.0, value) < 0 else 0
    if 1e-3 <= size < 1e15:
        text = repr(value)
        if len(text) <= width:
            return text
        whole = math.floor(math.log10(size)) + 1 if size >= 1 else 0
        decimals = width - sign - 1 - whole
        if decimals > 0:
            text = f"{value:.{decimals}f}".rstrip("0")
            text = text.replace("0.", ".", 1) if size < 1 and not text.lstrip("-").startswith("1") else text
            if len(text) <= width:
                return text
    return fitted(value, width, "").decode()


def value_of(text: str) -> float:
    """The number that a field's text stands for: 1.5-3 is 0.0015."""
    try:
        return float(text)
    except ValueError:
        return float(_EXPONENT.sub(r"e\1", text))
