"""Verbs about boards: what is there, what ails it, what it keeps."""
