"""The coordinates in *NODE cards, where each stands, and where one that is missing would stand."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.abaqus.fields import Fields, node_ids, number
from dvr_cli.files.numbers_in_text import shown

_WIDE = 190  # a line of so many columns might pass the 256 that Abaqus reads, once its numbers are longer


class NodeRows(NamedTuple):
    """n lines of *NODE cards in one file.

    file: the number of the file in its deck.
    ids: (n,) node numbers. points: (n, 3), 0.0 for what is missing, as programs take it.
    starts, ends: (n, 3) where in the file each coordinate stands; both the same for one that is missing.
    absent: (n, 3) bool, the coordinates that a comma has to precede should they be written.
    """

    file: int
    ids: np.ndarray
    points: np.ndarray
    starts: np.ndarray
    ends: np.ndarray
    absent: np.ndarray


def read_nodes(fields: Fields, text: np.ndarray, file: int) -> NodeRows:
    """The nodes in some lines of the file ``text``; raises InputError for what is no node."""
    n = len(fields.counts)
    values = fields.floats()
    rows = NodeRows(
        file,
        np.empty(n, dtype=np.int64),
        np.zeros((n, 3)),
        np.repeat(fields.content_ends()[:, None], 3, axis=1),
        np.repeat(fields.content_ends()[:, None], 3, axis=1),
        np.ones((n, 3), dtype=bool),
    )
    heads = np.zeros(n)
    even = np.flatnonzero(~fields.odd)
    heads[even] = values[fields.first[even]]
    for j in range(3):
        there = even[fields.counts[even] > j + 1]
        token = fields.first[there] + j + 1
        rows.points[there, j] = values[token]
        rows.starts[there, j], rows.ends[there, j] = fields.starts[token], fields.ends[token]
        rows.absent[there, j] = False
        # behind a comma at the end of the line there is one field more, and it is empty
        rows.absent[even[(fields.counts[even] == j + 1) & fields.goes_on[even]], j] = False
    for line in np.flatnonzero(fields.odd).tolist():
        heads[line] = _read_odd(fields, line, rows)
    rows.ids[:] = node_ids(heads, fields)
    _use_blanks(text, rows)
    return rows


def _read_odd(fields: Fields, line: int, rows: NodeRows) -> float:
    """Take a line with empty fields into ``rows``; its node number."""
    parts = fields.split(line)
    values = []
    for word, _, _ in parts:
        try:
            values.append(number(word) if word else 0.0)
        except ValueError:
            raise InputError(f"{fields.place(line)}: {shown(word)} is no number") from None
    for j, (value, (_, begin, end)) in enumerate(zip(values[1:4], parts[1:4], strict=True)):
        rows.points[line, j], rows.starts[line, j], rows.ends[line, j] = value, begin, end
        rows.absent[line, j] = False
    return values[0]


def _use_blanks(text: np.ndarray, rows: NodeRows) -> None:
    """In lines so wide that longer numbers might not fit, let these take the place of blanks around them."""
    low = rows.starts.min(axis=1, initial=len(text))
    for i in np.flatnonzero(rows.ends.max(axis=1, initial=0) - low > _WIDE // 2).tolist():
        for j in range(3):
            begin, end = int(rows.starts[i, j]), int(rows.ends[i, j])
            while end > begin and text[begin - 1] == ord(" "):
                begin -= 1
            rows.starts[i, j] = begin
