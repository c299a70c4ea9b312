// The boards' side of `tools/bench/run --bits`.
#include "bits.h"
#include "mark.h"

int main(void)
{
    bench_result(bits_hash());
    bench_end();
    return 0;
}
