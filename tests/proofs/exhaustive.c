// bt_isqrt32 for every one of its 2^32 arguments. Nightly: takes a minute or two.
// The root is followed instead of computed: it grows by one where n reaches the next square.
#include "isqrt.h"

#include <stdio.h>

int main(void)
{
    uint64_t root = 0;
    for (uint64_t n = 0; n <= UINT32_MAX; n++) {
        root += (root + 1) * (root + 1) <= n;
        if (bt_isqrt32((uint32_t)n) != root) {
            printf("bt_isqrt32(%llu) is %u, not %llu\n", (unsigned long long)n, bt_isqrt32((uint32_t)n),
                   (unsigned long long)root);
            return 1;
        }
    }
    // 65535^2 is the largest square below 2^32: had the root stopped early, nothing above was checked.
    printf("bt_isqrt32 is exact for all 2^32 arguments, up to a root of %llu\n", (unsigned long long)root);
    return root == 65535 ? 0 : 1;
}
