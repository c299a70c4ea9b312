#include "wrench.h"

#include "fix.h"

#define UN_DIVISOR    (16 * 1000 * 1000LL) // 1/16 count * 1/1000 * nN -> uN
#define MNMM_DIVISOR  (16 * 1000000000LL)  // 1/16 count * um * nN -> mN*mm
#define LEVER_DIVISOR (1000000000LL)       // nm * uN -> mN*mm
#define POC_MAX_NM    (BT_ELECTRODE_MAX_UM * 1000LL)
#define FORCE_MAX_UN  (BT_SUM_NORMAL_MAX_Q4_MILLI * BT_GAIN_MAX_NN / UN_DIVISOR + 1)

_Static_assert(BT_SUM_NORMAL_MAX_Q4_MILLI <= INT32_MAX, "a force sum must fit int32");
_Static_assert(BT_SUM_NORMAL_MAX_Q4_MILLI <= INT64_MAX / BT_GAIN_MAX_NN, "a scaled force sum must fit int64");
_Static_assert(BT_SUM_ARM_MAX_Q4_NM / 1000 < INT64_MAX / BT_GAIN_MAX_NN,
               "a scaled torque sum must fit int64");
_Static_assert(FORCE_MAX_UN <= INT64_MAX / 2 / POC_MAX_NM, "the lever product must fit int64");

void bt_force_un(const int32_t e_q4[BT_ELECTRODES], const int32_t gain_nn[3], int64_t force_un[3])
{
    for (int d = 0; d < 3; d++) {
        int32_t sum = 0;
        for (int i = 0; i < BT_ELECTRODES; i++) {
            sum += e_q4[i] * bt_normal_milli[i][d];
        }
        force_un[d] = bt_div_round((int64_t)sum * gain_nn[d], UN_DIVISOR);
    }
}

void bt_torque_yz_mnmm(const int32_t e_q4[BT_ELECTRODES], const int32_t gain_nn[2], int64_t torque_mnmm[2])
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

int64_t bt_torque_x_derived_mnmm(const int32_t poc_nm[3], const int64_t force_un[3])
{
    return bt_div_round(poc_nm[1] * force_un[2] - poc_nm[2] * force_un[1], LEVER_DIVISOR);
}
