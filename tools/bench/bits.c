// The native side of `tools/bench/run --bits`.
#include "bits.h"

#include <stdio.h>

int main(void)
{
    printf("%08x\n", (unsigned)bits_hash());
    return 0;
}
