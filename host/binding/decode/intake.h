// From the link's bytes to numbered rows, a chunk at a time: decode.h, then numbering.h over the messages.
#ifndef BIOTAC_INTAKE_H
#define BIOTAC_INTAKE_H

#include "decode/decode.h"
#include "decode/numbering.h"

#define BT_INTAKE_GAPS      (BT_DECODE_ROOM / 16) // no message is as short on the wire
#define BT_INTAKE_OUT       (3 * BT_DECODE_ROOM / 8)
#define BT_INTAKE_ROW_KINDS 3 // the first of enum bt_decoded: FRAME, PAC, IDLE

// Facts of a call.
typedef struct {
    int64_t consumed;   // bytes of input
    int64_t arrived_ns; // when they were read, by the clock of time.monotonic(); bt_intake_read() only
    int64_t out_bytes;
    int64_t rows[BT_INTAKE_ROW_KINDS]; // FRAMEs, PACs, IDLEs
    int64_t other_bytes;
    int64_t packet_bytes;
    int64_t bad; // since the reset, damaged frames
    int64_t gaps;
    int64_t last_t_us; // latest of FRAMEs and IDLEs, if there are any
    int64_t fingers;   // of FRAMEs and IDLEs, a bit each; all bits where one has no bit of its own
} bt_intake_facts;

typedef struct {
    bt_intake_facts facts;
    // The output of the last call, back to back: FRAMEs' seq and t_us, PACs' seq and t_us, IDLEs' seq and
    // t_us; then bytes, as in bt_decoder.data: FRAMEs, PACs, IDLEs, others, packets.
    int64_t out[BT_INTAKE_OUT];
    bt_gap gaps[BT_INTAKE_GAPS]; // of FRAMEs and IDLEs

    bt_decoder decoder;
    bt_numbering rounds; // FRAMEs and IDLEs share one numbering: together they account for every round
    bt_numbering pacs;
    bt_unwrapper t_us; // one clock for all, STATUS too: a finger plugged in late is not early
    uint32_t uptime_s; // of the latest STATUS, with the t_us of that
    int64_t status_us;
    int64_t unheard; // rounds, in all, of stretches without a message of any finger
    uint8_t in[BT_DECODE_BYTES];
} bt_intake;

void bt_intake_reset(bt_intake *intake);

// Uses at most BT_DECODE_BYTES and returns how many. The output of the call before is gone.
size_t bt_intake_feed(bt_intake *intake, const uint8_t *data, size_t bytes);

// The same of packets that were decoded before, as in a recording: whole ones.
size_t bt_intake_feed_packets(bt_intake *intake, const uint8_t *packets, size_t bytes);

// Waits for bytes of a port and reads them into ``in``: returns as bt_descriptor_read(), after bytes with all
// facts set.
int64_t bt_intake_read(bt_intake *intake, int fd, double timeout_s);

#endif
