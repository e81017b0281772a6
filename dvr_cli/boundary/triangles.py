"""Facets of a boundary as triangles."""

from __future__ import annotations

import numpy as np


def triangulated(facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Facets ((F, w), short rows end in -1) as triangles (T, 3), and the facet (T,) each is of; in order."""
    if facets.shape[1] < 4:
        return facets, np.arange(len(facets))
    second = np.flatnonzero(facets[:, 3] >= 0)
    triangles = np.concatenate([facets[:, :3], facets[second][:, [0, 2, 3]]])
    facet = np.concatenate([np.arange(len(facets)), second])
    order = np.argsort(facet, kind="stable")
    return triangles[order], facet[order]
