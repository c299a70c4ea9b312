#include "numbering.h"

#include <string.h>

static int64_t nearest(int64_t raw, int64_t near, int64_t half)
{
    return near + ((raw - near + half) & (2 * half - 1)) - half;
}

void bt_numbering_reset(bt_numbering *numbering)
{
    memset(numbering, 0, sizeof *numbering);
}

void bt_numbering_rejoin(bt_numbering *numbering)
{
    memset(numbering->joined, 0, sizeof numbering->joined);
}

int64_t bt_number(bt_numbering *numbering, uint8_t finger, uint16_t seq, uint16_t rounds, bt_gap *gap)
{
    int64_t before = numbering->seen[finger] ? numbering->last[finger] : seq;
    int64_t number = nearest(seq, before, 1 << 15);
    int64_t missing = numbering->joined[finger] ? number - rounds - before : 0;
    if (missing > 0) {
        numbering->lost += missing;
    } else if (missing < 0) {
        numbering->disordered++;
        missing = 0;
    }
    if (gap != NULL) {
        *gap = (bt_gap){finger, before, missing};
    }
    numbering->last[finger] = number;
    numbering->seen[finger] = numbering->joined[finger] = 1;
    return number;
}

int64_t bt_unwrapped(const bt_unwrapper *unwrapper, uint32_t raw)
{
    return unwrapper->seen ? nearest(raw, unwrapper->last, INT64_C(1) << 31) : raw;
}

int64_t bt_unwrap(bt_unwrapper *unwrapper, uint32_t raw)
{
    unwrapper->last = bt_unwrapped(unwrapper, raw);
    unwrapper->seen = 1;
    return unwrapper->last;
}
