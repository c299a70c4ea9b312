// The flags of a round that no result is needed for, and what its force is good for.
#ifndef BIOTAC_FLAGS_H
#define BIOTAC_FLAGS_H

#include "signal/round.h"
#include "touch/tare.h"

uint32_t bt_channel_flags(const bt_round *round, const bt_tare *tare);

// An enum bt_trust: the lowest level that a flag allows (trust in protocol/link.toml); without such a flag,
// INTERVAL if the normal force's interval is wide or unknown. half_mn: half of it.
uint8_t bt_trust(uint32_t flags, uint16_t normal_mn, uint16_t half_mn);

#endif
