// Has a contact ended? Judged after each sweep of eight rounds, by the peaks since the tare was taken and by
// what the signals are now.
//
// What a press leaves in the skin looks like a light hold: size, pattern and stillness do not tell them
// apart. Pressure above the last tare does. Where it does not either, the answer is DOUBT.
//
// Units: counts; pressure above its tare in whole counts; energies in count^2 over all electrodes.
#ifndef BIOTAC_RELEASE_H
#define BIOTAC_RELEASE_H

#include "wire/touch_gen.h"

#include <stdbool.h>
#include <stdint.h>

typedef enum {
    BT_RELEASE_NO,      // the contact goes on
    BT_RELEASE_CLEAN,   // back at the tare
    BT_RELEASE_RESIDUE, // ended; the present signals are the new tare
    BT_RELEASE_SHIFT,   // no touch: only pressure has moved, or all electrodes alike
    BT_RELEASE_DOUBT,   // still: a light hold or a residue
} bt_release_verdict;

// Does this finger's pressure show presses? Where fluid has leaked, or a bubble is in it, it answers but
// hardly moves. Unproven until a press has moved it; then the latest firm press counts.
typedef struct {
    bool moves;
    bool flat;
    uint8_t silent; // sweeps in a row with an unfelt press; all of them: until electrodes feel one
} bt_witness;

// Since the tare was taken; all 0 then.
typedef struct {
    uint32_t energy_peak;
    uint32_t uneven_peak;
    int32_t pdc_peak;
    int32_t pdc_low;       // 0 or less
    uint8_t quiet_sweeps;  // consecutive sweeps with pressure (if there is none: energy) back at rest
    uint8_t even_sweeps;   // consecutive sweeps with only a shift of all electrodes and no rise of pressure
    int32_t even_above;    // pressure when those began
    int32_t slow_above;    // pressure, low-passed
    int32_t cold_then;     // what cooling may have taken when it was let go
    int32_t above;         // pressure, in this round
    int32_t lesser;        // in this round or the one before
    uint8_t same_rounds;   // consecutive rounds with the same pressure; saturates
    bool found;            // pressure was there as soon as the tare: an earlier press may have left it
    uint8_t unfelt_rounds; // with an unfelt press, until one is felt; saturates
    bool deaf;             // the means of the latest sweep feel next to nothing of a press
} bt_release;

// What a sweep showed.
typedef struct {
    uint32_t energy_count2;   // of means minus tare
    uint32_t uneven_count2;   // the same without what all electrodes share
    uint32_t forgiven_count2; // of that, what drift and temperature may have made
    bool pressure;            // at least one pressure word was good
    bool witness;             // and presses move it; set by bt_release_judge
    bool warmer;              // by half a degree: pressure may have risen by a quarter of the lightest press
    int32_t pressed;          // counts of pressure that a press must have made
    int32_t above;            // pressure above its tare: now or the mean of eight rounds, whichever is more
    int32_t cold;             // counts that cooling may have taken from it since the tare was taken
    int32_t uncooled; // above, with what cooling may hide of a press; set by bt_release_judge, 0: unknown
    uint8_t still_sweeps;
    uint8_t level_sweeps; // with level pressure
} bt_release_sweep;

// Add a round in contact with a good pressure word.
void bt_release_pressure(bt_release *release, int32_t above);

// Counts of that which a press must have made, of which `warmed` may be warmth; 0 if electrodes need not feel
// them.
int32_t bt_release_pressed(const bt_release *release, int32_t above, int32_t warmed);

// Add a round in which the electrodes have this energy; noise makes at most so much.
void bt_release_felt(bt_release *release, int32_t pressed, uint32_t energy_count2, uint32_t noise_count2);

bt_release_verdict bt_release_judge(bt_release *release, bt_witness *witness, bt_release_sweep *sweep);

#ifndef BT_CDEF
static inline bool bt_witness_silent(const bt_witness *witness)
{
    return witness->silent == BT_SILENT_SWEEPS;
}

static inline bool bt_release_pending(const bt_release *release)
{
    return release->deaf || release->unfelt_rounds == BT_UNFELT_ROUNDS;
}
#endif

// The most that real skin leaves the pressure low by after a press.
#ifndef BT_CDEF
static inline int32_t bt_pdc_missing_max(int32_t pdc_peak)
{
    return BT_MISSING_PDC + pdc_peak / BT_MISSING_SHARE;
}
#endif

#endif
