"""What was proved, with its figures, for whoever ran the proofs; and which proofs wait for the night."""

from __future__ import annotations

import os
from collections.abc import Callable

import pytest

Report = Callable[[str], None]

nightly = pytest.mark.skipif(not os.environ.get("BIOTAC_NIGHTLY"), reason="takes long: tools/prove runs it")
