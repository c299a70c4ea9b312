"""Which of ten materials is rubbed: python textures.py slides.npz, recordings of dexrob/BioTac_slide_20_50.

The counts are absolute values of tared ones, so that a vibration of f looks like one of 2 f: these bands are not those
of a board, and the classifier holds for these files alone. Each slide is used, for training or test, as a whole.
"""

import sys

import numpy as np
from sklearn.model_selection import StratifiedKFold, cross_val_predict

from biotac_lab.learn import texture

SLIDING_M_S = 0.002

if len(sys.argv) != 2:
    sys.exit("expected one file: python textures.py slides.npz")
slides = np.load(sys.argv[1])
pac, materials = [], []
for trial in sorted(name.removesuffix("frame") for name in slides if name.endswith("frame")):
    speed_m_s = np.linalg.norm(slides[trial + "cv"][:, :3], axis=1)
    slips = np.interp(slides[trial + "t"], slides[trial + "cv_t"], speed_m_s) > SLIDING_M_S
    pac.append(slides[trial + "frame"][slips, 3:25].ravel())
    materials.append(trial.split("_")[0])
folds = StratifiedKFold(5, shuffle=True, random_state=0)
for samples in (220, 1100, 2200, None):
    rows = texture.describe_all(trial_pac[:samples] for trial_pac in pac)
    found = cross_val_predict(texture.classifier(), rows, materials, cv=folds)
    scope = "whole slides" if samples is None else f"the first {samples / 2200:g} s"
    print(f"{scope}: {np.mean(found == np.array(materials)):.0%} of {len(pac)} slides recognised")
