#include "touch/release.h"

#include "fixed_point.h"

#include <string.h>

// Pressure above the last tare, from 27 presses of two recordings: a press left at most 5.6 (median 1), and a
// hold at a tenth of the press's peak at least 11 (median 56). Pressure undershoots at a release, so only
// pressure that is too high is evidence.
#define QUIET_PDC_COUNT    4
#define REST_PDC_COUNT_MAX 10
#define REST_PDC_SHARE     40 // of the peak
// Electrodes: a press left at most .053 of its signal, a 356th of its energy.
#define CALM_COUNT2        400
#define EVEN_COUNT2        200  // seven sigmas of a worn sensor's means: nothing but noise
#define RESIDUE_SHARE      64   // of the peak energy
#define SETTLED_COUNT2     6000 // skin that settled, if pressure never showed a touch
#define FALLEN_SHARE       4    // what has fallen to a quarter is no longer the press it was
#define ENDED_STILL_SWEEPS 5    // 400 ms
#define QUIET_SWEEPS       12   // 960 ms
#define SHIFT_LEVEL_SWEEPS 18   // 1.4 s
#define STUCK_SWEEPS       25   // 2 s
#define EVEN_SWEEPS        100  // 8 s
#define LOADING_PDC_COUNT  2    // rise of pressure that a slow load makes in a second

void bt_release_begin(bt_release *release)
{
    memset(release, 0, sizeof *release);
}

void bt_release_pressure(bt_release *release, int32_t above)
{
    release->pdc_peak = above > release->pdc_peak ? above : release->pdc_peak;
}

// True if pressure can tell whether the press has ended: not if pressure did not show the press.
static bool has_witness(const bt_release *release, const bt_release_sweep *sweep)
{
    return sweep->pressure
           && (release->pdc_peak >= BT_PDC_PRESSED || release->uneven_peak < FALLEN_SHARE * SETTLED_COUNT2);
}

// Without a witness only electrodes that are back at rest say that nothing touches.
static bool is_residue(const bt_release *release, const bt_release_sweep *sweep)
{
    bool witness = has_witness(release, sweep);
    uint32_t left = witness ? release->energy_peak / RESIDUE_SHARE : 0;
    uint32_t forgiven = witness || !sweep->pressure ? sweep->forgiven_count2 : 0;
    left = (left > CALM_COUNT2 ? left : CALM_COUNT2) + forgiven;
    int32_t rest = bt_clamp(release->pdc_peak / REST_PDC_SHARE, QUIET_PDC_COUNT, REST_PDC_COUNT_MAX);
    bool back = witness ? sweep->above < rest : release->quiet_sweeps >= QUIET_SWEEPS;
    bool gone = sweep->energy_count2 < left || sweep->uneven_count2 < EVEN_COUNT2 + forgiven;
    return back && gone && sweep->still_sweeps >= ENDED_STILL_SWEEPS;
}

static bool is_untouched(const bt_release *release, const bt_release_sweep *sweep)
{
    return has_witness(release, sweep) && release->pdc_peak <= BT_PDC_HIT
           && release->quiet_sweeps >= QUIET_SWEEPS && sweep->still_sweeps >= QUIET_SWEEPS
           && sweep->energy_count2 < SETTLED_COUNT2 + sweep->forgiven_count2;
}

static void count_even(bt_release *release, const bt_release_sweep *sweep)
{
    bool low = !sweep->pressure || sweep->above < BT_PDC_PRESSED;
    bool even = low && sweep->uneven_count2 < EVEN_COUNT2;
    bool rose = sweep->pressure && sweep->above > release->even_above + LOADING_PDC_COUNT;
    if (!even || release->even_sweeps == 0 || rose) {
        release->even_above = sweep->above;
        release->even_sweeps = even;
    } else if (release->even_sweeps < UINT8_MAX) {
        release->even_sweeps++;
    }
}

// A load makes a pattern. Without one and with little pressure, what was never a press is no touch after a
// second, once pressure has been level for 1.4 s. A press, or what may have been one as pressure is unknown,
// is over after eight seconds: the pressure that a long press leaves takes minutes to go.
static bool is_shift(const bt_release *release, const bt_release_sweep *sweep)
{
    bool pressed = !sweep->pressure || release->pdc_peak >= BT_PDC_PRESSED;
    bool level = pressed ? release->even_sweeps >= EVEN_SWEEPS
                         : sweep->level_sweeps >= SHIFT_LEVEL_SWEEPS && release->even_sweeps >= QUIET_SWEEPS;
    return level && sweep->still_sweeps >= QUIET_SWEEPS;
}

static bool is_doubtful(const bt_release *release, const bt_release_sweep *sweep)
{
    bool pressed = sweep->pressure && release->pdc_peak >= BT_PDC_PRESSED;
    bool fallen = pressed ? sweep->above < release->pdc_peak / FALLEN_SHARE
                          : sweep->energy_count2 < release->energy_peak / FALLEN_SHARE;
    bool stuck = has_witness(release, sweep) && release->quiet_sweeps >= STUCK_SWEEPS;
    return sweep->still_sweeps >= ENDED_STILL_SWEEPS && (fallen || stuck);
}

bt_release_verdict bt_release_judge(bt_release *release, const bt_release_sweep *sweep)
{
    uint32_t energy = sweep->energy_count2;
    release->energy_peak = energy > release->energy_peak ? energy : release->energy_peak;
    uint32_t uneven = sweep->uneven_count2;
    release->uneven_peak = uneven > release->uneven_peak ? uneven : release->uneven_peak;
    // Without pressure the energy itself must have fallen, or the first second of a slow load would
    // pass for a residue.
    bool quiet =
        sweep->pressure ? sweep->above < QUIET_PDC_COUNT : energy < release->energy_peak / FALLEN_SHARE;
    release->quiet_sweeps =
        quiet ? (uint8_t)(release->quiet_sweeps + (release->quiet_sweeps < UINT8_MAX)) : 0;
    count_even(release, sweep);
    if (energy < CALM_COUNT2 && (quiet || !sweep->pressure)) {
        return BT_RELEASE_CLEAN;
    }
    if (is_residue(release, sweep) || is_untouched(release, sweep)) {
        return BT_RELEASE_RESIDUE;
    }
    if (is_shift(release, sweep)) {
        return BT_RELEASE_SHIFT;
    }
    return is_doubtful(release, sweep) ? BT_RELEASE_DOUBT : BT_RELEASE_NO;
}
