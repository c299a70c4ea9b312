"""Features for few users, found by name: each folder is an extra, as a separate package's would be (biotac.extra)."""
