"""The targets of a mesh that no rank has whole: from what the owners of cells and vertices know of them."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dvr_cli.distributed.orientation import of_cells
from dvr_cli.distributed.shares import CellRows, Local, Store
from dvr_cli.mesh.domain import Domain
from dvr_cli.quality.targets import Targets, with_targets


class ShareTargets(NamedTuple):
    """The origin of the targets of some cells.

    kept: (c,) bool, those whose target is their own shape, None if there are none in the whole. held: (n,)
    bool, the vertices of the cells that stay for the sake of layers.
    """

    kept: np.ndarray | None
    held: np.ndarray

    def on(self, domain: Domain) -> Domain:
        """The domain of the cells, at the coordinates of the input, with its corners measured against these.

        It may have more vertices, behind the others and of no cell.
        """
        if self.kept is None:
            return domain
        held = np.pad(self.held, (0, len(domain.points) - len(self.held)))
        targets = Targets(self.kept, held, 1.0)
        return replace(domain, corners=with_targets(domain.points, domain.corners, targets))

    def around(self, store: Store, local: Local, cells: CellRows, near: Local) -> ShareTargets:
        """The same of other cells, ``near``; these being of the rank's own, ``local``. All ranks have to ask.

        cells: theirs, by number.
        """
        kept = None if self.kept is None else of_cells(store, self.kept, cells)
        return ShareTargets(kept, store.of_others(near.number, store.rows_of(local, self.held))[0])
