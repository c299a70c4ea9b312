// Adapters of firmware/reference: the double from the paper and the int64 gold kernel.
#include "variants.h"

#include "gold.h"

bool variant_double(const int32_t e_q4[BT_ELECTRODES], const variant_settings *settings, unsigned wanted,
                    variant_output *out)
{
    (void)wanted; // the formulas come in one piece
    double e[BT_ELECTRODES];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e[i] = e_q4[i] / 16.0;
    }
    lin2013(e, &settings->real64, &out->real64);
    return out->real64.poc_mm[0] == out->real64.poc_mm[0]; // not NaN
}

bool variant_gold(const int32_t e_q4[BT_ELECTRODES], const variant_settings *settings, unsigned wanted,
                  variant_output *out)
{
    gold_output *gold = &out->gold;
    bool has_poc = true;
    if (wanted & (VARIANT_FORCE | VARIANT_TORQUE)) {
        gold_force_un(e_q4, settings->force_nn, gold->force_un);
    }
    if (wanted & VARIANT_TORQUE) {
        gold_torque_yz_mnmm(e_q4, settings->torque_nn, gold->torque_mnmm + 1);
    }
    if (wanted & (VARIANT_POC | VARIANT_TORQUE)) {
        has_poc = gold_poc(e_q4, settings->poc_weights, gold->poc_nm);
    }
    if (has_poc && (wanted & VARIANT_TORQUE)) {
        gold->torque_mnmm[0] = gold_torque_x_mnmm(gold->poc_nm, gold->force_un);
    }
    return has_poc;
}
