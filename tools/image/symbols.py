"""Names of functions that no board image may contain."""

from __future__ import annotations

import re

FLOAT_SYMBOL = re.compile(
    r"__aeabi_(c?[fd](add|sub|rsub|mul|div|neg|cmp\w*|2\w+|rcmp\w*)|u?[il]2[fd]|u?l2[fd]|h2f\w*|f2h\w*|d2h\w*)$"
    r"|__(add|sub|mul|div|neg|eq|ne|lt|le|gt|ge|cmp|unord)[sdt]f[23]$|__(fix|float|extend|trunc)\w*[sd]f\w*$|_dtoa_r$"
)
# A heap, or text formatting that pulls one in.
LIBRARY_SYMBOL = re.compile(
    r"_?(m|c|re)alloc(_r)?$|_?free(_r)?$|_?sbrk(_r)?$|_?v?(s|sn|f|as)?i?printf(_r)?$|_svfi?printf_r$|abort$|exit$"
)
