// Counters of the wire as int64: wraps undone, gaps found.
#ifndef BIOTAC_NUMBERING_H
#define BIOTAC_NUMBERING_H

#include <stdint.h>

#define BT_FINGERS_ON_WIRE 256 // values of a message's finger byte, sensible or not

// Sequence numbers of one kind of message, 16 bits on the wire, each finger for itself.
typedef struct {
    int64_t lost;                        // made, by the numbers, and never came
    int64_t disordered;                  // numbers that repeat or step back
    int64_t last[BT_FINGERS_ON_WIRE];    // unwrapped
    int64_t unheard[BT_FINGERS_ON_WIRE]; // bt_number's at that time
    uint64_t recent[BT_FINGERS_ON_WIRE]; // bit k: last - k came, or is from before this numbering joined
    uint8_t seen[BT_FINGERS_ON_WIRE];    // last has a value
    uint8_t joined[BT_FINGERS_ON_WIRE];  // the next number is expected to follow the last
} bt_numbering;

// Of ``finger``, ``missing`` messages after number ``before``.
typedef struct {
    int64_t finger;
    int64_t before;
    int64_t missing;
} bt_gap;

// A 32-bit clock.
typedef struct {
    int64_t last;
    uint8_t seen;
} bt_unwrapper;

void bt_numbering_reset(bt_numbering *numbering);

// Makes the next number of each finger count as no loss.
void bt_numbering_rejoin(bt_numbering *numbering);

// Returns ``seq`` unwrapped, the nearest to the expected number of this finger. The message stands for
// ``rounds`` numbers up to this one. ``unheard``: for how many rounds, in all, device time went on with no
// message of any finger; seq itself wraps every 65 536 rounds, 11 min. gap->missing is 0 when there is none;
// NULL where no gap is wanted.
int64_t bt_number(bt_numbering *numbering, uint8_t finger, uint16_t seq, uint16_t rounds, int64_t unheard,
                  bt_gap *gap);

// A clock goes forward, over the wrap after 71.6 min, too; a message is at most this much older than the
// last.
#define BT_CLOCK_BACK_US (INT64_C(1) << 26)

// The value that a clock shows as ``raw``.
int64_t bt_unwrapped(const bt_unwrapper *unwrapper, uint32_t raw);

// The same, and it is the last from now on.
int64_t bt_unwrap(bt_unwrapper *unwrapper, uint32_t raw);

#endif
