// Slot sampling of one to five sensors, driven by one timer alarm.
//
// A slot: all chip selects low, sample command to every sensor at once, chip selects high; at least 50 us
// later each sensor is read with one chip select low. The core does not spin through the 50 us, and only
// begins and ends a slot that the board's hardware can do whole. Words go to the main loop undecoded through
// a single-producer, single-consumer ring. When the main loop is late, whole slots are lost and counted, and
// their channels are missing from the frame. A word belongs to the finger with the low chip select, whatever
// its neighbours answered.
#ifndef BIOTAC_SAMPLER_H
#define BIOTAC_SAMPLER_H

#include "properties.h"
#include "wire/sensor_gen.h"

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#define BT_SLOT_RING 128 // a power of two; 128 slots are 29 ms of main loop delay

typedef struct {
    uint32_t round; // number since start
    uint32_t t_us;  // time of the sample command
    uint8_t slot;
    uint8_t asked;   // bit mask of fingers not sampled in this round: one is asked for a serial number
    uint8_t queried; // the one
    uint16_t word[BT_MAX_FINGERS];
} bt_slot;

typedef struct {
    bt_port *port;
    uint8_t fingers; // bit mask of the sensors that are read
    bool commanded;  // the command is out, the reads are due
    bool by_itself;  // hardware does the slot under way (port_spi_slot_begin)
    bool by_core;    // hardware never does one
    uint8_t late_in_a_row;
    bt_slot current;
    uint32_t slot_start_us;
    uint32_t fraction;  // of slot_start_us, in 1/BT_SLOT_HZ us
    atomic_uchar ask;   // fingers to ask; set by the main loop when 0, cleared by the interrupt
    uint32_t ask_round; // from this round on; written before ask
    bt_slot ring[BT_SLOT_RING];
    atomic_uchar head;                     // written by the interrupt only
    atomic_uchar tail;                     // written by the main loop only
    _Atomic uint32_t late;                 // slots lost
    _Atomic uint32_t dma_late;             // slots lost because hardware was late with a word
    bt_serial_query query[BT_MAX_FINGERS]; // of the fingers asked last; whole after their round
} bt_sampler;

// The first slot begins at start_us; query, the known sensors, stays. The caller arms the alarm for start_us.
// by_core: word by word.
void bt_sampler_start(bt_sampler *sampler, bt_port *port, uint8_t fingers, uint32_t start_us, bool by_core);

// Interrupt context: do the work due. Returns the time of the next call; `commanded` is false after a slot.
uint32_t bt_sampler_alarm(bt_sampler *sampler);

// Main loop: ask these fingers for serial numbers instead of sampling them, for one whole round: the given
// one or the first after it; with a select held, no finger is sampled. The answers are in query after that
// round's slots. Returns false if an earlier request is still pending.
bool bt_sampler_ask(bt_sampler *sampler, uint8_t fingers, uint32_t round);

// Main loop: pop the oldest slot. False when there is none.
bool bt_sampler_pop(bt_sampler *sampler, bt_slot *slot);

#endif
