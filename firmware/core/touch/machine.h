// State of the tare machine (tare.h) for one finger: tare.c, follow.c, judge.c and adopt.c work on it.
//
// Units: counts; baselines in 1/65536 count (q16); energies in count^2; time in rounds of 10 ms and sweeps of
// eight.
#ifndef BIOTAC_MACHINE_H
#define BIOTAC_MACHINE_H

#include "signal/absence.h"
#include "signal/noise.h"
#include "signal/sweep.h"
#include "signal/trigger.h"
#include "touch/baseline.h"
#include "touch/drift.h"
#include "touch/release.h"
#include "touch/thermal.h"
#include "touch/watch.h"

// The settings that the machine needs.
typedef struct {
    uint32_t contact_energy_count2;
    int32_t thermal_gain_q16; // counts that a resting electrode gains per count of TDC
} bt_tare_settings;

typedef struct {
    bt_trigger trigger;
    bt_sweep sweep;
    uint8_t state;          // enum bt_tare_state
    uint8_t reason;         // enum bt_tare_reason of the last change
    uint8_t before_fault;   // the state to go back to
    bool changed;           // by the last round, beyond drift tracking, or by the host
    bool tared;             // there is a tare
    bool held;              // by the host: no new tare
    bool released;          // by the host: a doubtful pattern is residue
    int16_t left_pdc;       // least pressure above the tare since that release, not below 0
    uint8_t drifted_sweeps; // of rest, until all electrodes have long not moved alike by more than drift
    bool unsure;            // no release has confirmed the tare: START's, or one that the readings contradict
    bool likely;            // unconfirmed, but consistent with the readings: a host's or a SHIFT's
    bool unchecked;         // the host's tare has not been compared with a whole sweep yet
    bool aged;              // and it was old
    bt_baseline base;
    uint16_t electrode_q4[BT_ELECTRODES]; // base as subtracted; BT_INVALID_COUNT when unknown
    uint32_t threshold_count2;            // energy above which a round counts as touched
    uint32_t age_rounds;                  // since the last change
    uint32_t contact_rounds;              // since the contact was seen

    bt_silence silence;
    bt_watch watch;
    uint8_t inverted_rounds; // consecutive rounds that contradict the tare
    bt_rollback rollback;
    bt_noise noise;
    bt_drift drift;
    int32_t drift_q16; // drift added to each electrode in this sweep
    bt_thermal thermal;
    bt_release release;
    bt_witness witness;

    uint8_t hits;           // consecutive rounds in which the trigger fired
    bool touched;           // the trigger fired in this round, or earlier and is still over the limit
    bool partial;           // this sweep did not serve all electrodes in one state
    bool partial_before;    // nor did the one before
    uint32_t deviation_q6;  // this sweep's squared distances of filtered counts from their means
    uint32_t energy_count2; // this sweep's squared distances of means from the tare
    int32_t sum_q4;         // the same distances, added up
    bool pressure_seen;     // in this sweep at least one pressure word was good
} bt_tare;

#ifndef BT_CDEF
// A contact, or perhaps a light hold.
static inline bool bt_tare_touched(const bt_tare *tare)
{
    return tare->state == BT_TARE_STATE_CONTACT || tare->state == BT_TARE_STATE_DOUBT;
}

// Static pressure above the tare, in whole counts, and whether both are known.
static inline bool bt_tare_pdc_known(const bt_tare *tare)
{
    return tare->trigger.pressure_now && tare->base.pdc_q16 != BT_TARE_UNKNOWN;
}

static inline int32_t bt_tare_pdc_above(const bt_tare *tare)
{
    return tare->trigger.smooth.lane[BT_LANE_PDC] - bt_baseline_count(tare->base.pdc_q16);
}
#endif

#endif
