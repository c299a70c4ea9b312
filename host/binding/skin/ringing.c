#include "skin/ringing.h"

#include <math.h>
#include <string.h>

enum { KEPT = BT_RING_SAMPLES - 1 };

static double sign(double value)
{
    return (double)((value > 0) - (value < 0));
}

// Adds the effect of a blow, at a sample of the round or before it, to the round's samples.
static void add(const bt_ringing *ringing, int at, double blow, double *counts)
{
    for (int t = at < 0 ? 0 : at; t < BT_PAC_PER_FRAME && t - at < BT_RING_SAMPLES; t++) {
        counts[t] += blow * ringing->ring[t - at];
    }
}

void bt_ring(bt_ringing *ringing, int64_t n, const double *speed_mm_s, const double *draws, double *counts)
{
    double *blow = ringing->blow + KEPT; // the round's
    for (int64_t k = 0; k < n; k++, counts += BT_PAC_PER_FRAME) {
        const double slips = speed_mm_s[k] / ringing->drawn_mm / ringing->pac_hz;
        const uint8_t slides = speed_mm_s[k] > 0;
        for (int t = 0; t < BT_PAC_PER_FRAME; t++, draws += 2) {
            double sway = 2 * draws[1] - 1, size = draws[0] < slips ? sqrt(fabs(sway)) : 0;
            if (t == 0 && slides && !ringing->slid) {
                size = 1; // skin that begins to slide lets go at once
            }
            blow[t] = ringing->amplitude_counts * sign(sway) * size;
        }
        ringing->slid = slides;
        memset(counts, 0, BT_PAC_PER_FRAME * sizeof *counts);
        for (int at = -KEPT; at < BT_PAC_PER_FRAME; at++) {
            if (blow[at] != 0) {
                add(ringing, at, blow[at], counts);
            }
        }
        memmove(ringing->blow, ringing->blow + BT_PAC_PER_FRAME, KEPT * sizeof *blow);
    }
}
