// Slot sampling of one to five sensors, driven by one timer alarm.
//
// A slot: all chip selects low, sample command to every sensor at once, chip selects high; at least 50 us
// later each sensor is read by its own chip select. The core does not spin through the 50 us, and where the
// board's hardware does the whole slot, the core only begins and ends it. Words go to the main loop undecoded
// through a single-producer, single-consumer ring. When the main loop is late, whole slots are lost and
// counted, and their channels are missing from the frame. A word belongs to the finger whose chip select was
// low, whatever its neighbours answered.
#ifndef BIOTAC_SAMPLER_H
#define BIOTAC_SAMPLER_H

#include "properties.h"
#include "wire/sensor_gen.h"

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#define BT_SLOT_RING 128 // a power of two; 128 slots are 29 ms of main loop delay

typedef struct {
    uint32_t round; // its number since start
    uint32_t t_us;  // when the sample command was sent
    uint8_t slot;
    uint8_t asked;   // bit mask of fingers not sampled in this round: one is asked for its serial number
    uint8_t queried; // the one
    uint16_t word[BT_MAX_FINGERS];
} bt_slot;

typedef struct {
    bt_port *port;
    uint8_t fingers; // bit mask of the sensors that are read
    bool commanded;  // the command is out, the reads are due
    bool by_itself;  // hardware does the slot under way (port_spi_slot_begin)
    bool by_core;    // it never does
    uint8_t late_in_a_row;
    bt_slot current;
    uint32_t slot_start_us;
    uint32_t fraction;  // of slot_start_us, in 1/BT_SLOT_HZ us
    atomic_uchar ask;   // fingers to ask; set by the main loop when 0, taken by the interrupt
    uint32_t ask_round; // from this round on; written before ask
    bt_slot ring[BT_SLOT_RING];
    atomic_uchar head;                     // written by the interrupt only
    atomic_uchar tail;                     // written by the main loop only
    _Atomic uint32_t late;                 // slots lost
    _Atomic uint32_t dma_late;             // slots lost because hardware was late with a word
    bt_serial_query query[BT_MAX_FINGERS]; // of the fingers asked last; whole once their round is
} bt_sampler;

// The first slot begins at start_us; what query knows of the sensors stays. The caller arms the alarm for
// start_us. by_core: word by word.
void bt_sampler_start(bt_sampler *sampler, bt_port *port, uint8_t fingers, uint32_t start_us, bool by_core);

// Interrupt context: do what is due. Returns when to be called next; `commanded` is false when a slot is
// over.
uint32_t bt_sampler_alarm(bt_sampler *sampler);

// Main loop: ask these fingers for their serial numbers instead of sampling them, for one whole round: the
// given one or the first after it; none is sampled if one is asked with its select held. Their answers are in
// query once that round's slots have come. Returns false if an earlier request is still pending.
bool bt_sampler_ask(bt_sampler *sampler, uint8_t fingers, uint32_t round);

// Main loop: take the oldest slot. False when there is none.
bool bt_sampler_pop(bt_sampler *sampler, bt_slot *slot);

#endif
