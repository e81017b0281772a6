"""STL as text: solids with a name each, their facets in lines whatever their indents and case.

solid NAME
  facet normal nx ny nz
    outer loop
      vertex x y z        (three times)
    endloop
  endfacet
endsolid NAME
"""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.numbers_in_text import Rows, is_blank, shown, write_replaced

_WORDS = (b"solid", b"facet", b"outer", b"vertex", b"endloop", b"endfacet", b"endsolid")
_SOLID, _FACET, _OUTER, _VERTEX, _END_LOOP, _END_FACET, _END_SOLID = range(len(_WORDS))
_ONE_FACET = [_FACET, _OUTER, _VERTEX, _VERTEX, _VERTEX, _END_LOOP, _END_FACET]
_LONGEST = max(map(len, _WORDS))


class TextStl:
    """A text file: corners (F, 3, 3) and normals (F, 3) of its facets, and their solids.

    solid: (F,) the number of the solid each facet is in; names: of the solids. tags: attributes, none here.
    single: whether its coordinates are float32.
    """

    single = False
    tags: np.ndarray | None = None

    def __init__(self, data: bytes) -> None:
        """Raises InputError for what is damaged."""
        self._data = data
        text = np.frombuffer(data + b"\n", dtype=np.uint8)
        starts, ends, kinds = _lines(text, data)
        solids, bounds = np.flatnonzero(kinds == _SOLID), np.flatnonzero(kinds == _END_SOLID)
        inner = (kinds != _SOLID) & (kinds != _END_SOLID)
        in_front = np.cumsum(inner) - inner  # lines of facets in front of each line
        if len(solids) != len(bounds) or (solids > bounds).any() or (solids[1:] < bounds[:-1]).any():
            raise InputError("not every solid has its endsolid: the file is truncated or damaged")
        body = np.flatnonzero(inner)
        outside = np.searchsorted(solids, body, side="right") == np.searchsorted(bounds, body, side="right")
        whole = len(_ONE_FACET)
        at = np.concatenate([in_front[solids], in_front[bounds]])
        if len(body) % whole == 0:
            right = (kinds[body].reshape(-1, whole) == _ONE_FACET).all(axis=1)
        if len(body) % whole or not right.all() or (at % whole).any() or outside.any():
            raise InputError("not every facet is a loop of three vertices: the file is damaged")
        vertex, normal = body[kinds[body] == _VERTEX], body[kinds[body] == _FACET]
        rows = Rows(text, starts[vertex], ends[vertex])
        if (rows.counts != 4).any():
            self._refuse(starts[vertex[np.argmax(rows.counts != 4)]], "a vertex has three coordinates")
        rows.blank_out(rows.starts[rows.first], rows.ends[rows.first])
        try:
            values = rows.numbers(3 * len(vertex), np.float64)
        except ValueError:
            raise InputError("a coordinate of a vertex is no number") from None
        self.corners = values.reshape(-1, 3, 3)
        self._vertices = rows.source_spans(np.arange(len(vertex)), np.arange(1, 4))
        rows = Rows(text, starts[normal], ends[normal])
        if (rows.counts != 5).any():
            self._refuse(starts[normal[np.argmax(rows.counts != 5)]], "a normal has three components")
        rows.blank_out(rows.starts[rows.first], rows.ends[rows.first + 1])
        try:
            self.normals = rows.numbers(3 * len(normal), np.float64).reshape(-1, 3)
        except ValueError:  # some programs write -nan(ind) and the like for facets without area
            self.normals = np.full((len(normal), 3), np.nan)
        self._normals = rows.source_spans(np.arange(len(normal)), np.arange(2, 5))
        self.names = [self._name(starts[line], ends[line]) for line in solids]
        self.solid = np.searchsorted(solids, normal, side="right") - 1

    def write(
        self, corners: np.ndarray, moved: np.ndarray, normals: np.ndarray, turned: np.ndarray, file: BinaryIO
    ) -> None:
        """Write the file with other numbers: those ``moved`` of ``corners``, those ``turned`` of ``normals``.

        moved: (F, 3, 3) bool, turned: (F, 3) bool.
        """
        spans = [
            np.concatenate([n[turned], v.reshape(moved.shape)[moved]])
            for n, v in zip(self._normals, self._vertices, strict=True)
        ]
        order = np.argsort(spans[0])
        values = np.concatenate([normals[turned], corners[moved]])
        write_replaced(file, self._data, spans[0][order], spans[1][order], values[order])

    def _name(self, start: int, end: int) -> str:
        line = self._data[start:end].strip()
        return line[len(_WORDS[_SOLID]) :].strip().decode("utf-8", "replace")

    def _refuse(self, at: int, why: str) -> None:
        line = self._data.count(b"\n", 0, int(at)) + 1
        words = self._data[int(at) : int(at) + 200].split(b"\n")[0]
        raise InputError(f"line {line}: {why}, but it reads {shown(words.strip())}")


def _lines(text: np.ndarray, data: bytes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Starts and ends of the lines that are not empty, and the number of the word each begins with."""
    line_ends = np.flatnonzero((text == ord("\n")) | (text == ord("\r")))
    solid = np.flatnonzero(~is_blank(text))
    lines = np.searchsorted(line_ends, solid)
    first = np.diff(lines, prepend=-1) > 0
    begin, end = solid[first], line_ends[lines[first]] + 1
    padded = np.concatenate([text, np.full(_LONGEST + 1, ord("\n"), dtype=np.uint8)])
    kinds = np.full(len(begin), -1)
    for kind, word in enumerate(_WORDS):
        same = is_blank(padded[begin + len(word)])
        for i, character in enumerate(word):
            same &= (padded[begin + i] | 32) == character
        kinds[same] = kind
    unknown = kinds < 0
    if unknown.any():
        at = int(begin[np.argmax(unknown)])
        word = data[at : at + 80].split()[0]
        raise InputError(
            f"line {data.count(bytes([10]), 0, at) + 1} begins with {shown(word)}: not an STL file"
        )
    return begin, end, kinds
