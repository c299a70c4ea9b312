// Was the tare wrong? Skin is pressed, never pulled. If pressure is well below rest and the signals are those
// of a load upside down, the finger was tared while something touched it.
//
// Units: counts; energies in count^2 over all electrodes.
#ifndef BIOTAC_INVERTED_H
#define BIOTAC_INVERTED_H

#include "touch/baseline.h"

// How the tare in force differs from the one before it. Drift moves both alike.
typedef struct {
    int16_t electrode_q3[BT_ELECTRODES];
    int16_t pdc_q3;
    bool known;
    uint8_t rounds; // consecutive rounds that spoke against the tare in force
} bt_tare_change;

typedef enum { BT_TARE_STANDS, BT_TARE_UNDO, BT_TARE_LOSE } bt_tare_doubt;

void bt_inverted_note(bt_tare_change *change, const bt_baseline *before, const bt_baseline *now);

// Judge a round with a good pressure word; colder: so much that pressure may have fallen. UNDO: the tare
// before this one explains the signals. LOSE: it does not, or there is none, and yet this cannot be a touch.
bt_tare_doubt bt_inverted_judge(bt_tare_change *change, const bt_lanes *smooth, const bt_baseline *base,
                                int32_t pdc_peak, bool colder);

// Put the tare before this one into base, with the drift since then.
void bt_inverted_undo(const bt_tare_change *change, bt_baseline *base);

#endif
