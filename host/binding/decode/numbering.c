#include "decode/numbering.h"

#include <string.h>

#define RECENT 64 // numbers that have a bit in bt_numbering.recent

// Of all numbers that a counter of ``bits`` bits shows as ``raw``, the first that is not below ``from``.
static int64_t first_from(int64_t from, int64_t raw, int bits)
{
    return from + ((raw - from) & ((INT64_C(1) << bits) - 1));
}

static uint64_t newest(int64_t numbers)
{
    return numbers < RECENT ? (UINT64_C(1) << numbers) - 1 : UINT64_MAX;
}

void bt_numbering_reset(bt_numbering *numbering)
{
    memset(numbering, 0, sizeof *numbering);
}

void bt_numbering_rejoin(bt_numbering *numbering)
{
    memset(numbering->joined, 0, sizeof numbering->joined);
}

// A number that is not after the last: late, so it was counted as lost, or here twice.
static void count_late(bt_numbering *numbering, uint8_t finger, int64_t behind, uint16_t rounds)
{
    uint64_t covered = behind < RECENT ? newest(rounds) << behind : 0;
    numbering->disordered++;
    for (uint64_t late = covered & ~numbering->recent[finger]; late != 0; late &= late - 1) {
        numbering->lost--;
    }
    numbering->recent[finger] |= covered;
}

int64_t bt_number(bt_numbering *numbering, uint8_t finger, uint16_t seq, uint16_t rounds, int64_t unheard,
                  bt_gap *gap)
{
    int64_t before = numbering->seen[finger] ? numbering->last[finger] : seq;
    int64_t near = before + (numbering->seen[finger] ? unheard - numbering->unheard[finger] : 0);
    int64_t number = first_from(near - (1 << 15), seq, 16);
    // Numbers that follow each other directly do so however long the silence: after so long a loss, seq shows
    // that by a chance of 2 in 65 536; where the board had no rounds meanwhile, it is certain.
    int64_t direct = first_from(before, seq, 16);
    if (numbering->seen[finger] && direct > before && direct - before <= rounds + 1) {
        number = direct;
    }
    int64_t missing = 0;
    if (gap != NULL) {
        *gap = (bt_gap){finger, before, 0};
    }
    numbering->unheard[finger] = unheard;
    if (numbering->joined[finger] && number <= before && before - number < RECENT) {
        count_late(numbering, finger, before - number, rounds);
        return number;
    }
    if (!numbering->joined[finger] || number <= before) {
        numbering->disordered += numbering->joined[finger];
        numbering->recent[finger] = UINT64_MAX; // earlier numbers do not count
    } else {
        missing = number - rounds - before;
        numbering->disordered += missing < 0;
        missing = missing > 0 ? missing : 0;
        numbering->lost += missing;
        int64_t step = number - before;
        numbering->recent[finger] =
            (step < RECENT ? numbering->recent[finger] << step : 0) | newest(step < rounds ? step : rounds);
    }
    if (gap != NULL) {
        gap->missing = missing;
    }
    numbering->last[finger] = number;
    numbering->seen[finger] = numbering->joined[finger] = 1;
    return number;
}

int64_t bt_unwrapped(const bt_unwrapper *unwrapper, uint32_t raw)
{
    return unwrapper->seen ? first_from(unwrapper->last - BT_CLOCK_BACK_US, raw, 32) : raw;
}

int64_t bt_unwrap(bt_unwrapper *unwrapper, uint32_t raw)
{
    unwrapper->last = bt_unwrapped(unwrapper, raw);
    unwrapper->seen = 1;
    return unwrapper->last;
}
