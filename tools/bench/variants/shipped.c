// The adapter of the kernel that boards run, firmware/core: the one place that knows its interface.
#include "variants.h"

_Static_assert(VARIANT_POC == BT_WANT_POC && VARIANT_FORCE == BT_WANT_FORCE
                   && VARIANT_TORQUE == BT_WANT_TORQUE,
               "what is asked of a variant is asked of the kernel");

bool variant_shipped(const int32_t e_q4[BT_ELECTRODES], const variant_settings *settings, unsigned wanted,
                     variant_output *out)
{
    integer_output *integer = &out->integer;
    return bt_solve(e_q4, &settings->shipped, wanted, integer->poc_um, integer->force_100un,
                    integer->torque_mnmm)
           == 0;
}
