#include "solve/results.h"

#include "fixed_point.h"
#include "map/estimate.h"
#include "map/population.h"
#include "signal/signals.h"
#include "solve/flags.h"
#include "solve/interval.h"

#include <stddef.h>

#define POC_LOW 4 // times the contact threshold
#define LOST_MN 5 // mN per count by Lin's gains, at most 8, less the share that the interval has already
#define LOST_BY_MAP_MN 3 // the same by an own map, of normal and shear alike

// Energies of a round's signals, truncated to 1/2 count.
typedef struct {
    uint32_t energy; // count^2
    uint32_t bulge;  // count^2, electrodes above rest only
} signal_shape;

_Static_assert(BT_ELECTRODES *(BT_E_MAX_Q4 / 8 + 1LL) * (BT_E_MAX_Q4 / 8 + 1LL) <= UINT32_MAX,
               "an energy in 1/4 count^2 must fit 32 bits");

static inline void add_to_shape(signal_shape *shape_q2, int32_t e_q4)
{
    int32_t e_q1 = bt_shift_down(e_q4, 3);
    uint32_t square_q2 = (uint32_t)(e_q1 * e_q1);
    shape_q2->energy += square_q2;
    if (e_q1 > 0) {
        shape_q2->bulge += square_q2;
    }
}

// Signals and shape in one pass, where every electrode has a count and a tare. Not inlined: the compiler then
// makes plain pointer loops.
static BT_NOINLINE signal_shape all_signals(const uint16_t counts[BT_ELECTRODES],
                                            const uint16_t tare_q4[BT_ELECTRODES],
                                            int32_t e_q4[BT_ELECTRODES])
{
    signal_shape shape_q2 = {0, 0};
    BT_UNROLL
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e_q4[i] = 16 * (int32_t)counts[i] - tare_q4[i];
        add_to_shape(&shape_q2, e_q4[i]);
    }
    return shape_q2;
}

static signal_shape signals(const uint16_t counts[BT_ELECTRODES], const bt_tare *tare,
                            int32_t e_q4[BT_ELECTRODES])
{
    signal_shape shape = {0, 0};
    if (tare->trigger.odd == 0 && !(tare->trigger.unknown & BT_ALL_ELECTRODES)) {
        shape = all_signals(counts, tare->electrode_q4, e_q4);
    } else {
        bt_signals_q4(counts, tare->electrode_q4, e_q4);
        for (int i = 0; i < BT_ELECTRODES; i++) {
            add_to_shape(&shape, e_q4[i]);
        }
    }
    shape.energy >>= 2;
    shape.bulge >>= 2;
    return shape;
}

// The PoC's outward normal is within 60 degrees of -z: c_z <= -r/2, on tip and cylinder alike.
static bool faces_down(const int16_t poc_um[3])
{
    return poc_um[2] <= -BT_CORE_RADIUS_UM / 2 && poc_um[2] != BT_INVALID_I16;
}

static bool enough_active(const int32_t e_q4[BT_ELECTRODES])
{
    int wanted = BT_ACTIVE_FOR_TORSION;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        // One comparison for both signs: signals in between stay below.
        if ((uint32_t)(e_q4[i] + BT_ACTIVE_Q4 - 1) > 2 * (BT_ACTIVE_Q4 - 1) && --wanted == 0) {
            return true;
        }
    }
    return false;
}

static uint32_t by_map(int32_t above_q4, const uint16_t counts[BT_ELECTRODES], const bt_tare *tare,
                       const int32_t e_q4[BT_ELECTRODES], const bt_solve_settings *settings,
                       uint32_t quantities, bt_msg_frame *msg, bt_uncertainty *uncertainty)
{
    bt_map_input input = {.counts = counts, .tare_q4 = tare->electrode_q4, .pdc_above_rest_q4 = above_q4};
    return BT_FRAME_FLAG_MAPPED
           | bt_solve_mapped(e_q4, &input, settings, quantities, msg->poc_um, msg->force_100un,
                             msg->torque_mnmm, &msg->torsion_mnmm, uncertainty);
}

// Losses by electrodes that are out: their number; the counts, added up, by which the last word lay further
// from rest than the estimate; and the estimates of condemned ones, which count as at rest.
typedef struct {
    uint32_t electrodes, lost, condemned;
} losses;

static losses losses_of(const bt_trigger *trigger, const uint16_t completed[BT_ELECTRODES])
{
    losses out = {0, 0, 0};
    for (int i = 0; i < BT_ELECTRODES; i++) {
        if (trigger->without >> i & 1) {
            const int32_t rest = trigger->rest.lane[i];
            const int32_t last = trigger->smooth.lane[i] - rest, estimate = completed[i] - rest;
            out.electrodes++;
            out.condemned += trigger->out >> i & 1 ? bt_abs32(estimate) : 0;
            out.lost += bt_abs32(last) > bt_abs32(estimate) ? bt_abs32(last - estimate) : 0;
            out.lost += rest == BT_TRIGGER_UNREAD ? BT_FULL_SCALE_COUNT : 0; // neither known nor estimated
        }
    }
    if (!bt_usable_without(trigger->without) || out.lost > BT_FULL_SCALE_COUNT) {
        out.lost = BT_FULL_SCALE_COUNT; // too many are out to estimate any
    }
    return out;
}

