// The tare machine finds the counts at rest, per electrode and for static pressure.
//
// Lin's rule (re-tare whenever the sum of squares stays under 1000 count^2) zeroes every load that grows
// slower than about 5 N/s and locks out after the first contact. This machine follows drift at a bounded rate
// while nothing touches, freezes on contact, rolls the tare back to before the contact began, and re-tares
// after release once the signals are quiet and pressure confirms the release. Where a light hold looks the
// same as a press's residue, the tare stays, and a second baseline (watch.h) detects the next contact
// (protocol/SPEC.md, Tare).
//
// Units: counts; baselines in 1/65536 count (q16); energies in count^2; time in rounds of 10 ms and sweeps of
// eight rounds. Baselines round half away from zero when published in 1/16 count.
#ifndef BIOTAC_TARE_H
#define BIOTAC_TARE_H

#include "keep/settings.h"
#include "touch/machine.h"

bt_tare_settings bt_tare_settings_from(const bt_settings *settings);

void bt_tare_reset(bt_tare *tare);

// A round: begin, then each electrode's and the pressure's word as it comes, then end. Every channel is given
// once in a round, BT_INVALID_COUNT where no good word came. t_us: device time. The functions for words
// return true in the slot that first touches a resting finger.
void bt_tare_begin(bt_tare *tare, const bt_tare_settings *settings);
bool bt_tare_touch(bt_tare *tare);
#ifndef BT_CDEF
static inline bool bt_tare_electrode(bt_tare *tare, unsigned electrode, uint16_t count)
{
    if (tare->state != BT_TARE_STATE_REST && tare->state != BT_TARE_STATE_DOUBT) {
        bt_trigger_follow(&tare->trigger, electrode, count);
        return false;
    }
    return bt_trigger_electrode(&tare->trigger, electrode, count) < 0 && bt_tare_touch(tare);
}
#endif
bool bt_tare_pressure(bt_tare *tare, uint16_t count);
void bt_tare_temperature(bt_tare *tare, uint16_t tdc);
void bt_tare_end(bt_tare *tare, uint32_t t_us, const bt_tare_settings *settings);

// Host commands; they return an enum bt_error. NOW needs two still sweeps; both are refused in FAULT. A tare
// that SET gives is compared with a sweep; a contradiction makes it unsure until a release.
uint8_t bt_tare_now(bt_tare *tare);
uint8_t bt_tare_set(bt_tare *tare, const bt_baseline *base, uint32_t age_ms);

// State that outlives a reset of the board, so that a grip goes on with the old tare: with the same drift,
// hold and doubt.
typedef struct {
    bt_baseline base;
    int32_t drift_q20;
    uint8_t drift_sweeps;
    bool held, unsure, likely;
} bt_tare_kept;

void bt_tare_keep(const bt_tare *tare, bt_tare_kept *kept);
void bt_tare_restore(bt_tare *tare, const bt_tare_kept *kept);

// The host reports that the finger holds something, or no longer does; or the host has been silent for too
// long.
void bt_tare_hold(bt_tare *tare);
void bt_tare_release(bt_tare *tare);
void bt_tare_lapse(bt_tare *tare);

// True when more electrodes are unusable in this round than results can do without.
#ifndef BT_CDEF
static inline bool bt_tare_faulty(const bt_tare *tare)
{
    return !bt_usable_without(tare->trigger.without);
}
#endif

#endif
