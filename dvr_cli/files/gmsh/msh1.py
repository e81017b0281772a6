"""Reading the sections of MSH 1, $NOD and $ELM, which are text."""

from __future__ import annotations

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.gmsh.cells import cell_type
from dvr_cli.files.gmsh.elements import Elements
from dvr_cli.files.gmsh.msh2 import DAMAGED, chain
from dvr_cli.files.gmsh.numbers import TextNumbers
from dvr_cli.files.gmsh.sections import Section


def read_elements(data: bytes, section: Section) -> list[Elements]:
    """Read $ELM: number, type, physical group, entity, number of nodes, nodes.

    An element in several physical groups occurs once for each of them; here they all come back.
    """
    numbers = TextNumbers(data, section, np.int64)
    (count,) = numbers.record("q")
    tables, end = chain(numbers.values[1:], count, [1, 4], _shape_of_line, section.name)
    if end + 1 != len(numbers.values):
        raise numbers.goes_on()
    return [
        Elements(int(table[0, 1]), table[:, 0], table[:, 5:], geometrical=table[:, 3], physical=table[:, 2:3])
        for table in tables
    ]


def _shape_of_line(key: list) -> tuple[int, int]:
    code, nodes = key
    if cell_type(code).nodes != nodes:
        raise InputError(f"section $ELM gives an element of type {code} {nodes} nodes")
    return (5 + nodes, 1) if nodes > 0 else DAMAGED
