"""Regions: the tags by which a file tells materials, volumes or surfaces apart.

Vertices on an interface between regions are not interior: moving them would change the regions' shape. Cell
data are tags if

- they have one of the names below, or are called "<format>:<noun>" as readers of formats call theirs, and are
  whole numbers, or
- they are integers of any other name with few distinct values beside the number of cells.

Numberings of cells, partitions and ranks of processes are none, whatever values they have.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from dvr_cli.mesh.mesh import Mesh
from dvr_cli.mesh.ranks import distinct, ranks

# Cell data that name regions, compared without case and without anything but letters and digits.
REGION_NAMES = frozenset(
    {
        "dvrregion",
        "exodusblock",
        "medfamily",
        "cgnszone",
        "gmshphysical",
        "gmshgeometrical",
        "meditref",
        "tetgenref",
        "objgroup",
        "stlsolid",
        "nastranproperty",
        "su2marker",
        "su2zone",
        "celltags",
        "cellentityids",
        "netgenindex",
        "avsucdmaterial",
        "unvproperty",
        "unvmaterial",
        "unvgroup",
        "materialindex",
        "abaqussection",
        "abaquselset",
        "abaquspart",
        "flac3dgroup",
        "ugridref",
        "region",
        "regions",
        "regionid",
        "regionids",
        "material",
        "materials",
        "materialid",
        "materialids",
        "matid",
        "subdomain",
        "subdomains",
    }
)
# compiled by the first run that has cell data
_OF_FORMAT = r"[a-z][a-z0-9-]*:(?!attr)[a-z]+[0-9]*"
_NUMBERING = (
    r"(vtk|exodus|gmsh|abaqus|nastran)*(global|local|original|pedigree|parent|cell|elem|element)+"
    r"(id|ids|index|indices|number|numbers|num|no)"
)
_PARTITION = (
    r".*(partition|ghost|processor|mpirank|metis).*"
    r"|(vtk|mpi)?(rank|proc|process|owner)s?(id|ids|number|no|index)?"
)
_COLOUR = r"(diffuse|ambient|specular)?(red|green|blue|alpha)"
_SAMPLE = 4096  # cells looked at before all are


def region_names(mesh: Mesh) -> list[str]:
    """The cell data of ``mesh`` that are taken for region tags, those of known names first."""
    known, others = [], []
    for name, blocks in mesh.cell_data.items():
        arrays = [np.asarray(block) for block in blocks]
        if any(array.ndim != 1 for array in arrays):
            continue
        whole = all(array.dtype.kind in "iub" for array in arrays)
        named = is_region_name(name) and all(_whole(array) for array in arrays)
        if named or (whole and _is_of_format(name)):
            known.append(name)
        elif whole and not is_no_region(name) and _has_few_values(arrays):
            others.append(name)
    return known + others


def names_of_regions(values: Mapping[str, int], cells: int) -> tuple[str, ...]:
    """As ``region_names``, of integers of so many distinct values each; cells: how many there are."""
    known = [name for name in values if is_region_name(name) or _is_of_format(name)]
    others = [name for name in values if name not in known and not is_no_region(name)]
    return (*known, *(name for name in others if 1 < values[name] <= min(most_values(cells), cells - 1)))


def most_values(cells: int) -> float:
    """The number of distinct values up to which integers of any name may be tags of so many cells."""
    return max(2.0, min(cells / 4, 4 * np.sqrt(cells)))


def is_region_name(name: str) -> bool:
    """True if cell data of this name are tags if they are whole numbers."""
    return _plain(name) in REGION_NAMES


def is_no_region(name: str) -> bool:
    """True if cell data or a set of this name number cells, colour them, or say which process has them."""
    plain = _plain(name)
    return any(re.fullmatch(pattern, plain) for pattern in (_NUMBERING, _PARTITION, _COLOUR))


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _is_of_format(name: str) -> bool:
    return re.fullmatch(_OF_FORMAT, name) is not None and not is_no_region(name)


def _whole(values: np.ndarray) -> bool:
    return values.dtype.kind in "iub" or (
        values.dtype.kind == "f" and bool(np.all(np.isfinite(values) & (values == np.rint(values))))
    )


def _has_few_values(arrays: list[np.ndarray]) -> bool:
    """True if tags, an array a block, have several values, but few beside the number of cells."""
    n = sum(map(len, arrays))
    most = most_values(n)
    sample = [array[: _SAMPLE // len(arrays) + 1] for array in arrays]
    if arrays and len(distinct(np.concatenate(sample))) > most:
        return False
    values = np.concatenate(arrays) if arrays else np.empty(0, dtype=np.int64)
    return 1 < ranks(values).max(initial=0) + 1 <= min(most, n - 1)
