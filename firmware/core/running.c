#include "running.h"

#include "fix.h"

#include <string.h>

void bt_running_reset(bt_running *running)
{
    memset(running, 0, sizeof *running);
}

static uint32_t weight(int32_t e_q4)
{
    return e_q4 < 0 ? (uint32_t)-e_q4 : 0;
}

void bt_running_put(bt_running *running, unsigned electrode, int32_t e_q4)
{
    // Modulo 2^32, which the finished sums fit: what is taken away was added before.
    uint32_t change = weight(e_q4) - weight(running->e_q4[electrode]);
    running->e_q4[electrode] = e_q4;
    if (change == 0) {
        return;
    }
    int32_t x = bt_electrode_um[electrode][0];
    int32_t y = bt_electrode_um[electrode][1];
    int32_t z = bt_electrode_um[electrode][2];
    bt_linear_sums *sums = &running->sums;
    if (x > 0) {
        sums->ahead += change * (uint32_t)x;
    } else {
        sums->behind += change * BT_DIVIDE_U32((uint32_t)-x, BT_FOLD_X_UNIT_UM);
    }
    sums->y = (int32_t)((uint32_t)sums->y + change * (uint32_t)y);
    sums->z -= change * (uint32_t)z;
    sums->total += change;
}

bool bt_running_point(const bt_running *running, int weights, bt_point *point)
{
    if (weights == BT_POC_WEIGHTS_COMPRESS_N1) {
        return bt_poc_linear(&running->sums, point);
    }
    return bt_poc(running->e_q4, weights, point);
}
