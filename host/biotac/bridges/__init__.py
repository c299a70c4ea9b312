"""Streams handed on to other live systems."""
