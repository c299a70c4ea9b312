"""Tools that process and check a linked firmware image."""
