// A round: the words of one finger in 44 slots, with validity per channel. A channel without a good word in
// this round's slot is BT_INVALID_COUNT, never an older value. Units: counts 0..4095; t_us is device time,
// wraps at 2^32.
#ifndef BIOTAC_ROUND_H
#define BIOTAC_ROUND_H

#include "wire/messages_gen.h"
#include "wire/sensor_gen.h"

#include <stdbool.h>
#include <stdint.h>

typedef struct {
    uint32_t t_us; // time of slot 0, lost or sampled
    uint16_t electrode[BT_ELECTRODES];
    uint16_t pdc;
    uint16_t tac;
    uint16_t tdc;
    uint16_t pac[BT_PAC_PER_FRAME];
    uint8_t good_words; // 0: nothing answered
} bt_round;

#define BT_ALL_ELECTRODES ((1u << BT_ELECTRODES) - 1)

void bt_round_clear(bt_round *round);

#define BT_RAIL_COUNT 4090 // readings from this count on, and 0, are at a rail

#ifndef BT_CDEF // called for every electrode in every round, hence inline
// Neither missing nor railed (shorted or open). One comparison: 0 wraps to the top.
static inline bool bt_count_usable(uint16_t count)
{
    return (uint32_t)count - 1 < BT_RAIL_COUNT - 1;
}

static inline bool bt_count_railed(uint16_t count)
{
    return !bt_count_usable(count) && count != BT_INVALID_COUNT;
}
#endif

#ifndef BT_CDEF
// Results can do without two electrodes of the mask; without more, the round is faulty.
static inline bool bt_usable_without(uint32_t electrodes)
{
    electrodes &= electrodes - 1;
    return (electrodes & (electrodes - 1)) == 0;
}
#endif

#endif
