#include "signal/gate.h"

#include <string.h>

_Static_assert(BT_LANES % 2 == 0 && sizeof(bt_lanes) == BT_LANES * sizeof(uint16_t), "lanes go in pairs");
_Static_assert(BT_LANES <= 32, "lanes are bits of a word");
_Static_assert(BT_FULL_SCALE_COUNT + BT_GATE_FAR < BT_GATE_UNREAD, "a first word must be far");
_Static_assert(BT_ELECTRODES * BT_FULL_SCALE_COUNT * BT_FULL_SCALE_COUNT < BT_GATE_NEVER,
               "no round's energy reaches BT_GATE_NEVER");
_Static_assert(BT_SETTING_CONTACT_ENERGY_COUNT2_MAX * 4LL < BT_GATE_NEVER, "a limit leaves room below zero");

void bt_gate_reset(bt_gate *gate)
{
    memset(gate, 0, sizeof *gate);
    gate->unknown = (1u << BT_LANES) - 1;
    for (unsigned i = 0; i < BT_LANES; i++) {
        gate->smooth.lane[i] = BT_GATE_UNREAD;
        gate->rest.lane[i] = BT_GATE_UNREAD;
    }
    bt_gate_begin(gate, BT_GATE_NEVER);
}

int32_t bt_gate_repeat(bt_gate *gate, unsigned electrode, uint16_t count)
{
    gate->missing = (uint8_t)(gate->missing + (count == BT_INVALID_COUNT));
    gate->railed = (uint8_t)(gate->railed + bt_count_railed(count));
    // A glitch, a gap and a glitch are no touch: what was held back before a gap is forgotten.
    int32_t e = (int32_t)gate->smooth.lane[electrode] - gate->rest.lane[electrode];
    return gate->room -= e * e;
}

uint16_t bt_gate_far(bt_gate *gate, unsigned lane, uint16_t count)
{
    uint32_t bit = 1u << lane;
    if (gate->unknown & bit) {
        gate->unknown &= ~bit;
        gate->met |= bit;
        gate->rest.lane[lane] = count;
        return count;
    }
    gate->far |= bit;
    return gate->far_before & bit ? count : gate->smooth.lane[lane];
}

int32_t bt_gate_pressure(bt_gate *gate, uint16_t count, int32_t above)
{
    gate->pressure_now = bt_count_usable(count);
    if (gate->pressure_now) {
        uint16_t smooth = bt_gate_filter(gate, BT_LANE_PDC, count, gate->smooth.lane[BT_LANE_PDC]);
        uint16_t rest = gate->rest.lane[BT_LANE_PDC];
        if (rest != 0 && smooth - rest > above && gate->room >= 0 && gate->limit != BT_GATE_NEVER) {
            // Both move, so that the energy stays what it is.
            gate->limit -= BT_GATE_NEVER;
            gate->room -= BT_GATE_NEVER;
        }
    }
    return gate->room;
}
