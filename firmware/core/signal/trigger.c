#include "signal/trigger.h"

#include "wire/touch_gen.h"

#include <string.h>

_Static_assert(BT_LANES % 2 == 0 && sizeof(bt_lanes) == BT_LANES * sizeof(uint16_t), "lanes go in pairs");
_Static_assert(BT_LANES <= 32, "lanes are bits of a word");
_Static_assert(BT_FULL_SCALE_COUNT + BT_TRIGGER_FAR < BT_TRIGGER_UNREAD, "a first word must be far");
_Static_assert(BT_ELECTRODES * BT_FULL_SCALE_COUNT * BT_FULL_SCALE_COUNT < BT_TRIGGER_NEVER,
               "no round's energy reaches BT_TRIGGER_NEVER");
_Static_assert(BT_SETTING_CONTACT_ENERGY_COUNT2_MAX * 4LL < BT_TRIGGER_NEVER,
               "a limit leaves room below zero");

void bt_trigger_reset(bt_trigger *trigger)
{
    memset(trigger, 0, sizeof *trigger);
    trigger->unknown = (1u << BT_LANES) - 1;
    for (unsigned i = 0; i < BT_LANES; i++) {
        trigger->smooth.lane[i] = BT_TRIGGER_UNREAD;
        trigger->rest.lane[i] = BT_TRIGGER_UNREAD;
    }
    bt_trigger_leave_out(trigger, 0);
    bt_trigger_begin(trigger, BT_TRIGGER_NEVER);
}

void bt_trigger_leave_out(bt_trigger *trigger, uint32_t electrodes)
{
    for (unsigned i = 0; electrodes >> i != 0; i++) {
        if (electrodes >> i & 1) { // as if at rest: the last word is no touch
            trigger->smooth.lane[i] = trigger->rest.lane[i];
        }
    }
    trigger->out = electrodes;
    trigger->usable = electrodes == 0 ? BT_RAIL_COUNT - 2 : 0;
}

static bool pressed(const bt_trigger *trigger)
{
    const uint16_t rest = trigger->rest.lane[BT_LANE_PDC];
    return rest != 0 && trigger->smooth.lane[BT_LANE_PDC] - rest > BT_PDC_HIT;
}

int32_t bt_trigger_doubt(bt_trigger *trigger, unsigned electrode, uint16_t count)
{
    const uint32_t bit = 1u << electrode;
    const bt_lanes *from = trigger->limit == BT_TRIGGER_NEVER ? &trigger->smooth : &trigger->rest;
    uint16_t *smooth = &trigger->smooth.lane[electrode], rest = trigger->rest.lane[electrode];
    // Compressed, near the low rail. A leap to the rail is a press if something presses, else an open lead.
    const bool near = *smooth <= BT_TRIGGER_FAR && rest - *smooth > BT_TRIGGER_FAR;
    const bool squeezed = count <= BT_TRIGGER_BOUND && pressed(trigger);
    if (trigger->out & bit) {
        trigger->without |= bit;
    } else if (squeezed && near) {
        trigger->odd |= bit;
        *smooth = BT_TRIGGER_BOUND;
    } else if (bt_count_usable(count)) {
        (void)bt_trigger_filter(trigger, electrode, count, from->lane[electrode]);
    } else {
        trigger->without |= bit;
        // A gap clears the word held back: a glitch before it and one after are no touch. A press to the rail
        // is no gap.
        trigger->far |= squeezed ? trigger->far_before & bit : 0;
        if (near && count == 0 && !squeezed) { // opened while a bound: as if at rest
            *smooth = rest;
        }
    }
    trigger->odd |= trigger->without;
    int32_t e = (int32_t)trigger->smooth.lane[electrode] - trigger->rest.lane[electrode];
    return trigger->room -= e * e;
}

uint16_t bt_trigger_far(bt_trigger *trigger, unsigned lane, uint16_t count)
{
    uint32_t bit = 1u << lane;
    if (trigger->unknown & bit) {
        trigger->unknown &= ~bit;
        trigger->first_words |= bit;
        trigger->rest.lane[lane] = count;
        return count;
    }
    trigger->far |= bit;
    int jump = count - trigger->smooth.lane[lane];
    if (jump > BT_TRIGGER_JUMP) {
        trigger->up |= bit;
    } else if (jump < -BT_TRIGGER_JUMP) {
        trigger->down |= bit;
    }
    trigger->leapt |= jump > BT_TRIGGER_LEAP || jump < -BT_TRIGGER_LEAP ? bit : 0;
    return trigger->far_before & bit ? count : trigger->smooth.lane[lane];
}

int32_t bt_trigger_pressure(bt_trigger *trigger, uint16_t count, int32_t above)
{
    trigger->pressure_now = bt_count_usable(count);
    if (trigger->pressure_now) {
        uint16_t smooth = bt_trigger_filter(trigger, BT_LANE_PDC, count, trigger->smooth.lane[BT_LANE_PDC]);
        uint16_t rest = trigger->rest.lane[BT_LANE_PDC];
        if (rest != 0 && smooth - rest > above && trigger->room >= 0 && trigger->limit != BT_TRIGGER_NEVER) {
            // Both change, so that the energy stays the same.
            trigger->limit -= BT_TRIGGER_NEVER;
            trigger->room -= BT_TRIGGER_NEVER;
        }
    }
    return trigger->room;
}
