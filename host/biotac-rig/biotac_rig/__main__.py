"""python -m biotac_rig"""

import sys

from .cli import main

sys.exit(main())
