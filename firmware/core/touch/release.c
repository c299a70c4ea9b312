#include "touch/release.h"

#include "fixed_point.h"
#include "wire/messages_gen.h"
#include "wire/sensor_gen.h"

#include <string.h>

// Measured on real sensors; the settling rule comes from real recordings.
#define PDC_QUIET              4 // pressure above rest that still is a release; one-sided, it undershoots
#define CALM_ENERGY            400
#define RESIDUE_ENERGY         6000 // count^2 that skin hysteresis may leave
#define RESIDUE_SWEEPS         12   // 960 ms
#define SETTLE_SWEEPS          5    // 400 ms
#define SETTLE_PDC             30   // pressure that real skin keeps after a press (+24 seen), not more
#define FALL                   4    // a release has fallen to a quarter of the contact's peak
#define DRIFT_FRAMES_PER_COUNT 400  // 15 counts/min, the worst drift measured
#define DRIFT_LIMIT_BLIND      6000 // without pressure, 60 s of drift is all that may be forgiven
#define DRIFT_LIMIT            60000

_Static_assert((uint64_t)DRIFT_LIMIT *DRIFT_LIMIT <= UINT32_MAX, "the forgiven drift must fit 32 bits");

void bt_release_begin(bt_release *release)
{
    memset(release, 0, sizeof *release);
}

void bt_release_pressure(bt_release *release, int32_t above)
{
    release->pressure_seen = true;
    release->pdc_peak = above > release->pdc_peak ? above : release->pdc_peak;
}

static uint32_t residue_limit(const bt_release *release, uint32_t contact_rounds)
{
    uint32_t limit = release->pressure_seen ? DRIFT_LIMIT : DRIFT_LIMIT_BLIND;
    uint32_t rounds = contact_rounds < limit ? contact_rounds : limit;
    uint32_t drift_count2 = BT_DIVIDE_U32(rounds * rounds, DRIFT_FRAMES_PER_COUNT * DRIFT_FRAMES_PER_COUNT);
    return RESIDUE_ENERGY + BT_ELECTRODES * drift_count2;
}

// On real fingers the skin's hysteresis leaves thousands of count^2 and some pressure after a press,
// so that neither energy nor pressure come back to the tare. What tells a release then is that the
// pressure has fallen far below the press's own peak and nothing moves any more. A load that only
// grows is at its peak all the time and never passes; without a press there is no release: a light
// touch while the pressure undershoots has no peak.
static bool settled(const bt_release *release, const bt_release_sweep *sweep)
{
    bool pressed = release->pdc_peak >= FALL * BT_PDC_HIT;
    bool fallen = sweep->above < SETTLE_PDC && sweep->above * FALL < release->pdc_peak;
    return sweep->still_sweeps >= SETTLE_SWEEPS && pressed && fallen;
}

uint8_t bt_release_judge(bt_release *release, const bt_release_sweep *sweep)
{
    // A word that was lost now is no reason to do without those of the other rounds.
    bool pressure = release->pressure_seen;
    uint32_t energy = sweep->energy_count2;
    release->energy_peak = energy > release->energy_peak ? energy : release->energy_peak;
    // Without pressure the energy itself must have fallen, or the first second of a slow load would
    // pass for a residue.
    bool quiet = pressure ? sweep->above < PDC_QUIET : energy < release->energy_peak / FALL;
    release->quiet_sweeps =
        quiet ? (uint8_t)(release->quiet_sweeps + (release->quiet_sweeps < UINT8_MAX)) : 0;
    if (energy < CALM_ENERGY && (quiet || !pressure)) {
        return BT_TARE_REASON_RELEASE;
    }
    bool residue = release->quiet_sweeps >= RESIDUE_SWEEPS && sweep->still_sweeps >= RESIDUE_SWEEPS
                   && energy < residue_limit(release, sweep->contact_rounds);
    return residue || (pressure && settled(release, sweep)) ? BT_TARE_REASON_RESIDUE : BT_TARE_REASON_NONE;
}
