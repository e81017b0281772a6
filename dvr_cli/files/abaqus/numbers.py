"""Coordinates as decks have them."""

from dvr_cli.files.numbers_in_text import fitted

_WIDTH = 20  # characters that Abaqus and CalculiX read of a number


def text_of(value: float) -> bytes:
    """The shortest text that reads back exactly in 20 characters, or else that of the nearest number."""
    text = repr(value)
    return text.encode() if len(text) <= _WIDTH and "." in text else fitted(value, _WIDTH)
