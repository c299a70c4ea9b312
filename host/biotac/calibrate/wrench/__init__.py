"""A finger's wrench from its counts: models fitted to a force plate, and their held-out errors.

- ``run``: reads a recording with its truth and refuses unusable ones
- ``joined``: joins a board's recording with a reference's; ``sources``: gets a run from either kind of file
- ``guided``: records both on a board; ``coverage``: what of the finger they cover
- ``blocks``: cuts a run so that nothing leaks from test to training
- ``features``, ``models``: the columns and the linear models of them; ``template``: another model, for comparison
- ``lag``: how far counts lag the force; ``moments``: the sums that fits need
- ``crossvalidation``: chooses and measures; ``figures``, ``report``: the results
- ``fitted``, ``provenance``: the map and its file; ``board``, ``upload``: the map on a board
- ``contact``: the point of contact from the force plate alone

Not to be confused with ``biotac.keep``, which stores the gains and maps that boards use.
"""

from __future__ import annotations

from .contact import MESH_STEP_MM, locate, locate_on_mesh, moment
from .crossvalidation import Validation, validate
from .figures import rmse
from .lag import Lags
from .moments import DRIFT_NODES
from .run import Run, load_run
from .sources import load
from .splits import Blocks

__all__ = [
    "DRIFT_NODES", "MESH_STEP_MM", "Blocks", "Lags", "Run", "Validation", "load", "load_run", "locate",
    "locate_on_mesh", "moment", "rmse", "validate",
]  # fmt: skip
