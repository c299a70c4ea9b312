// Changes of the tare: a new one is adopted, for the first time or in place of another, and the trigger's
// reference is updated. Called by the rounds (tare.c), the verdicts (judge.c) and drift tracking (follow.c).
#ifndef BIOTAC_ADOPT_H
#define BIOTAC_ADOPT_H

#include "touch/machine.h"

// The trigger's reference: in DOUBT the place where the signals came to rest, else the tare.
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

// An electrode's baseline has changed: subtract the new one from now on.
static inline void bt_adopt_electrode(bt_tare *tare, unsigned i)
{
    tare->electrode_q4[i] = bt_tare_q4(tare->base.electrode_q16[i]);
    bt_adopt_aim_electrode(tare, i);
}

// Update the trigger's reference.
void bt_adopt_aim(bt_tare *tare);
void bt_adopt_aim_pressure(bt_tare *tare);

// Report a change by the host or the machine, with the reason.
void bt_adopt_report(bt_tare *tare, uint8_t reason);

void bt_adopt(bt_tare *tare, const bt_baseline *base, uint8_t state, uint8_t reason);

// Adopt the means of the latest sweep.
void bt_adopt_present(bt_tare *tare, uint8_t reason);

// The same after a press. Pressure that undershoots comes back, which must not look like a touch.
void bt_adopt_after_press(bt_tare *tare, uint8_t reason);

// Adopt pressure as it is, and shift every electrode by the mean move of all: the rest of a pattern stays.
void bt_adopt_shift(bt_tare *tare);

// Enter DOUBT or CONTACT. The tare stays; the trigger's reference is the place where the signals came to
// rest, or the tare again.
void bt_adopt_doubt(bt_tare *tare);
void bt_adopt_contact(bt_tare *tare);

// Drop the tare, which proved wrong; there is no other.
void bt_discard_tare(bt_tare *tare);

// Adopt channels with a first word.
void bt_adopt_first_words(bt_tare *tare);

#endif
