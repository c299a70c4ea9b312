// Force and torque of any signals and gains, and the rounding of any number: no signed step leaves the type,
// and no sum the core's asserted bound.
#include "solve/wrench.c"

#include <__fc_builtin.h>

#define TORQUE_MAX                                                                                           \
    (BT_SUM_ARM_MAX_Q4_NM / BT_SUMS_TORQUE_UNIT_NM + 2 + BT_ELECTRODES * (long long)BT_E_MAX_Q4)

static int32_t e_q4[BT_ELECTRODES];

static int32_t within(int32_t limit)
{
    return Frama_C_interval(-limit, limit);
}

void main(void)
{
    int32_t force[3], torque[2];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e_q4[i] = within(BT_E_MAX_Q4);
    }
    bt_sums_force(e_q4, force);
    bt_sums_torque(e_q4, torque);
    for (int d = 0; d < 3; d++) {
        //@ check -BT_SUM_NORMAL_MAX_Q4_MILLI <= force[d] <= BT_SUM_NORMAL_MAX_Q4_MILLI;
    }
    for (int d = 0; d < 2; d++) {
        //@ check -TORQUE_MAX <= torque[d] <= TORQUE_MAX;
    }

    (void)multiplier(within(BT_GAIN_MAX_NN), FORCE_BITS, FORCE_DIVISOR);
    (void)multiplier(within(BT_GAIN_MAX_NN), TORQUE_BITS, TORQUE_DIVISOR);
    (void)bt_shift_round(Frama_C_long_long_interval(-(1LL << 62) + 1, (1LL << 62) - 1),
                         Frama_C_interval(1, 62));
}
