// Has a contact ended? Judged after each sweep of eight rounds, on the strongest moment of the contact and
// on what the signals are now.
//
// Units: counts; pressure above its tare in whole counts; energies in count^2 over all electrodes.
#ifndef BIOTAC_RELEASE_H
#define BIOTAC_RELEASE_H

#include <stdbool.h>
#include <stdint.h>

#define BT_PDC_HIT 6 // pressure above rest that is a contact

// Of the present contact.
typedef struct {
    uint32_t energy_peak;
    int32_t pdc_peak;
    uint8_t quiet_sweeps; // in a row, with the pressure (without one: the energy) back
    bool pressure_seen;   // in this sweep at least one pressure word was good
} bt_release;

// What a sweep has shown.
typedef struct {
    uint32_t energy_count2; // of the means from the tare
    uint32_t contact_rounds;
    int32_t above; // pressure over its tare: what it is now or its mean of eight rounds, whichever is more
    uint8_t still_sweeps;
} bt_release_sweep;

void bt_release_begin(bt_release *release);

// A round in contact with a good pressure word.
void bt_release_pressure(bt_release *release, int32_t above);

// BT_TARE_REASON_RELEASE or _RESIDUE, or _NONE while the contact goes on.
uint8_t bt_release_judge(bt_release *release, const bt_release_sweep *sweep);

#endif
