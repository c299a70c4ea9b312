"""The ``biotac`` command: one module per verb, fixed exit codes. Only this package prints."""
