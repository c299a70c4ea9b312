#include "isqrt.h"

// One result bit per step, from the top: no division, the same number of steps for every input.
uint32_t bt_isqrt32(uint32_t n)
{
    uint32_t root = 0;
    for (uint32_t bit = (uint32_t)1 << 30; bit != 0; bit >>= 2) {
        if (n >= root + bit) {
            n -= root + bit;
            root = (root >> 1) + bit;
        } else {
            root >>= 1;
        }
    }
    return root;
}
