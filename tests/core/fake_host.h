// The host's end of a session: sends commands and decodes the bytes that the board wrote.
#ifndef BIOTAC_TEST_FAKE_HOST_H
#define BIOTAC_TEST_FAKE_HOST_H

#include "support.h"

#include "talk/host_link.h"
#include "talk/rounds.h"

#define MAX_RECEIVED 4096

typedef struct {
    uint8_t id;
    uint8_t link;
    uint8_t bytes;
    uint8_t payload[BT_FRAME_MAX_BYTES];
} received_message;

static struct {
    received_message message[MAX_RECEIVED];
    int count;
    size_t room;   // bytes the link still takes
    bool broken;   // part of a frame was written, or a frame that does not decode
    unsigned link; // that the latest message was for
    bt_deframer deframer;
} host;

static inline void host_forget(void)
{
    host.count = 0;
}

static inline void host_reset(void)
{
    memset(&host, 0, sizeof host);
    host.room = SIZE_MAX;
}

static inline void host_receive_bytes(const uint8_t *data, size_t bytes)
{
    for (size_t k = 0; k < bytes; k++) {
        enum bt_deframed outcome = bt_deframer_push(&host.deframer, data[k]);
        if (outcome == BT_DEFRAMED_NOTHING) {
            continue;
        }
        if (outcome != BT_DEFRAMED_GOOD || host.count == MAX_RECEIVED) {
            host.broken = true;
            return;
        }
        received_message *message = &host.message[host.count++];
        message->id = host.deframer.id;
        message->link = (uint8_t)host.link;
        message->bytes = host.deframer.payload_bytes;
        memcpy(message->payload, host.deframer.buffer + 1, message->bytes);
    }
}

// A bt_link_write: all or none.
static inline bool host_write(void *context, unsigned link, const uint8_t *data, size_t bytes)
{
    (void)context;
    host.link = link;
    if (bytes > host.room) {
        return false;
    }
    host.room -= host.room == SIZE_MAX ? 0 : bytes;
    host.broken = host.broken || bytes == 0 || data[bytes - 1] != 0;
    host_receive_bytes(data, bytes);
    return true;
}

static inline int host_count(uint8_t id)
{
    int n = 0;
    for (int k = 0; k < host.count; k++) {
        n += host.message[k].id == id;
    }
    return n;
}

// Send one command with any payload length.
static inline void host_send(bt_session *session, uint8_t id, const void *payload, size_t bytes,
                             uint32_t now_us)
{
    uint8_t encoded[BT_ENCODED_MAX_BYTES];
    bt_session_receive(session, 0, encoded, bt_frame_encode(id, payload, bytes, encoded), now_us);
}

// Send, and return the only message that the board wrote.
static inline const received_message *host_ask(bt_session *session, uint8_t id, const void *payload,
                                               size_t bytes)
{
    host_forget();
    host_send(session, id, payload, bytes, 0);
    assert_int_equal(host.count, 1);
    assert_false(host.broken);
    return &host.message[0];
}

// Send a command that REPLY answers; check that the reply names the command, and return the error.
static inline uint8_t host_error(bt_session *session, uint8_t id, const void *payload, size_t bytes)
{
    const received_message *message = host_ask(session, id, payload, bytes);
    bt_msg_reply reply;
    assert_int_equal(message->id, BT_REPLY_ID);
    bt_msg_reply_unpack(&reply, message->payload);
    assert_int_equal(reply.command, id);
    if (reply.error != BT_ERROR_BAD_LENGTH) { // there req_id cannot be trusted
        assert_int_equal(reply.req_id, ((const uint8_t *)payload)[0]);
    }
    return reply.error;
}

// One round in which the fingers of mask answer with count on every channel.
static inline void host_round(bt_session *session, uint8_t mask, uint16_t count)
{
    uint16_t counts[BT_MAX_FINGERS];
    for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
        counts[f] = mask >> f & 1 ? count : BT_INVALID_COUNT;
    }
    bt_session_begin(session, 0);
    for (uint8_t slot = 0; slot < BT_SLOTS; slot++) {
        bt_session_slot(session, slot, counts, 0);
    }
    bt_session_end_round(session);
}

// ---- the session under test ---------------------------------------------------------------------

static bt_session session;

BEFORE_EACH(new_session)
{
    bt_msg_hello hello = {.board = BT_BOARD_PICO,
                          .fingers = BT_MAX_FINGERS,
                          .firmware_major = 1,
                          .firmware_minor = 2,
                          .firmware_patch = 3,
                          .boot_id = 0xB0071D,
                          .slot_hz = BT_SLOT_HZ};
    memcpy(hello.board_serial, "ABCDEFGHIJKL", 12);
    host_reset();
    bt_session_init(&session, &hello, host_write, NULL, 0);
}

static inline uint8_t start(uint8_t streams, uint8_t fingers, uint16_t keepalive_ms)
{
    uint8_t payload[BT_START_BYTES];
    bt_msg_start msg = {.req_id = 9, .streams = streams, .fingers = fingers, .keepalive_ms = keepalive_ms};
    bt_msg_start_pack(&msg, payload);
    return host_error(&session, BT_START_ID, payload, sizeof payload);
}

static inline uint8_t stop(void)
{
    return host_error(&session, BT_STOP_ID, "\x08", 1);
}

static inline uint8_t subscribe(uint8_t fingers, uint8_t quantities)
{
    const uint8_t payload[BT_SUBSCRIBE_BYTES] = {6, fingers, quantities};
    return host_error(&session, BT_SUBSCRIBE_ID, payload, sizeof payload);
}

// The error; OK when the setting came back as asked for.
static inline uint8_t set_setting(uint8_t setting, int32_t value)
{
    uint8_t payload[BT_SET_SETTING_BYTES];
    bt_msg_set_setting msg = {.req_id = 77, .setting = setting, .value = value};
    bt_msg_set_setting_pack(&msg, payload);
    const received_message *message = host_ask(&session, BT_SET_SETTING_ID, payload, sizeof payload);
    if (message->id == BT_REPLY_ID) {
        return message->payload[2];
    }
    assert_int_equal(message->id, BT_SETTING_ID);
    assert_memory_equal(message->payload, payload, sizeof payload);
    return BT_ERROR_OK;
}

#define SENSOR "BTEMU00000000042" // 16 bytes, as the sensor says it

// The finger's sensor reports this serial; "": it reports none.
static inline void plug(uint8_t finger, const char *serial)
{
    bt_sensor_info *info = &session.info[finger];
    memset(info, 0, sizeof *info);
    info->present = serial[0] != 0;
    memcpy(info->serial, serial, strlen(serial));
}

#endif
