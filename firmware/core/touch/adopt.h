// What changes the tare: a new one is adopted, in place of one that may prove wrong or for the first time;
// and what the trigger compares with goes with it. Called by the rounds (tare.c), the verdicts (judge.c) and
// what follows drift (follow.c).
#ifndef BIOTAC_ADOPT_H
#define BIOTAC_ADOPT_H

#include "touch/machine.h"

// What the trigger compares with: in doubt where the signals came to rest, else the tare.
static inline const bt_baseline *bt_adopt_trigger_base(const bt_tare *tare)
{
    return tare->state == BT_TARE_STATE_DOUBT ? &tare->watch.base : &tare->base;
}

static inline void bt_adopt_aim_electrode(bt_tare *tare, unsigned i)
{
    uint32_t base_q16 = bt_adopt_trigger_base(tare)->electrode_q16[i];
    if (base_q16 != BT_TARE_UNKNOWN && !(tare->trigger.unknown >> i & 1)) {
        tare->trigger.rest.lane[i] = (uint16_t)bt_baseline_count(base_q16);
    }
}

// An electrode's baseline has changed: it is subtracted from now on.
static inline void bt_adopt_electrode(bt_tare *tare, unsigned i)
{
    tare->electrode_q4[i] = bt_tare_q4(tare->base.electrode_q16[i]);
    bt_adopt_aim_electrode(tare, i);
}

// The trigger compares with another baseline.
void bt_adopt_aim(bt_tare *tare);
void bt_adopt_aim_pressure(bt_tare *tare);

// The host's word, or what the machine did.
void bt_adopt_tell(bt_tare *tare, uint8_t reason);

void bt_adopt(bt_tare *tare, const bt_baseline *base, uint8_t state, uint8_t reason);

// In place of a tare that may prove wrong.
void bt_adopt_in_place(bt_tare *tare, const bt_baseline *base, uint8_t reason);

// What the means of the latest sweep are.
void bt_adopt_present(bt_tare *tare, uint8_t reason);

// The same after a press: pressure that undershoots comes back, which must not look like a touch.
void bt_adopt_after_press(bt_tare *tare, uint8_t reason);

// Pressure as it is, and every electrode by what all have moved: what is left of a pattern stays.
void bt_adopt_shift(bt_tare *tare);

// The tare stays; the trigger looks at where the signals came to rest, or at the tare again.
void bt_adopt_doubt(bt_tare *tare);
void bt_adopt_contact(bt_tare *tare);

// The tare proved wrong, and there is no other.
void bt_adopt_none(bt_tare *tare);

// Channels whose first word has come.
void bt_adopt_met(bt_tare *tare);

#endif
