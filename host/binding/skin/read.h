// From instants to the 44 words of each round of a simulated finger: slot times, noise, drift, creep, and the
// channels besides the electrodes. host/docs/reference/sensor_model.md has the formulas.
#ifndef BIOTAC_READ_H
#define BIOTAC_READ_H

#include "skin/effects.h"
#include "skin/ringing.h"

// The constants of sampling.py, by name: counts, seconds, Hz.
typedef struct {
    double creep_s, pdc_noise, pdc_undershoot, pdc_undershoot_at, pdc_undershoot_s, pdc_creep_share,
        pdc_creep_s;
    double tac_rest, tac_noise, tdc_noise, pac_rest, pac_noise, pac_high_pass_hz, pac_per_pdc;
} bt_sampling;

// Random numbers of so many rounds, drawn ahead; reading goes through them. All but those of glitches and
// slips, which are of 0 to 1, are normal.
typedef struct {
    const double *electrodes, *slow, *pac; // rows of 19, of 3 (PDC, TAC, TDC), of 22
    const double *glitches, *slips;        // rows of 19 and of 22 pairs
    int64_t rounds, next;
} bt_drawn;

// A lag of the first order: the value that lasts from round to round, and the value at the last boundary.
typedef struct {
    double keep, value;
} bt_lag;

// The state from round to round. Zeroed, and without ringing, it is at rest.
typedef struct {
    bt_ringing *ringing;
    int64_t round;
    bt_lag creep[BT_ELECTRODES], undershoot, pressure_creep;
    double ramp; // the remainder of the high-pass's answers to earlier ramps
    uint8_t glitched[BT_ELECTRODES];
    bt_effects before; // at the last boundary
} bt_reader;

// The instant at which the first round begins. Without it, that is like the first piece's end.
void bt_begin(bt_reader *reader, const bt_sampling *sampling, const bt_effects *effects);

// Reads the words (44 each) of up to n rounds of so many equal pieces, and returns how many: no more than
// there is noise for. effects: at the end of each piece; a round's begin ``stride`` after those of the round
// before.
int64_t bt_read(bt_reader *reader, const bt_sampling *sampling, const bt_skin_finger *finger, int64_t n,
                int32_t pieces, const bt_effects *effects, int64_t stride, bt_drawn *noise, uint16_t *words);

#endif
