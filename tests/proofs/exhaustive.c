// bt_root_inverse for every one of the table's 3 * 2^30 arguments, and fixed_point.h's helpers of one
// number. usage: exhaustive [all]
//
// Only the bits of q from BT_ROOT_STEP_BITS - 16 on matter to the root, and the true value falls with q: the
// first and the last q of each run with the same bits are the extremes, so nothing is left out (a third of a
// second). "all" asks for every q all the same (20 s), and for all 2^32 numbers; else for every 251st.
//
// The true value comes from the double's square root, which is good to 2^-53: nothing beside the 2^-17
// that is measured. Errors are split as root.h splits them: one unit, and a part of the result itself.
#include "fixed_point.h"
#include "solve/rsqrt.h"
#include "wire/sensor_gen.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>

#define CHORD 5.8e-6 // 2^-17.4, as kernel_bounds.h has it

static double worst, least, most;

static int check(uint64_t q)
{
    uint32_t got = bt_root_inverse((uint32_t)q);
    double want = BT_CORE_RADIUS_UM / (2.0 * BT_ROOT_UM_FACTOR) * 4294967296.0 / sqrt((double)q);
    double off = got - want;
    worst = fmax(worst, (fabs(off) - 1) / want);
    least = fmin(least, off / want);
    most = fmax(most, off / want);
    if (fabs(off) > 1 + want * CHORD) {
        printf("bt_root_inverse(%llu) is %u, %.3f from the exact %.3f\n", (unsigned long long)q, got, off,
               want);
        return 1;
    }
    return 0;
}

static int check_helpers(uint32_t bits)
{
    int32_t value = (int32_t)bits;
    uint32_t magnitude = value < 0 ? ~bits + 1 : bits;
    int length = bt_bit_length(bits);
    bool good =
        bt_abs32(value) == magnitude && length <= 32 && (bits == 0 ? length == 0 : bits >> (length - 1) == 1);
    if (magnitude < 1u << 31) {
        good = good && bt_with_sign(magnitude, value) == value && bt_with_sign(magnitude, ~value) == -value;
    }
    if (!good) {
        printf("a helper of fixed_point.h is wrong for %08x\n", bits);
    }
    return !good;
}

int main(int argc, char **argv)
{
    (void)argv;
    uint64_t run = argc > 1 ? 1 : 1u << (BT_ROOT_STEP_BITS - 16);
    for (uint64_t q = 1u << 30; q <= UINT32_MAX; q += run) {
        if (check(q) || check(q + run - 1)) {
            return 1;
        }
    }
    for (uint64_t bits = 0; bits <= UINT32_MAX; bits += argc > 1 ? 1 : 251) {
        if (check_helpers((uint32_t)bits)) {
            return 1;
        }
    }
    printf("relative %.4e %.4e beyond_a_unit %.4e of %.1e\n", least, most, worst, CHORD);
    return 0;
}
