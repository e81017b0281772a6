"""The data of a legacy VTK file: arrays on points and cells (POINT_DATA, CELL_DATA) and field data."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import prod
from urllib.parse import unquote_to_bytes

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.numbers_in_text import shown
from dvr_cli.files.vtk.scan import Scanner

# Shape of the value of each attribute at one point or cell, where it is always the same.
_ATTRIBUTES: dict[str, tuple[int, ...]] = {
    "scalars": (),
    "color_scalars": (),
    "lookup_table": (),
    "vectors": (3,),
    "normals": (3,),
    "texture_coordinates": (),
    "tensors": (3, 3),
    "tensors6": (6,),
    "global_ids": (),
    "pedigree_ids": (),
    "edge_flags": (),
}
_STRINGS = ("string", "utf8_string", "variant")


def read_data(
    scanner: Scanner, n_points: int, n_cells: int
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], str | None]:
    """All numeric arrays up to the end of the file: those on points, those on cells, by name.

    An array has n_points or n_cells rows. Strings and lookup tables are passed over, as are fields of another
    length: ``Scanner.passed`` has them. Reading stops in front
    of what cannot be read; the third value says what that was (None if all was read).
    """
    point_data: dict[str, np.ndarray] = {}
    cell_data: dict[str, np.ndarray] = {}
    target, n = point_data, 0
    try:
        while keyword := scanner.peek():
            scanner.word(keyword)
            if keyword in ("point_data", "cell_data"):
                on_points = keyword == "point_data"
                target, right = (point_data, n_points) if on_points else (cell_data, n_cells)
                n = scanner.count(f"the length of {keyword.upper()}")
                if n != right:
                    raise InputError(f"{keyword.upper()} is for {n}, but there are {right}")
            elif keyword == "field":
                for name, array in read_field(scanner):
                    if len(array) == n:
                        target[name] = array
                    else:
                        scanner.passed.append(("array of another length", name))
            else:
                target.update(_read_attribute(scanner, keyword, n))
    except InputError as error:
        return point_data, cell_data, str(error)
    return point_data, cell_data, None


def read_field(scanner: Scanner) -> Iterator[tuple[str, np.ndarray]]:
    """Names and values ((rows,) or (rows, components)) of the numeric arrays of a FIELD.

    Its keyword has just been read.
    """
    scanner.word("the name of a FIELD")
    for _ in range(scanner.count("the number of arrays of a FIELD")):
        if scanner.peek() == "null_array":
            scanner.word("NULL_ARRAY")
            continue
        name = _name(scanner)
        what = f"array {shown(name)}"
        components = scanner.count(f"the number of components of {what}")
        rows = scanner.count(f"the number of rows of {what}")
        shape = () if components == 1 else (components,)
        yield from _read_array(scanner, name, scanner.type_name(what), rows, shape)


def _read_attribute(scanner: Scanner, keyword: str, n: int) -> Iterable[tuple[str, np.ndarray]]:
    """The one attribute on n points or cells, or nothing if it is a lookup table or strings."""
    if keyword not in _ATTRIBUTES:
        raise InputError(f"{shown(keyword)} is not an attribute that VTK knows")
    name = _name(scanner)
    what = f"{keyword.upper()} {shown(name)}"
    if keyword == "lookup_table":
        scanner.extent(_color(scanner), 4 * scanner.count(f"the size of {what}"), what)
        scanner.passed.append(("lookup table", name))
        return ()
    if keyword == "color_scalars":
        components = scanner.count(f"the number of components of {what}")
        return _read_array(scanner, name, _color(scanner), n, (components,))
    if keyword == "scalars":
        type_name = scanner.type_name(what)
        components = 1
        if scanner.peek() != "lookup_table":
            components = scanner.count(f"the number of components of {what}")
        if scanner.word("LOOKUP_TABLE").lower() != b"lookup_table":
            raise InputError(f"{what} has no LOOKUP_TABLE")
        scanner.word("the name of a lookup table")
        return _read_array(scanner, name, type_name, n, () if components == 1 else (components,))
    shape = _ATTRIBUTES[keyword]
    if keyword == "texture_coordinates":
        shape = (scanner.count(f"the dimension of {what}"),)
    return _read_array(scanner, name, scanner.type_name(what), n, shape)


def _read_array(
    scanner: Scanner, name: str, type_name: str, n: int, shape: tuple[int, ...]
) -> Iterable[tuple[str, np.ndarray]]:
    """One array of n values of ``shape``; nothing if its values are no numbers."""
    count = n * prod(shape)
    what = f"array {shown(name)}"
    values = None
    if type_name in _STRINGS:
        scanner.skip_strings(count, what, in_lines=type_name == "variant" or not scanner.binary)
        scanner.passed.append(("string array", name))
    else:
        values = scanner.values(type_name, count, what)
    scanner.skip_metadata(shape[0] if shape else 1)
    return [(name, values.reshape(n, *shape))] if values is not None and count else []


def _name(scanner: Scanner) -> str:
    """The name of an array: VTK writes blanks and the like as %20."""
    return unquote_to_bytes(scanner.word("a name")).decode("utf-8", "replace")


def _color(scanner: Scanner) -> str:
    """The type in which colours are stored."""
    return "unsigned_char" if scanner.binary else "float"
