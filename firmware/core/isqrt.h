// Integer square root, exact for every n: the largest r with r * r <= n. No rounding.
#ifndef BIOTAC_ISQRT_H
#define BIOTAC_ISQRT_H

#include <stdint.h>

uint32_t bt_isqrt32(uint32_t n);

#endif
