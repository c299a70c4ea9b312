"""The compiled firmware core, checked to have the same schema as this package. Raises ImportError otherwise."""

from __future__ import annotations

from pathlib import Path

from .messages_gen import SCHEMA_HASH

try:
    from .._core import __file__ as _core_file
    from .._core import ffi as ffi
    from .._core import lib as lib
except ImportError as error:  # an editable tree without a build, or a wheel for another platform
    raise ImportError(f"the compiled core cannot be loaded ({error}); install the package: pip install .") from error

if lib.bt_binding_schema_hash() != SCHEMA_HASH:
    raise ImportError(
        f"the compiled core was built for schema {lib.bt_binding_schema_hash():08x}, this Python code for "
        f"{SCHEMA_HASH:08x}; reinstall the package: pip install ."
    )

#: Files that were built with the core are beside it, and in an editable install apart from the sources.
BUILT = Path(_core_file).parent
