#include "touch/release.h"

#include "fixed_point.h"

#define SLOW_SWEEPS 4 // a third of a second: cooling takes 3 counts, a slow release 12

void bt_release_pressure(bt_release *release, int32_t above)
{
    release->pdc_peak = above > release->pdc_peak ? above : release->pdc_peak;
    release->pdc_low = above < release->pdc_low ? above : release->pdc_low;
    release->lesser = above < release->above ? above : release->above;
    release->same_rounds = above == release->above ? bt_count_up(release->same_rounds, UINT8_MAX) : 0;
    release->above = above;
}

static bool has_share(uint32_t energy_count2, int32_t pressed, uint32_t share)
{
    return energy_count2 >= (uint32_t)(pressed * pressed) / share;
}

// What pressure crept by under the strongest press stays when that is over, and so does what a press left
// that was there before the tare.
int32_t bt_release_pressed(const bt_release *release, int32_t above, int32_t warmed)
{
    bool alive = release->same_rounds < BT_REPEATS_ROUNDS && !release->found;
    int32_t share_q8 =
        has_share(release->energy_peak, release->pdc_peak, BT_FELT_SHARE) ? BT_LEFT_Q8 : BT_CREPT_Q8;
    int32_t pressed = above - warmed - (release->pdc_peak * share_q8 >> 8);
    return alive && pressed >= BT_SILENT_PDC ? pressed : 0;
}

void bt_release_felt(bt_release *release, int32_t pressed, uint32_t energy_count2, uint32_t noise_count2)
{
    if (has_share(energy_count2, pressed, BT_FELT_SHARE)) {
        release->unfelt_rounds = 0;
    } else if (energy_count2 < noise_count2) {
        release->unfelt_rounds = bt_count_up(release->unfelt_rounds, BT_UNFELT_ROUNDS);
    }
}

// How far pressure has moved, in counts, and whether that is enough for the electrodes' energy.
static uint32_t pdc_moved(const bt_release *release)
{
    int32_t down = -release->pdc_low;
    return (uint32_t)(down > release->pdc_peak ? down : release->pdc_peak);
}

static bool moved_for(const bt_release *release, uint32_t count2_per_pdc2)
{
    return pdc_moved(release) * pdc_moved(release) >= release->uneven_peak / count2_per_pdc2;
}

// Counts of a press that cooling may have taken. It takes them slowly: what falls faster to a quarter was let
// go, and only what cools from then on may take more.
static int32_t cooling_loss(bt_release *release, const bt_release_sweep *sweep)
{
    int32_t fell = release->slow_above - sweep->above;
    release->slow_above -= fell / SLOW_SWEEPS;
    if (fell > BT_MISSING_PDC && sweep->above < release->pdc_peak / BT_FALLEN_SHARE) {
        release->cold_then = sweep->cold;
    }
    int32_t loss = sweep->cold - release->cold_then;
    return loss > 0 && release->pdc_peak >= BT_PDC_PRESSED ? loss : 0;
}

// Pressure above rest is a touch, whatever the finger; pressure at rest means no touch only if a touch would
// move it. Without that witness only electrodes that are back at rest say that nothing touches.
static bool is_residue(const bt_release *release, const bt_release_sweep *sweep)
{
    uint32_t left = sweep->witness ? release->energy_peak / BT_RESIDUE_SHARE : 0;
    uint32_t forgiven = sweep->witness ? sweep->forgiven_count2 : 0;
    left = (left > BT_CALM_COUNT2 ? left : BT_CALM_COUNT2) + forgiven;
    int32_t rest = bt_clamp(release->pdc_peak / BT_REST_PDC_SHARE, BT_QUIET_PDC, BT_REST_PDC_MAX);
    bool back = sweep->witness ? sweep->uncooled < rest : release->quiet_sweeps >= BT_QUIET_SWEEPS;
    bool calm = sweep->energy_count2 < left || sweep->uneven_count2 < BT_EVEN_COUNT2 + forgiven;
    return back && calm && sweep->still_sweeps >= BT_ENDED_SWEEPS;
}

static void count_even(bt_release *release, const bt_release_sweep *sweep)
{
    bool even = sweep->uncooled < BT_PDC_PRESSED && sweep->uneven_count2 < BT_EVEN_COUNT2;
    bool rose = sweep->pressure && sweep->above > release->even_above + BT_LOADING_PDC;
    if (!even || release->even_sweeps == 0 || rose) {
        release->even_above = sweep->above;
        release->even_sweeps = even;
    } else {
        release->even_sweeps = bt_count_up(release->even_sweeps, UINT8_MAX);
    }
}

