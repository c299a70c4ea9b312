"""The command ``biotac``, and ``python -m biotac``."""

import sys
import warnings

from .cli import ending


def program() -> int:
    """Run the command line; return its exit code. A signal ends it from here on, with no traceback."""
    ending.by_leaving()
    from .cli.main import main
    from .cli.outputs import note

    # the library's warnings are for the user too, without a line of code in front
    warnings.showwarning = lambda message, *where, **more: note(str(message))

    code = ending.INTERRUPTED
    try:
        code = main()
        ending.by_itself()
    except KeyboardInterrupt:  # between two lines
        ending.by_itself()
    return code


if __name__ == "__main__":
    sys.exit(program())
