// A board of emulated sensors for any carrier of bytes: EMU commands fill a stream and add faults, and HELLO
// identifies the board (protocol/emu.toml).
#ifndef BIOTAC_SENSOR_BOARD_FEED_H
#define BIOTAC_SENSOR_BOARD_FEED_H

#include "emu_gen.h"
#include "stream.h"
#include "wire/framing.h"

typedef struct {
    bt_emu_stream *stream;
    const bt_msg_hello *hello; // but for the request's number, wire versions and schema
    void (*send)(const uint8_t *frame, size_t bytes);
    // A board's additions. Carry out another command: returns an enum bt_error, OK is answered with
    // EMU_STATUS. NULL: there is none.
    uint8_t (*obey)(uint8_t id, const uint8_t *payload);
    void (*fill)(bt_msg_emu_status *status);

    bt_deframer deframer;
    union {
        bt_msg_hello_request hello;
        bt_msg_emu_tape tape;
        bt_msg_emu_set_fault fault;
        bt_msg_emu_play play;
    } got;             // the command that is being carried out
    bool spoilt;       // a fault was set since the last check
    uint32_t reported; // slots received at the last report of a standstill
} bt_emu_feed;

// Drop another host's bytes.
void bt_emu_feed_begin(bt_emu_feed *feed);

// Carry out a host's commands, and answer.
void bt_emu_feed_receive(bt_emu_feed *feed, const uint8_t *bytes, size_t n);

// Report once that time stands still because the next round is missing: EMU_STATUS with req_id 0.
void bt_emu_feed_report(bt_emu_feed *feed);

// HELLO of simulated sensors.
extern const bt_msg_hello bt_emu_hello;

#endif
