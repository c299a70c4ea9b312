// The native side of `tools/bench/run --bits`.
#include "bits.h"

#include <stdio.h>

int main(void)
{
    if (bits_map_hash() == 0) {
        (void)fprintf(stderr, "the core refuses the map in maps.h, so no map results can be compared\n");
        return 1;
    }
    printf("%08x\n", (unsigned)bits_hash());
    return 0;
}
