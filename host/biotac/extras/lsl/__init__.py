"""Streams on the Lab Streaming Layer. Needs the extra ``lsl``."""

from __future__ import annotations

from .outlet import Outlet

__all__ = ["Outlet"]
