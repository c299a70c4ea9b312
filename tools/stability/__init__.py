"""Courses of loads for the tare machine, and their verdicts; used by tools/stress and tests/stability."""
