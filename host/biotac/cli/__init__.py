"""The ``biotac`` command: one module per verb, fixed exit codes, the only place that prints."""

from __future__ import annotations

from .main import main

__all__ = ["main"]
