"""Old names of public classes and functions: each works for one version, with a warning that names the new one."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Mapping
from typing import Any


def old_names(module: str, new_by_old: Mapping[str, str]) -> Callable[[str], Any]:
    """A ``__getattr__`` for the ``module`` that had the old names."""

    def getattribute(name: str) -> Any:
        if name not in new_by_old:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        new = new_by_old[name]
        text = f"{module}.{name} is now {module}.{new}; the old name goes with the next version"
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return getattr(sys.modules[module], new)

    return getattribute
