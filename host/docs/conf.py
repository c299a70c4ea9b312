"""Sphinx: the pages of this folder and the API reference. Built by tools/docs, warnings as errors."""

from __future__ import annotations

import enum
import re
from typing import Any

import numpy as np
from sphinx.pycode import ModuleAnalyzer

import biotac
from biotac.wire import messages_gen as wire

project = "Open BioTac gateway"
release = biotac.__version__
html_title = f"{project} {release}"

extensions = ["myst_parser", "sphinx.ext.autodoc"]
# The source folder is the repository, so that links between pages are those that GitHub follows too.
root_doc = "host/docs/index"
FOLDERS = ("host/docs", "host/docs/*", "host/biotac-lab/docs", "protocol", "protocol/*")
include_patterns = ["README.md", "CHANGELOG.md", "firmware/**/README.md", *(f"{folder}/*.md" for folder in FOLDERS)]
myst_heading_anchors = 3

html_theme = "furo"  # menu and search on a phone, and a dark theme
html_show_copyright = False
html_copy_source = False
html_static_path = ["style"]
html_css_files = ["page.css"]
html_js_files = ["page.js"]

autodoc_mock_imports = ["scipy", "sklearn", "statsmodels"]  # the extra `features`: pages are built without it
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True  # names of constants, not their values

#: A table beside a generated enum gives the values' meanings.
MEANINGS: dict[Any, dict[int, str]] = {
    wire.FrameFlags: wire.FRAME_FLAG_DOC,
    wire.QuantityFlags: wire.QUANTITY_FLAG_DOC,
    wire.PocWeights: wire.POC_WEIGHTS_DOC,
    wire.TareReason: wire.TARE_REASON_DOC,
    wire.Trust: wire.TRUST_DOC,
    wire.TareState: wire.TARE_STATE_DOC,
    wire.CalibrationState: wire.CALIBRATION_STATE_DOC,
    wire.Setting: {
        key: f"{spec.unit}, {spec.low} to {spec.high}, default {spec.default}: {spec.doc}"
        for key, spec in wire.SETTINGS.items()
    },
}
#: Ends of field names; the first that fits holds.
UNITS = {
    "_counts": "count",
    "celsius": "C",
    "_count2": "count^2",
    "_100un": "100 uN",
    "_mnmm": "mN*mm",
    "_nmm": "N*mm",
    "_mm": "mm",
    "_um": "um",
    "_us": "us",
    "_q4": "count/16",
    "_n": "N",
}
COUNTS = ("counts", "pdc", "tac", "tdc", "pac")


def explain(app: Any, kind: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Add to a docstring the tables of the code: an enum's values, an array's fields."""
    if isinstance(obj, type) and issubclass(obj, enum.IntEnum | enum.IntFlag) and obj.__module__ == wire.__name__:
        meanings = MEANINGS.get(obj, {})
        lines += [
            "",
            *table(("name", "value", "meaning"), [(f"``{m.name}``", int(m), meanings.get(int(m), "")) for m in obj]),
        ]
    if isinstance(obj, np.dtype):
        lines[:] = comment(name.rpartition(".")[2])  # in place of NumPy's text about all dtypes
        rows = []
        for field in obj.names or ():
            inner, shape = obj[field].subdtype or (obj[field], ())
            rows.append((f"``{field}``", inner.name, f"``{('n', *shape)}``".replace("'", ""), unit(field)))
        lines += ["", *table(("field", "type", "shape in an array (n,)", "unit"), rows)]
    # Docstrings are written to be read as they are: one pair of backticks, as in Markdown, is code too.
    lines[:] = [re.sub(r"(?<![`:\w])`([^`]+)`(?![`_])", r"``\1``", line) for line in lines]


def comment(name: str) -> list[str]:
    """The comment above a constant, in whichever module defines it."""
    for module in ("wire.frames", "core.compute", "core.finger", "features.paf", "features.thermal"):
        found = ModuleAnalyzer.for_module(f"biotac.{module}").find_attr_docs().get(("", name))
        if found:
            return list(found)
    raise LookupError(f"{name} has no comment that begins with #:")


def unit(field: str) -> str:
    """By the end of the field's name."""
    return "count" if field in COUNTS else next((u for end, u in UNITS.items() if field.endswith(end)), "1")


def table(head: tuple[str, ...], rows: list[tuple[Any, ...]]) -> list[str]:
    """An RST table."""
    out = [".. list-table::", "   :header-rows: 1", ""]
    for row in (head, *rows):
        for k, cell in enumerate(row):
            text = str(cell).replace("|", "\\|").replace("*", "\\*")
            out.append(f"   {'* -' if k == 0 else '  -'} {text}")
    return [*out, ""]


def setup(app: Any) -> None:
    """Called by Sphinx."""
    app.connect("autodoc-process-docstring", explain)