void bt_point_signals(const bt_round *round, const bt_tare *tare, int32_t e_q4[BT_ELECTRODES])
{
    uint16_t counts[BT_ELECTRODES];
    bt_complete(round->electrode, tare->electrode_q4, tare->trigger.without, counts);
    bt_signals_q4(counts, tare->electrode_q4, e_q4);
}

void bt_results(const bt_round *round, const bt_tare *tare, const bt_solve_settings *settings,
                uint32_t quantities, bt_msg_frame *msg)
{
    uint32_t flags = bt_channel_flags(round, tare) | bt_not_asked(quantities);
    bt_grip_unknown(msg);
    msg->torsion_mnmm = BT_INVALID_I32; // only a map gives one
    if (flags & BT_FRAME_FLAG_UNTARED) {
        msg->flags = flags;
        // With nothing wanted, the kernel marks all invalid and reads no signal.
        (void)bt_solve(NULL, settings, 0, msg->poc_um, msg->force_100un, msg->torque_mnmm, NULL);
        return;
    }
    int32_t e_q4[BT_ELECTRODES];
    uint16_t completed[BT_ELECTRODES];
    const uint16_t *counts = round->electrode;
    bt_uncertainty uncertainty; // field by field, which spares a memset
    uncertainty.margin = &bt_lin_margin;
    uncertainty.noise_q4 = tare->noise.sigma_q4;
    uncertainty.tare_unconfirmed = tare->unsure;
    uncertainty.guess_mn[0] = uncertainty.guess_mn[1] = 0;
    uncertainty.shear_max_mn = 0;
    losses out = {0, 0, 0};
    if (tare->trigger.odd != 0) {
        bt_complete(counts, tare->electrode_q4, tare->trigger.without, completed);
        counts = completed;
        out = losses_of(&tare->trigger, completed);
    }
    uncertainty.out = out.electrodes;
    signal_shape shape = signals(counts, tare, e_q4);
    const int32_t above_q4 = bt_pdc_above_rest_q4(round->pdc, bt_tare_q4(tare->base.pdc_q16));
    const uint32_t pressed = above_q4 > 0 ? (uint32_t)above_q4 >> 4 : 0;
    const bool known = tare->witness.moves && bt_count_usable(round->pdc) && above_q4 != BT_INVALID_I32;
    uncertainty.pressed_mn = known ? (int32_t)(pressed * settings->count_mn_q8 >> 8) : -1;
    if (settings->map != NULL) {
        uncertainty.margin = &settings->map->margin;
        flags |= by_map(above_q4, counts, tare, e_q4, settings, quantities, msg, &uncertainty);
        uncertainty.guess_mn[0] += LOST_BY_MAP_MN * out.lost;
        uncertainty.guess_mn[1] += LOST_BY_MAP_MN * out.lost;
    } else if (settings->population) {
        uncertainty.margin = &bt_population.margin;
        flags |= bt_solve(e_q4, settings, quantities, msg->poc_um, msg->force_100un, msg->torque_mnmm,
                          &uncertainty);
    } else {
        flags |= bt_solve(e_q4, settings, quantities, msg->poc_um, msg->force_100un, msg->torque_mnmm, NULL);
        bt_lin_guess(bt_strength_100un(e_q4), uncertainty.guess_mn);
        const uint32_t lost = bt_at_most(out.lost + out.condemned, BT_FULL_SCALE_COUNT);
        uncertainty.guess_mn[0] += LOST_MN * lost;
        uncertainty.guess_mn[1] += LOST_MN * lost / 2;
    }
    uint32_t warmed_q8 = bt_abs32(bt_thermal_warmed_q8(&tare->thermal));
    uint32_t limit_q8 = settings->map != NULL ? BT_DEGREE_Q8 : settings->warmed_max_q8;
    flags |= bt_tare_touched(tare) && warmed_q8 > limit_q8 ? BT_FRAME_FLAG_TEMP : 0;
    flags |= shape.energy < POC_LOW * tare->threshold_count2 ? BT_FRAME_FLAG_POC_LOW : 0;
    flags |= shape.bulge > shape.energy - shape.bulge ? BT_FRAME_FLAG_SHEAR_MIX : 0;
    if (!(flags & BT_FRAME_FLAG_ELECTRODE_OUT) && faces_down(msg->poc_um)
        && shape.energy > tare->threshold_count2 && enough_active(e_q4)) {
        flags |= BT_FRAME_FLAG_TORSION_OK;
    }
    msg->flags = flags;
    bt_grip(&uncertainty, msg);
}
