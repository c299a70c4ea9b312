// The messages by which a host fills a stream and spoils it, whatever carries them: EMU_TAPE, EMU_PLAY,
// EMU_SET_FAULT, EMU_GET_STATUS (protocol/MESSAGES.md).
#ifndef BIOTAC_EMU_FEED_H
#define BIOTAC_EMU_FEED_H

#include "stream.h"
#include "wire/framing.h"

// Carry out a command. Returns an enum bt_error: OK is answered with EMU_STATUS, everything else with REPLY.
uint8_t bt_emu_obey(bt_emu_stream *stream, uint8_t id, const uint8_t *payload);

// What a stream knows of EMU_STATUS; the rest is 0, for the caller to fill in.
bt_msg_emu_status bt_emu_status_of(const bt_emu_stream *stream);

// The same over a byte pipe, framed as on a gateway's link.
typedef struct {
    bt_emu_stream *stream;
    void (*send)(const uint8_t *frame, size_t bytes);
    uint32_t link_bytes; // for EMU_STATUS, from whoever counts them
    bt_deframer deframer;
    uint32_t reported; // slots taken at the last report of a standstill
} bt_emu_feed;

// A program that begins to feed; the one before has gone.
void bt_emu_feed_begin(bt_emu_feed *feed, bt_emu_stream *stream, void (*send)(const uint8_t *, size_t));

// Carry out what it sent, and answer.
void bt_emu_feed_receive(bt_emu_feed *feed, const uint8_t *bytes, size_t n);

// Report that time stands still, once for each length of the tape: EMU_STATUS with req_id 0.
void bt_emu_feed_report(bt_emu_feed *feed);

#endif
