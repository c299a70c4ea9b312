#include "solve/pressure.h"

#include "fixed_point.h"
#include "map/lesson.h"
#include "signal/round.h"

#define NN_PER_100UN 100000
#define MILLI        1000

_Static_assert((int64_t)(BT_FULL_SCALE_COUNT * 256) * BT_SETTING_PRESSURE_FILTER_MILLI_MAX <= INT32_MAX,
               "a weighted step must fit 32 bits");
_Static_assert((int64_t)BT_E_MAX_Q4 *BT_SETTING_PRESSURE_GAIN_NN_MAX / 16 / NN_PER_100UN <= INT32_MAX,
               "a force must fit its type");
_Static_assert(BT_SETTING_PRESSURE_GAIN_NN_MIN == 0 && BT_SETTING_PRESSURE_FILTER_MILLI_MAX == MILLI,
               "no gain may be negative, and no filter may overshoot");

void bt_pressure_use(bt_pressure *pressure, const bt_settings *settings)
{
    pressure->gain_nn = bt_settings_get(settings, BT_SETTING_PRESSURE_GAIN_NN);
    pressure->filter_milli = bt_settings_get(settings, BT_SETTING_PRESSURE_FILTER_MILLI);
}

void bt_pressure_add(bt_pressure *pressure, uint16_t pdc)
{
    if (!bt_count_usable(pdc)) {
        pressure->known = false;
        return;
    }
    int32_t step_q8 = ((int32_t)pdc << 8) - pressure->filtered_q8;
    if (!pressure->known) {
        pressure->known = true;
        pressure->filtered_q8 += step_q8;
        return;
    }
    uint32_t weighed = bt_abs32(step_q8 * pressure->filter_milli);
    pressure->filtered_q8 += bt_with_sign(bt_div_round_u32(weighed, MILLI), step_q8);
}

uint16_t bt_pressure_filtered_q4(const bt_pressure *pressure)
{
    return pressure->known ? (uint16_t)bt_shift_round(pressure->filtered_q8, 4) : BT_INVALID_COUNT;
}

int32_t bt_pressure_force(uint16_t filtered_q4, uint16_t tare_q4, int32_t gain_nn)
{
    if (filtered_q4 == BT_INVALID_COUNT || tare_q4 == BT_INVALID_COUNT || gain_nn == 0) {
        return BT_INVALID_I32;
    }
    int64_t force_nn_q4 = (int64_t)((int32_t)filtered_q4 - tare_q4) * gain_nn;
    return (int32_t)bt_div_round(force_nn_q4, 16 * NN_PER_100UN);
}

// ---- the witness ---------------------------------------------------------------------------------------

#define UNIT_MN         8
#define MOST            (UINT16_MAX / UNIT_MN)
#define LEARNED_FROM_MN 700 // a light touch's pressure is drift, too
#define LEAST_COUNTS    32
#define SURE_N          32 // newtons times FRAMEs: a third of a second of 1 N
#define SURE            (SURE_N * 1000 / UNIT_MN)
#define FORGOTTEN       (64 * SURE)
// Place, pull and speed change pressure by an eighth, temperature by 30 counts in a degree.
#define USUAL_MN        100
#define USUAL_SHIFT     3
_Static_assert((uint64_t)BT_FULL_SCALE_COUNT *(FORGOTTEN + 2 * MOST) <= UINT32_MAX, "a product must fit");

static uint16_t wider(uint16_t half_mn, uint32_t by_mn)
{
    const uint32_t most = half_mn == BT_INVALID_COUNT ? BT_INVALID_COUNT : BT_INVALID_COUNT - 1;
    return (uint16_t)bt_at_most(half_mn + by_mn, most);
}

static void learn(bt_pressure_learned *learned, uint32_t pressed, uint32_t felt)
{
    learned->pressed += pressed;
    learned->felt += felt;
    if (learned->felt >= FORGOTTEN) {
        learned->pressed /= 2;
        learned->felt /= 2;
    }
}

void bt_pressure_witness(bt_pressure_learned *learned, const bt_map *map, bt_msg_frame *msg)
{
    const uint32_t other = BT_TRUST_FLAGS_NONE | BT_TRUST_FLAGS_HOLD | BT_TRUST_FLAGS_INTERVAL;
    const uint32_t tare = BT_FRAME_FLAG_TARE_UNSURE | BT_FRAME_FLAG_TARE_LIKELY;
    const int32_t above = msg->pdc - (msg->pdc_tare_q4 + 8) / 16;
    if (!bt_count_usable(msg->pdc) || msg->pdc_tare_q4 == BT_INVALID_COUNT
        || msg->normal_mn == BT_INVALID_COUNT) {
        return;
    }
    const uint32_t pressed = above > 0 ? (uint32_t)above : 0;
    uint32_t felt = msg->normal_mn / UNIT_MN;
    const bool like =
        msg->normal_mn >= LEARNED_FROM_MN && pressed >= LEAST_COUNTS && !(msg->flags & other & ~tare);
    const uint32_t taught_per_n = bt_lesson_counts_per_n(map);
    if (learned->felt == 0 && taught_per_n != 0) {
        *learned = (bt_pressure_learned){.pressed = SURE_N * taught_per_n, .felt = SURE};
    }
    if (learned->felt >= SURE) {
        const uint32_t by_pressure = bt_div_round_u32(pressed * learned->felt, learned->pressed);
        const uint32_t allowed = bt_at_most(by_pressure, MOST);
        const uint32_t lesser = bt_at_most(felt, allowed), apart = felt + allowed - 2 * lesser;
        const uint32_t usual = (lesser >> USUAL_SHIFT) + USUAL_MN / UNIT_MN;
        const uint32_t by_mn = UNIT_MN * bt_at_most(3 * bt_excess(apart, usual), apart + apart / 4);
        msg->normal_half_mn = wider(msg->normal_half_mn, by_mn);
        msg->shear_half_mn = wider(msg->shear_half_mn, by_mn / 2);
        // A finger's pressure changes over days. What a narrow tip lacks in force must not pass for that.
        const uint32_t low = allowed - allowed / 64, high = allowed + allowed / 16;
        felt = felt < low ? low : felt < high ? felt : high;
    }
    if (like) {
        learn(learned, pressed, felt);
    }
}
