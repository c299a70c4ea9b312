#include "kernels.h"

#include "exact.h"
#include "keep/settings.h"

#include <math.h>

static bool kernel_shipped(const int32_t e_q4[BT_ELECTRODES], const kernel_settings *settings,
                           uint32_t wanted, kernel_output *out)
{
    return bt_solve(e_q4, &settings->shipped, wanted, out->integer.poc_um, out->integer.force_100un,
                    out->integer.torque_mnmm, NULL)
           == 0;
}

static bool kernel_double(const int32_t e_q4[BT_ELECTRODES], const kernel_settings *settings, uint32_t wanted,
                          kernel_output *out)
{
    (void)wanted;
    double e[BT_ELECTRODES];
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e[i] = e_q4[i] / 16.0;
    }
    lin2013(e, &settings->real64, &out->real64);
    return !isnan(out->real64.poc_mm[0]);
}

static bool kernel_exact(const int32_t e_q4[BT_ELECTRODES], const kernel_settings *settings, uint32_t wanted,
                         kernel_output *out)
{
    (void)wanted;
    exact_force_un(e_q4, settings->force_nn, out->exact.force_un);
    exact_torque_yz_mnmm(e_q4, settings->torque_nn, out->exact.torque_mnmm + 1);
    if (!exact_poc(e_q4, settings->shipped.poc_weights, out->exact.poc_nm)) {
        return false;
    }
    out->exact.torque_mnmm[0] = exact_torque_x_mnmm(out->exact.poc_nm, out->exact.force_un);
    return true;
}

// From a kernel's own fields and units to um, mN and mN*mm.
#define READ(from, poc, to_um, force, to_mn, torque, to_mnmm)                                                \
    static void read_##from(const kernel_output *out, kernel_result *result)                                 \
    {                                                                                                        \
        for (int d = 0; d < 3; d++) {                                                                        \
            result->poc_um[d] = (double)out->from.poc[d] to_um;                                              \
            result->force_mn[d] = (double)out->from.force[d] to_mn;                                          \
            result->torque_mnmm[d] = (double)out->from.torque[d] to_mnmm;                                    \
        }                                                                                                    \
    }
READ(real64, poc_mm, *1000, force_n, *1000, torque_nmm, *1000)
READ(exact, poc_nm, / 1000, force_un, / 1000, torque_mnmm, )
READ(f32, poc_mm, *1000, force_n, *1000, torque_nmm, *1000)
READ(integer, poc_um, , force_100un, / 10, torque_mnmm, )

const kernel kernels[KERNELS] = {
    [KERNEL_SHIPPED] = {"shipped", kernel_shipped, read_integer},
    {"double", kernel_double, read_real64},
    {"float", kernel_float, read_f32},
    {"exact int64", kernel_exact, read_exact},
    {"quick", kernel_quick, read_integer},
};

void kernel_settings_init(kernel_settings *settings, int poc_weights)
{
    static const uint8_t gains[] = {BT_SETTING_FORCE_GAIN_X_NN, BT_SETTING_FORCE_GAIN_Y_NN,
                                    BT_SETTING_FORCE_GAIN_Z_NN, BT_SETTING_TORQUE_GAIN_Y_NN,
                                    BT_SETTING_TORQUE_GAIN_Z_NN};
    bt_settings defaults;
    bt_settings_reset(&defaults);
    for (int d = 0; d < 3; d++) {
        settings->force_nn[d] = bt_settings_get(&defaults, gains[d]);
        const double gain_n = settings->force_nn[d] * 1e-9;
        settings->real64.force_gain[d] = gain_n;
        settings->f32_force[d] = (float)gain_n;
        for (int i = 0; i < BT_ELECTRODES; i++) {
            settings->f32_place_mm[i][d] = bt_electrode_um[i][d] / 1000.0F;
            settings->f32_normal[i][d] = bt_normal_milli[i][d] / 1000.0F;
        }
    }
    for (int d = 0; d < 2; d++) {
        settings->torque_nn[d] = bt_settings_get(&defaults, gains[3 + d]);
        const double gain_n = settings->torque_nn[d] * 1e-9;
        settings->real64.torque_gain[d] = gain_n;
        settings->f32_torque[d] = (float)gain_n;
        for (int i = 0; i < BT_ELECTRODES; i++) {
            settings->f32_arm_mm[i][d] = (float)bt_arm_nm[i][d + 1] / 1e6F;
        }
    }
    settings->real64.poc_weights = poc_weights;
    settings->shipped = (bt_solve_settings){.poc_weights = poc_weights,
                                            .gains = bt_gains_from(settings->force_nn, settings->torque_nn)};
}

void kernel_frames(int index, int poc_weights, int64_t n, const int32_t *e_q4, double *out)
{
    kernel_settings settings;
    kernel_settings_init(&settings, poc_weights);
    for (int64_t k = 0; k < n; k++) {
        kernel_output output = {0};
        kernel_result result;
        bool has_poc = kernels[index].run(e_q4 + k * BT_ELECTRODES, &settings, BT_WANT_ALL, &output);
        kernels[index].read(&output, &result);
        for (int d = 0; d < 3; d++) {
            out[9 * k + d] = has_poc ? result.poc_um[d] : (double)NAN;
            out[9 * k + 3 + d] = result.force_mn[d];
            out[9 * k + 6 + d] = has_poc || d > 0 ? result.torque_mnmm[d] : (double)NAN;
        }
    }
}
