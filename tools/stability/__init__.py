"""Courses of loads for the tare machine, and the verdicts on them; used by tools/stress and tests/stability."""
