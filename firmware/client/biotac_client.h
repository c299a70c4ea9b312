// The host's end of a gateway for microcontrollers: bytes in, checked messages out, commands as bytes. No
// heap, no libc, no other file of this project but biotac_client_gen.h, generated from link.toml.
#ifndef BIOTAC_CLIENT_H
#define BIOTAC_CLIENT_H

#include "biotac_client_gen.h"

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

#define BT_ENCODED_MAX_BYTES (BT_FRAME_MAX_BYTES + 2)

// Reasons why bytes between two delimiters are no message.
enum bt_refused {
    BT_REFUSED_TOO_LONG = -1, // more bytes than any frame has
    BT_REFUSED_COBS = -2,
    BT_REFUSED_CRC = -3,    // also: too short to hold an id and a CRC
    BT_REFUSED_LENGTH = -4, // CRC is right, but a known id has another length
};

typedef struct {
    uint32_t refused[4]; // counts, in the order of enum bt_refused
    uint16_t filled;     // of buffer; one too many when bytes did not fit
    uint8_t id;
    uint8_t payload_bytes;
    uint8_t accept_longer; // set it when HELLO's wire_minor is above BT_WIRE_MINOR: fields were appended
    uint8_t buffer[BT_FRAME_MAX_BYTES + 1];
} bt_client; // all zero is a valid start

// One byte from the board. Returns a message's id once it is whole and checked, for bt_client_read until the
// next push; 0 while there is none; enum bt_refused (negative) for a damaged one. Unknown ids are returned
// too: ignore them.
int bt_client_push(bt_client *client, uint8_t byte);

// The received message, as a struct (bt_msg_frame for BT_FRAME_ID, and so on). Returns 0 when the message has
// another id or an unknown one; msg is then unchanged.
int bt_client_read(const bt_client *client, uint8_t id, void *msg);

// A command as bytes for the board: msg is id's struct. Returns the number of bytes, delimiter included; 0
// for an unknown id.
size_t bt_client_write(uint8_t id, const void *msg, uint8_t out[BT_ENCODED_MAX_BYTES]);

// The pieces. seal: a payload lies at out + 2. Both as in the sentences above.
size_t bt_client_seal(uint8_t id, size_t payload_bytes, uint8_t *out);
int bt_client_uncobs(uint8_t *data, size_t bytes); // in place; the length, or -1
uint32_t bt_client_crc(const uint8_t *data, size_t bytes);

// ---- a message's fields, for a controller

// False for the value that stands for "invalid". An invalid number is never 0: test before you use it.
static inline int bt_valid_i16(int16_t value)
{
    return value != BT_INVALID_I16;
}

static inline int bt_valid_i32(int32_t value)
{
    return value != BT_INVALID_I32;
}

static inline int bt_valid_count(uint16_t value)
{
    return value != BT_INVALID_COUNT;
}

// The ends of a FRAME's 95 % interval, in mN: of normal_mn and normal_half_mn, or of shear_mn and
// shear_half_mn. Where either is invalid they are the widest: 0 and 65535.
static inline uint16_t bt_least_mn(uint16_t part_mn, uint16_t half_mn)
{
    return (uint16_t)(bt_valid_count(half_mn) && part_mn != BT_INVALID_COUNT && part_mn > half_mn
                          ? part_mn - half_mn
                          : 0);
}

static inline uint16_t bt_most_mn(uint16_t part_mn, uint16_t half_mn)
{
    const uint32_t most = (uint32_t)part_mn + half_mn;
    return (uint16_t)(most < 0xFFFFu ? most : 0xFFFFu);
}

// The sequence of one finger's rounds; all zero before the first and after each START.
typedef struct {
    uint16_t next;
    uint8_t begun;
} bt_client_rounds;

// Number of rounds lost on the link since the message before. seq and rounds: a FRAME's and 1, or an IDLE's
// and its frames. Call it for both: together they cover every round.
static inline uint16_t bt_client_lost(bt_client_rounds *sequence, uint16_t seq, uint16_t rounds)
{
    const uint16_t first = (uint16_t)(seq - rounds + 1u);
    const uint16_t lost = (uint16_t)(sequence->begun != 0 ? first - sequence->next : 0);
    sequence->next = (uint16_t)(seq + 1u);
    sequence->begun = 1;
    return lost;
}

#ifdef __cplusplus
}
#endif

#endif
