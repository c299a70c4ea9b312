// The conversation with the host: handshake, commands, streams, link statistics.
// Knows no transport: bytes come in through bt_session_receive and leave through one function that
// takes a whole frame or nothing. Times are device time in us, wrapping at 2^32.
#ifndef BIOTAC_SESSION_H
#define BIOTAC_SESSION_H

#include "calibration.h"
#include "finger.h"
#include "framing.h"
#include "settings.h"
#include "upload.h"

typedef struct {
    uint16_t board; // enum bt_board
    uint8_t firmware_version[3];
    uint8_t board_serial[12];
    uint32_t boot_id;
} bt_identity;

// What a sensor says of itself, as it is sent.
typedef bt_msg_sensor_info bt_sensor_info;

// Takes all bytes or none; false means no room, or nobody there.
typedef bool (*bt_link_write)(const uint8_t *data, size_t bytes);

// What the session asks of its board. All return an enum bt_error.
typedef struct {
    uint8_t (*save_settings)(const bt_settings *settings);
    uint8_t (*save_calibration)(uint8_t finger, const bt_calibration *calibration);
    uint8_t (*save_map)(uint8_t finger, const bt_map_place *place);
    uint8_t (*reboot_bootloader)(void); // OK: it happens once the reply is out
    const bt_map_flash *maps;           // where wrench maps are kept; NULL: nowhere
} bt_board_actions;

// Finger-rounds of a FRAME stream in which something was not done because nobody needed it; wrap at 2^32.
typedef struct {
    uint32_t frames; // an IDLE spoke instead
    uint32_t poc;
    uint32_t force;
    uint32_t torque;
    uint32_t sigma;
} bt_skips;

typedef struct {
    bt_finger finger[BT_MAX_FINGERS];
    bt_sensor_info info[BT_MAX_FINGERS];
    bt_settings settings;
    bt_calibration calibration[BT_MAX_FINGERS];
    uint8_t calibration_state[BT_MAX_FINGERS]; // enum; these follow from what is above, once per change
    bt_finger_map map[BT_MAX_FINGERS];
    uint8_t map_state[BT_MAX_FINGERS]; // enum bt_calibration_state, likewise
    bt_upload upload;
    bt_kernel_settings kernel[BT_MAX_FINGERS];
    bt_tare_settings tare[BT_MAX_FINGERS];
    uint32_t status_period_us;
    uint16_t idle_rounds;
    bt_identity identity;
    bt_link_write write;
    bt_board_actions board;
    bt_deframer deframer;

    uint8_t streams; // BT_STREAM_FLAG_*
    uint8_t fingers; // bit mask of the fingers that START named
    uint16_t keepalive_ms;
    uint32_t heard_us; // when the host last said anything
    uint32_t status_us;
    uint32_t second_us; // uptime is counted in whole seconds from here
    uint32_t uptime_s;
    uint16_t status_seq;
    uint16_t sensor_status_seq;

    uint32_t messages_sent;
    uint32_t messages_dropped;
    bt_skips skips;
    uint32_t slots_late;
    uint32_t rx_frames;
    uint32_t rx_errors;
} bt_session;

void bt_session_init(bt_session *session, const bt_identity *identity, bt_link_write write, uint32_t now_us);

// Until this is called, or where an action is NULL, the commands for it are answered NOT_HERE.
void bt_session_use_board(bt_session *session, const bt_board_actions *actions);

// Bytes from the host. Every command gets exactly one reply.
void bt_session_receive(bt_session *session, const uint8_t *data, size_t bytes, uint32_t now_us);

// A round of slots: begin, each slot's counts (BT_INVALID_COUNT where no good word came), end. Slots come
// in order; those left out are missing. The end computes and sends what is subscribed to.
void bt_session_begin(bt_session *session, uint32_t t_us);
void bt_session_slot(bt_session *session, uint8_t slot, const uint16_t count[BT_MAX_FINGERS], uint32_t t_us);
void bt_session_round(bt_session *session);

// Settings, calibrations or sensors have changed. Not while streaming: one recording, one set of settings.
void bt_session_use_settings(bt_session *session);

// Call often: keep-alive and periodic status.
void bt_session_tick(bt_session *session, uint32_t now_us);

// The host closed the port: nobody is there to stream to.
void bt_session_link_down(bt_session *session);

// End every stream. What waited for that, a sensor unplugged meanwhile, then counts.
void bt_session_stop(bt_session *session);

// Bit mask of the fingers whose sensor answers.
uint8_t bt_session_present(const bt_session *session);

// Send one message, counting it as sent or dropped.
void bt_session_send(bt_session *session, uint8_t id, const uint8_t *payload);
void bt_session_send_status(bt_session *session, uint8_t req_id, uint32_t now_us);
void bt_session_send_sensor_status(bt_session *session, uint8_t req_id, uint8_t finger, uint32_t now_us);

// commands.c: one good frame from the host.
void bt_command(bt_session *session, uint8_t id, const uint8_t *payload, uint32_t now_us);

// map_commands.c: the commands for wrench maps, and their part of SAVE_SETTINGS. Both return an enum
// bt_error; *answered tells whether a message of the command's own has gone out in place of a REPLY.
uint8_t bt_map_command(bt_session *session, uint8_t id, const uint8_t *payload, bool *answered);
uint8_t bt_save_maps(bt_session *session);

#endif
