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
    bool, the vertices of the cells that stay for the sake of layers. tensors: (n, k, k) of a metric, in which
    all cells have the ideal shape as target, None without one.
    """

    kept: np.ndarray | None
    held: np.ndarray
    tensors: np.ndarray | None = None

    def on(self, domain: Domain) -> tuple[Domain, float]:
        """The domain of the cells, at the coordinates of the input, with its corners measured against these.

        And the largest aspect that a metric asks these for, 1 without one.

        It may have more vertices, behind the others and of no cell. Raises InputError as ``metric_on``.
        """
        more = len(domain.points) - len(self.held)
        if self.tensors is not None:
            from dvr_cli.quality.metric import metric_on

            metric = metric_on(domain, np.pad(self.tensors, ((0, more), (0, 0), (0, 0))))
            return replace(domain, corners=metric.corners), metric.max_aspect
        if self.kept is None:
            return domain, 1.0
        held = np.pad(self.held, (0, more))
        targets = Targets(self.kept, held, 1.0)
        return replace(domain, corners=with_targets(domain.points, domain.corners, targets)), 1.0

    def around(self, store: Store, local: Local, cells: CellRows, near: Local) -> ShareTargets:
        """The same of other cells, ``near``; these being of the rank's own, ``local``. All ranks have to ask.

        cells: theirs, by number.
        """
        kept = None if self.kept is None else of_cells(store, self.kept, cells)

        def known(values: np.ndarray) -> np.ndarray:
            return store.of_others(near.number, store.rows_of(local, values))[0]

        return ShareTargets(kept, known(self.held), None if self.tensors is None else known(self.tensors))
