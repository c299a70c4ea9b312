// The adapter of the kernel that boards run, firmware/core: the one place that knows its interface.
#include "variants.h"

#include "poc.h"
#include "wrench.h"

bool variant_shipped(const int32_t e_q4[BT_ELECTRODES], const variant_settings *settings, unsigned wanted,
                     variant_output *out)
{
    integer_output *integer = &out->integer;
    const bt_kernel_settings *kernel = &settings->shipped;
    if (wanted == VARIANT_FORCE) {
        bt_force(e_q4, &kernel->gains, integer->force_100un);
        return true;
    }
    if (wanted == VARIANT_POC) {
        bt_point point;
        if (!bt_poc(e_q4, kernel->poc_weights, &point)) {
            return false;
        }
        for (int d = 0; d < 3; d++) {
            integer->poc_um[d] = point.um[d];
        }
        return true;
    }
    return bt_kernel(e_q4, kernel, integer->poc_um, integer->force_100un, integer->torque_mnmm) == 0;
}

void variant_read_integer(const variant_output *out, variant_result *result)
{
    for (int d = 0; d < 3; d++) {
        result->poc_um[d] = out->integer.poc_um[d];
        result->force_mn[d] = out->integer.force_100un[d] / 10.0;
        result->torque_mnmm[d] = out->integer.torque_mnmm[d];
    }
}
