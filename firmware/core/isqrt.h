// Integer square root: the largest r with r * r <= n, exact for every n. No rounding.
#ifndef BIOTAC_ISQRT_H
#define BIOTAC_ISQRT_H

#include <stdint.h>

uint32_t bt_isqrt64(uint64_t n);

#endif
