"""What few need, found by name: each folder here is an extra, as another distribution's would be (biotac.extra)."""
