"""The ``biotac`` command: one module per verb, fixed exit codes. Only this package prints."""

from __future__ import annotations

from .main import main

__all__ = ["main"]
