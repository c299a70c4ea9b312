"""The command ``biotac``, and ``python -m biotac``."""

import sys

from .cli import ending


def program() -> int:
    """Run the command line; return its exit code. A signal ends it from here on, with no traceback."""
    ending.by_leaving()
    from .cli.main import main

    code = ending.INTERRUPTED
    try:
        code = main()
        ending.by_itself()
    except KeyboardInterrupt:  # between two lines
        ending.by_itself()
    return code


if __name__ == "__main__":
    sys.exit(program())
