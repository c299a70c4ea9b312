#include "touch/watch.h"

#include "fixed_point.h"

#include <stddef.h>

#define LEVEL_Q3     16 // two counts: four sigmas; a load of 0.02 N/s is past it in one second
#define LEVEL_SWEEPS 32 // 2.6 s
#define JUMP_SWEEPS  6  // a level that was left so soon is a load's doing
#define WAIT_SWEEPS  5  // until means say nothing of before
#define ONE_WAY_Q2   26 // thirteen electrodes one way for six the other: three sigmas of noise

void bt_watch_begin(bt_watch *watch)
{
    watch->wait_sweeps = WAIT_SWEEPS;
    watch->drifts = false;
    watch->one_way_q2 = 0;
}

void bt_watch_take(bt_watch *watch, const bt_sweep *sweep, uint32_t unknown)
{
    watch->wait_sweeps = 0;
    for (unsigned i = 0; i < BT_LANES; i++) {
        uint32_t mean_q16 = unknown >> i & 1 ? BT_TARE_UNKNOWN : (uint32_t)sweep->mean_q3.lane[i] << 13;
        if (i == BT_LANE_PDC) {
            watch->base.pdc_q16 = mean_q16;
        } else {
            watch->base.electrode_q16[i] = mean_q16;
        }
    }
}

bool bt_watch_is_near(const bt_watch *watch, const bt_sweep *sweep, int span_q3)
{
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        int away_q3 = sweep->mean_q3.lane[i] - (int)(watch->base.electrode_q16[i] >> 13);
        if (away_q3 > span_q3 || away_q3 < -span_q3) {
            return false;
        }
    }
    return true;
}

void bt_watch_end(bt_watch *watch, const uint16_t *pressure_mean_q3)
{
    int change_q3 = pressure_mean_q3 == NULL ? LEVEL_Q3 + 1 : *pressure_mean_q3 - watch->level_q3;
    if (change_q3 > LEVEL_Q3 || change_q3 < -LEVEL_Q3) {
        watch->level_q3 = pressure_mean_q3 == NULL ? 0 : *pressure_mean_q3;
        if (watch->level_sweeps < JUMP_SWEEPS) {
            bt_watch_begin(watch);
        }
        watch->level_sweeps = 0;
    } else if (watch->level_sweeps < UINT8_MAX) {
        watch->level_sweeps++;
    }
    watch->one_way_q2 = (int16_t)(watch->one_way_q2 + watch->side - bt_shift_down(watch->one_way_q2, 2));
    bool one_way = watch->one_way_q2 >= ONE_WAY_Q2 || watch->one_way_q2 <= -ONE_WAY_Q2;
    watch->drifts = one_way && watch->level_sweeps >= LEVEL_SWEEPS;
    watch->side = 0;
}
