"""Run by CMake: preprocessed declarations in, cffi's C source out."""

from __future__ import annotations

import sys
from pathlib import Path

from cffi import FFI


def main(declarations: str, output: str) -> None:
    ffi = FFI()
    ffi.cdef(Path(declarations).read_text(encoding="utf-8"))
    ffi.set_source("biotac._core", '#include "binding.h"')
    ffi.emit_c_code(output)


if __name__ == "__main__":
    main(*sys.argv[1:])
