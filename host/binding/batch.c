#include "batch.h"

#include "signal/signals.h"

void bt_kernel_frames(int64_t n, const uint16_t *counts, const uint16_t *tare_q4,
                      const int32_t *pdc_above_rest_q4, const bt_solve_settings *settings, int16_t *poc_um,
                      int32_t *force_100un, int32_t *torque_mnmm, int32_t *torsion_mnmm, uint32_t *flags)
{
    for (int64_t k = 0; k < n; k++) {
        int32_t e_q4[BT_ELECTRODES];
        bt_uncertainty uncertainty;
        bt_map_input frame = {counts + k * BT_ELECTRODES, tare_q4 + k * BT_ELECTRODES, pdc_above_rest_q4[k]};
        int16_t *poc = poc_um + 3 * k;
        int32_t *force = force_100un + 3 * k, *torque = torque_mnmm + 3 * k;
        bt_signals_q4(frame.counts, frame.tare_q4, e_q4);
        torsion_mnmm[k] = BT_INVALID_I32; // only a map gives it
        if (settings->map != NULL) {
            flags[k] = bt_solve_mapped(e_q4, &frame, settings, BT_WANT_ALL, poc, force, torque,
                                       torsion_mnmm + k, &uncertainty);
        } else {
            flags[k] = bt_solve(e_q4, settings, BT_WANT_ALL, poc, force, torque,
                                settings->population ? &uncertainty : NULL);
        }
    }
}

void bt_map_frames(int64_t n, const uint16_t *counts, const uint16_t *tare_q4,
                   const int32_t *pdc_above_rest_q4, const bt_map *map, int32_t *force_100un,
                   int32_t *torque_mnmm, int32_t *torsion_mnmm, int32_t *factor)
{
    for (int64_t k = 0; k < n; k++) {
        const uint16_t *row = counts + k * BT_ELECTRODES, *rest = tare_q4 + k * BT_ELECTRODES;
        int32_t e_q4[BT_ELECTRODES];
        bt_map_parts parts = {0};
        torsion_mnmm[k] = torque_mnmm[3 * k] = BT_INVALID_I32;
        torque_mnmm[3 * k + 1] = torque_mnmm[3 * k + 2] = BT_INVALID_I32;
        bt_signals_q4(row, rest, e_q4);
        bt_map_wrench_of(map, e_q4, row, rest, pdc_above_rest_q4[k], force_100un + 3 * k, torque_mnmm + 3 * k,
                         torsion_mnmm + k, &parts);
        bt_lesson_factors(force_100un + 3 * k, &parts, factor + BT_LESSON_FACTORS * k);
    }
}

void bt_pressure_forces(int64_t n, const uint16_t *filtered_q4, const uint16_t *tare_q4, int32_t gain_nn,
                        int32_t *force_100un)
{
    for (int64_t k = 0; k < n; k++) {
        force_100un[k] = bt_pressure_force(filtered_q4[k], tare_q4[k], gain_nn);
    }
}

uint32_t bt_binding_schema_hash(void)
{
    return BT_SCHEMA_HASH;
}
