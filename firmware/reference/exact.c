#include "exact.h"

#include "fixed_point.h"

// N_x in um times 1000 is the dividend of x in nm.
_Static_assert(BT_SUM_SQUARES_R_MAX_Q8_UM <= INT64_MAX / 1000, "the x dividend must fit int64");
_Static_assert(BT_SUM_SQUARES_MAX_Q8 <= INT64_MAX, "the weight sum must fit int64");
// Every electrode has z < 0, so with a positive weight sum (y, z) cannot be 0: the direction below is never
// 0/0 (SPEC.md, Degenerate input).
_Static_assert(BT_ELECTRODE_Z_MAX_UM < 0, "electrodes must have z < 0");

uint32_t exact_isqrt64(uint64_t n)
{
    uint64_t root = 0;
    for (uint64_t bit = (uint64_t)1 << 62; bit != 0; bit >>= 2) {
        if (n >= root + bit) {
            n -= root + bit;
            root = (root >> 1) + bit;
        } else {
            root >>= 1;
        }
    }
    return (uint32_t)root;
}

static int64_t weight(int64_t e, int weights)
{
    switch (weights) {
    case BT_POC_WEIGHTS_ABS_N2:
        return e * e;
    case BT_POC_WEIGHTS_COMPRESS_N2:
        return e < 0 ? e * e : 0;
    default:
        return e < 0 ? -e : 0;
    }
}

// Scale v[first..2] to length BT_CORE_RADIUS_UM, in nm. The components are cut to at most 30 bits first:
// their squares then sum to less than 2^62 for the square root, and the bits cut off are below 2^-28 of the
// result.
static void scale_to_radius(const int64_t v[3], int first, int32_t out_nm[3])
{
    uint64_t largest = 0;
    for (int d = first; d < 3; d++) {
        largest |= bt_abs(v[d]);
    }
    int shift = 0;
    while (largest >> shift >= (uint64_t)1 << 30) {
        shift++;
    }
    int lift = 0;
    while (shift == 0 && largest << lift < (uint64_t)1 << 29) {
        lift++;
    }
    int64_t scaled[3] = {0, 0, 0};
    uint64_t squares = 0;
    for (int d = first; d < 3; d++) {
        uint64_t magnitude = bt_abs(v[d]) >> shift << lift;
        scaled[d] = v[d] < 0 ? -(int64_t)magnitude : (int64_t)magnitude;
        squares += magnitude * magnitude;
    }
    int64_t length = (int64_t)exact_isqrt64(squares);
    for (int d = first; d < 3; d++) {
        out_nm[d] = (int32_t)bt_div_round(scaled[d] * (BT_CORE_RADIUS_UM * 1000), length);
    }
}

bool exact_poc(const int32_t e_q4[BT_ELECTRODES], int weights, int32_t poc_nm[3])
{
    int64_t sum = 0;               // W of Eq 1
    int64_t moment[3] = {0, 0, 0}; // N of Eq 1, um
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int64_t w = weight(e_q4[i], weights);
        sum += w;
        for (int d = 0; d < 3; d++) {
            moment[d] += w * bt_electrode_um[i][d];
        }
    }
    if (sum == 0) {
        return false;
    }
    if (moment[0] > 0) { // tip: a point on the sphere; its direction needs no division by W
        scale_to_radius(moment, 0, poc_nm);
    } else { // cylinder: x stays, (y, z) move out to the radius, which the paper's Eq 2 omits
        scale_to_radius(moment, 1, poc_nm);
        poc_nm[0] = (int32_t)bt_div_round(moment[0] * 1000, sum);
    }
    return true;
}

#define UN_DIVISOR    (16 * 1000 * 1000LL) // 1/16 count * 1/1000 * nN -> uN
#define MNMM_DIVISOR  (16 * 1000000000LL)  // 1/16 count * um * nN -> mN*mm
#define LEVER_DIVISOR (1000000000LL)       // nm * uN -> mN*mm
#define POC_MAX_NM    (BT_ELECTRODE_MAX_UM * 1000LL)
#define FORCE_MAX_UN  (BT_SUM_NORMAL_MAX_Q4_MILLI * BT_SETTING_FORCE_GAIN_X_NN_MAX / UN_DIVISOR + 1)

_Static_assert(BT_SUM_NORMAL_MAX_Q4_MILLI <= INT32_MAX, "a force sum must fit int32");
_Static_assert(BT_SUM_NORMAL_MAX_Q4_MILLI <= INT64_MAX / BT_SETTING_FORCE_GAIN_X_NN_MAX,
               "a scaled force sum must fit int64");
_Static_assert(BT_SUM_ARM_MAX_Q4_NM / 1000 < INT64_MAX / BT_SETTING_FORCE_GAIN_X_NN_MAX,
               "a scaled torque sum must fit int64");
_Static_assert(FORCE_MAX_UN <= INT64_MAX / 2 / POC_MAX_NM, "the lever product must fit int64");

void exact_force_un(const int32_t e_q4[BT_ELECTRODES], const int32_t gain_nn[3], int64_t force_un[3])
{
    for (int d = 0; d < 3; d++) {
        int32_t sum = 0;
        for (int i = 0; i < BT_ELECTRODES; i++) {
            sum += e_q4[i] * bt_normal_milli[i][d];
        }
        force_un[d] = bt_div_round((int64_t)sum * gain_nn[d], UN_DIVISOR);
    }
}

void exact_torque_yz_mnmm(const int32_t e_q4[BT_ELECTRODES], const int32_t gain_nn[2], int64_t torque_mnmm[2])
{
    for (int d = 0; d < 2; d++) {
        int64_t sum_nm = 0;
        for (int i = 0; i < BT_ELECTRODES; i++) {
            sum_nm += (int64_t)e_q4[i] * bt_arm_nm[i][d + 1];
        }
        // The sum is exact in nm; um is still a thousandth of the published unit for any gain.
        int64_t sum_um = bt_div_round(sum_nm, 1000);
        torque_mnmm[d] = bt_div_round(sum_um * gain_nn[d], MNMM_DIVISOR);
    }
}

int64_t exact_torque_x_mnmm(const int32_t poc_nm[3], const int64_t force_un[3])
{
    return bt_div_round(poc_nm[1] * force_un[2] - poc_nm[2] * force_un[1], LEVER_DIVISOR);
}
