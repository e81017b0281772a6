"""Regions: the tags by which a file tells materials, volumes or surfaces apart.

Vertices on an interface between regions are not interior: moving them would change the regions' shape.
"""

from __future__ import annotations

import numpy as np

from dvr_cli.mesh.mesh import Mesh

# Cell data that name regions, compared without case, "_" and ":".
REGION_NAMES = frozenset(
    {
        "dvrregion",
        "exodusblock",
        "medfamily",
        "cgnszone",
        "cgnsfamily",
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


def region_names(mesh: Mesh) -> list[str]:
    """The cell data of ``mesh`` that are taken for region tags: known names with whole numbers in them."""
    return [
        name
        for name, blocks in mesh.cell_data.items()
        if name.lower().replace("_", "").replace(":", "") in REGION_NAMES
        and all(np.asarray(block).ndim == 1 and _whole(np.asarray(block)) for block in blocks)
    ]


def regions_of(mesh: Mesh, blocks: list[int]) -> np.ndarray:
    """(n,) a number for each cell of the given blocks, equal where all region tags are equal."""
    n = sum(len(mesh.cells[b].vertices) for b in blocks)
    region = np.zeros(n, dtype=np.int64)
    for name in region_names(mesh) if blocks else ():
        tags = np.concatenate([np.asarray(mesh.cell_data[name][b]) for b in blocks])
        values, index = np.unique(tags, return_inverse=True)
        if len(values) > 1:
            _, region = np.unique(region * len(values) + index, return_inverse=True)
    return region


def _whole(values: np.ndarray) -> bool:
    return values.dtype.kind in "iub" or (
        values.dtype.kind == "f" and bool(np.all(np.isfinite(values) & (values == np.rint(values))))
    )
