// The simulated board: the gateway app over emulated sensors on an emulated bus (firmware/emu), with a clock
// that the caller advances. Same words in, same bytes out.
//
// Device time passes only as the firmware spends it. Reading an unpaced board computes the bytes that are
// read; time stands still otherwise, and where the sensors' next round has not come. A paced one has a thread
// in bt_sim_serve, which holds device time against this computer's clock, without Python's lock.
#ifndef BIOTAC_SIM_BOARD_H
#define BIOTAC_SIM_BOARD_H

#include "map/store.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct bt_sim bt_sim;

enum {
    BT_SIM_FLASH_BYTES = BT_KEPT_BYTES,
    BT_SIM_OUTBOX_BYTES = 1 << 18, // a round of five fingers with everything, some 200 times
};

// The parts of a board. flash: BT_SIM_FLASH_BYTES, erased or from another board. tape: words
// [rounds][44][fingers], counts or an enum bt_emu_fault; NULL: they come by bt_sim_step, round by round. Both
// outlive the board. serials: one a finger, separated by commas; an empty one is replaced. pace: device
// seconds per second; 0: as fast as it is read, and nothing is dropped.
typedef struct {
    uint8_t *flash;
    const uint16_t *tape;
    uint32_t rounds;
    uint8_t fingers;
    const char *serials;
    uint32_t boot_id;  // one more after each restart
    uint32_t clock_us; // the board's clock at first, as of a board that has been on for so long
    double pace;
} bt_sim_facts;

// It boots, and device time stands still until bt_sim_release. NULL without memory.
bt_sim *bt_sim_new(const bt_sim_facts *facts);
void bt_sim_free(bt_sim *sim); // all other calls have returned

void bt_sim_release(bt_sim *sim);

// A reset: words that were not sampled are lost. Saved settings stay.
void bt_sim_restart(bt_sim *sim);

// Plug the host's cable in or out: bytes under way are lost, and so is all output without a host.
void bt_sim_plug(bt_sim *sim, bool up);

// The host's bytes: returns how many there was room for. Reading waits up to timeout_s for some, or until the
// tape has been played and all of it read: ended, which the caller passes in again each time.
size_t bt_sim_write(bt_sim *sim, const uint8_t *data, size_t bytes);
size_t bt_sim_read(bt_sim *sim, uint8_t *data, size_t bytes, double timeout_s, bool *ended);

// Whether the tape has been played.
bool bt_sim_over(bt_sim *sim);

// Wait up to timeout_s for something to read, or for bytes of the host that are not yet heard.
void bt_sim_await(bt_sim *sim, double timeout_s);

// Give the sensors the next rounds, [rounds][44][fingers] little-endian and at most 50, compute them, and
// read the board's output. Returns how many bytes; where `bytes` is not enough, calls without rounds give the
// others.
size_t bt_sim_step(bt_sim *sim, const uint8_t *words, uint32_t rounds, uint8_t *data, size_t bytes);

// The same for a board that another thread reads; waits up to timeout_s for that. True once all is computed.
bool bt_sim_put(bt_sim *sim, const uint8_t *words, uint32_t rounds, double timeout_s);

// Of a paced board: compute until bt_sim_end, on the calling thread.
void bt_sim_serve(bt_sim *sim);

// Makes a wait in bt_sim_read or bt_sim_await return: the present one, or else the next.
void bt_sim_wake(bt_sim *sim);

// Makes all waits in these return, now and from now on.
void bt_sim_end(bt_sim *sim);

#endif
