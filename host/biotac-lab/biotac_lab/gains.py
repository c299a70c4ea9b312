"""Force and torque gains fitted to emulated fingers, as a calibration would give.

Lin Eq 3 and 4: F_d = S_d sum e n_d, M_d = T_d sum e (r x n)_d, with e = count - rest. Each gain is a least-squares fit
without offset from noise-free counts to the scenario's truth, axis by axis. This is the best that these five numbers
can do on the scenario, so residuals show the error of the method and not a lack of calibration. M_x has no gain: the
electrodes hardly see it: only E8 and E9 have any arm about x.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from biotac import Setting
from biotac.core import geometry as surface
from biotac.wire import messages

Floats = npt.NDArray[np.float64]

_ARMS_MM: Floats = np.asarray(np.cross(surface.ELECTRODE_MM, surface.ELECTRODE_NORMAL), dtype=np.float64)
_SETTINGS = (
    Setting.FORCE_GAIN_X_NN, Setting.FORCE_GAIN_Y_NN, Setting.FORCE_GAIN_Z_NN, Setting.TORQUE_GAIN_Y_NN,
    Setting.TORQUE_GAIN_Z_NN,
)  # fmt: skip
_WEIGHTS = (*surface.ELECTRODE_NORMAL.T, *_ARMS_MM.T[1:])  # of each


def fit_gains(signal: Floats, force_n: Floats, torque_nmm: Floats) -> dict[str, int]:
    """Settings by name, in nN/count, from e (n, 19), forces (n, 3) and torques (n, 3).

    An axis without truth (below 1 uN or 1 uN mm throughout) or without signal is omitted, and stays at the default.
    Values are held within the setting's range.
    """
    gains: dict[str, int] = {}
    for setting, weights, truth in zip(_SETTINGS, _WEIGHTS, (*force_n.T, *torque_nmm.T[1:]), strict=True):
        total = signal @ weights
        energy = float(total @ total)
        if np.abs(truth).max(initial=0.0) < 1e-6 or energy == 0.0:
            continue
        nano_per_count = 1e9 * float(total @ truth) / energy
        spec = messages.SETTINGS[setting]
        gains[setting.name.lower()] = round(min(max(nano_per_count, spec.low), spec.high))
    return gains
