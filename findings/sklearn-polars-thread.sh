#!/usr/bin/env bash
# A fit of scikit-learn raises AttributeError while another thread imports Polars, which statsmodels does where it is
# installed: scikit-learn takes polars from sys.modules, where it lies before it is complete, and asks it for DataFrame.
# Afterwards the same fit works. A finder that waits stands here for a slow disk.
# Seen with scikit-learn 1.9.1 and Polars 2.1.0 on Python 3.11; fails where that has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check scikit-learn==1.9.1 polars==2.1.0
"$folder/venv/bin/python" - <<'END'
import sys
import threading

import numpy as np
import sklearn
from sklearn.decomposition import PCA

begun, may_go_on = threading.Event(), threading.Event()


class Slow:
    def find_spec(self, name, path=None, target=None):
        if name.startswith("polars."):
            begun.set()
            may_go_on.wait()


sys.meta_path.insert(0, Slow())
importing = threading.Thread(target=__import__, args=("polars",))
importing.start()
begun.wait()
rows = np.random.default_rng(1).normal(size=(30, 4))
try:
    PCA(svd_solver="full").fit(rows)
except AttributeError as error:
    print(f"scikit-learn {sklearn.__version__}, while polars is imported: AttributeError: {error}")
else:
    raise SystemExit("it fits now")
finally:
    may_go_on.set()
    importing.join()
print(f"afterwards: {PCA(svd_solver='full').fit(rows).n_components_} components")
END