// A load makes a pattern. Without one and with little pressure, what was never a press is no touch after a
// second, once pressure has been level for 1.4 s. A press, or what may have been one as pressure is
// unknown, is over after eight seconds: the pressure that a long press leaves takes minutes to go.
static bool is_shift(const bt_release *release, const bt_release_sweep *sweep)
{
    bool pressed = !sweep->pressure || release->pdc_peak >= BT_PDC_PRESSED;
    bool level = pressed ? release->even_sweeps >= BT_EVEN_SWEEPS
                         : sweep->level_sweeps >= BT_LEVEL_SWEEPS && release->even_sweeps >= BT_QUIET_SWEEPS;
    return level && sweep->still_sweeps >= BT_QUIET_SWEEPS;
}

// A press has fallen to a quarter by its pressure; or by its energy where pressure is no witness, or may have
// risen with the temperature.
static bool is_doubtful(const bt_release *release, const bt_release_sweep *sweep)
{
    int32_t quarter = release->pdc_peak / BT_FALLEN_SHARE;
    bool low = sweep->witness && sweep->above < (quarter > BT_QUIET_PDC ? quarter : BT_QUIET_PDC);
    bool faint = (!sweep->witness || sweep->warmer)
                 && sweep->energy_count2 < release->energy_peak / BT_FALLEN_SHARE + sweep->forgiven_count2;
    return sweep->still_sweeps >= BT_ENDED_SWEEPS && (low || faint);
}

static bt_release_verdict verdict(const bt_release *release, const bt_release_sweep *sweep, bool low)
{
    // What only passes by the tare is no rest: a finger that was tared in a grip passes by it when it opens.
    if (sweep->energy_count2 < BT_CALM_COUNT2 && low && sweep->still_sweeps > 0) {
        return BT_RELEASE_CLEAN;
    }
    if (is_residue(release, sweep)) {
        return BT_RELEASE_RESIDUE;
    }
    if (is_shift(release, sweep)) {
        return BT_RELEASE_SHIFT;
    }
    return is_doubtful(release, sweep) ? BT_RELEASE_DOUBT : BT_RELEASE_NO;
}

// Electrodes without their excitation say their rest counts and noise, whatever presses, and a controller
// squeezes on. Living ones feel a press before pressure does, so what they do not feel is told at once; a
// narrow tip that slides between them is a moment's.
static void listen(bt_witness *witness, bt_release *release, const bt_release_sweep *sweep)
{
    const int32_t pressed = sweep->pressure ? sweep->pressed : 0;
    release->deaf = !has_share(sweep->energy_count2, pressed, BT_DEAF_SHARE);
    if (witness->silent < BT_SILENT_SWEEPS) {
        bool silent = !has_share(sweep->energy_count2, pressed, BT_SILENT_SHARE);
        witness->silent = silent ? witness->silent + 1 : 0;
    } else if (pressed > 0 && has_share(sweep->energy_count2, pressed, BT_FELT_SHARE)) {
        witness->silent = 0;
    }
}

bt_release_verdict bt_release_judge(bt_release *release, bt_witness *witness, bt_release_sweep *sweep)
{
    uint32_t energy = sweep->energy_count2, uneven = sweep->uneven_count2;
    release->energy_peak = energy > release->energy_peak ? energy : release->energy_peak;
    release->uneven_peak = uneven > release->uneven_peak ? uneven : release->uneven_peak;
    sweep->uncooled = sweep->pressure ? sweep->above + cooling_loss(release, sweep) : 0;
    bool unmoved = release->uneven_peak >= BT_FIRM_COUNT2 && !moved_for(release, BT_FLAT_SHARE);
    if (sweep->pressure && pdc_moved(release) >= BT_PDC_PRESSED && moved_for(release, BT_MOVES_SHARE)) {
        witness->moves = true;
        witness->flat = false;
    }
    listen(witness, release, sweep);
    sweep->witness = sweep->pressure && witness->moves && !unmoved;
    bool low = !sweep->pressure || sweep->above < BT_QUIET_PDC;
    // Without a witness the energy itself must have fallen, or the first second of a slow load would pass for
    // a residue.
    bool quiet = low && (sweep->witness || energy < release->energy_peak / BT_FALLEN_SHARE);
    release->quiet_sweeps = quiet ? bt_count_up(release->quiet_sweeps, UINT8_MAX) : 0;
    count_even(release, sweep);
    bt_release_verdict now = verdict(release, sweep, low);
    // Electrodes feel a real press up to a second before pressure does, so what it lacks counts only later.
    if (sweep->pressure && unmoved && (now != BT_RELEASE_NO || sweep->still_sweeps >= BT_ENDED_SWEEPS)) {
        witness->moves = false;
        witness->flat = true;
    }
    return now;
}
