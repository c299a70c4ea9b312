"""A finger's wrench from counts: models fitted to a force plate, and their held-out errors.

- ``sources``: a ``run`` from an .npz, or a board's recording ``joined`` with a reference's, both recorded by ``guided``
- ``crossvalidation``: chooses among the ``models`` and measures; ``figures``, ``report``: the results
- ``upload``: the map on a board; ``contact``: the point of contact from the force plate alone

Not to be confused with ``biotac.keep``, which stores the gains that boards use.
"""

from __future__ import annotations

from .contact import MESH_STEP_MM, locate, locate_on_mesh, moment
from .crossvalidation import Validation, validate
from .figures import angles_deg, rmse
from .lag import Lags
from .moments import DRIFT_NODES
from .plate_recording import Run, load_run, numbers, run_of
from .sources import load
from .splits import Blocks

__all__ = [
    "DRIFT_NODES", "MESH_STEP_MM", "Blocks", "Lags", "Run", "Validation", "angles_deg", "load", "load_run", "locate",
    "locate_on_mesh", "moment", "numbers", "rmse", "run_of", "validate",
]  # fmt: skip
