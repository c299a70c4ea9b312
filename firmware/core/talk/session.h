// The board for its hosts: fingers, settings, calibrations, maps, streams and link statistics. No transport
// is known here: bytes leave through one function that accepts a whole frame or nothing, and arrive through
// host_link.h. Times are device time in us, wrapping at 2^32.
//
// A board has one or two ports, and each may have a host. Both are answered, but only one, the owner, changes
// anything: the host with the latest change. While the owner streams with a keep-alive, holds a finger or has
// taken the link, the other host's changes are refused, LINK_BUSY.
#ifndef BIOTAC_SESSION_H
#define BIOTAC_SESSION_H

#include "finger.h"
#include "keep/calibration.h"
#include "keep/settings.h"
#include "map/upload.h"
#include "talk/scheduler.h"
#include "wire/framing.h"

// A sensor's own data, as sent to the host.
typedef bt_msg_sensor_info bt_sensor_info;

#define BT_LINKS   2
#define BT_NO_LINK BT_LINKS

// To the host at a port, 0 to BT_LINKS - 1. Accepts all bytes or none; false: no room, or no host.
typedef bool (*bt_link_write)(void *context, unsigned link, const uint8_t *data, size_t bytes);

// The board as the session needs it. The actions return an enum bt_error.
typedef struct {
    uint8_t (*reboot)(void *context, bool into_bootloader); // OK: it happens once the reply is out
    void (*measure)(void *context, bt_msg_board_facts *facts);
    void (*set_bus_rate)(void *context, uint16_t khz); // 0: the usual one
    const bt_flash *flash;                             // of the settings; NULL: none
    const bt_map_flash *maps;                          // of the wrench maps; NULL: none
    uint32_t (*now_us)(void *context);                 // device time; NULL: the board is never short of time
} bt_board_actions;

// State of sensors.c for one finger.
typedef struct {
    uint8_t bad_words;   // consecutive, at most BT_AWAY_WORDS
    uint8_t rounds_left; // rounds until the next request
    uint8_t attempts;    // requests, up to a limit
    bool answered;       // in the last round
} bt_sensor_query;

typedef struct {
    bt_finger finger[BT_MAX_FINGERS];
    bt_sensor_info info[BT_MAX_FINGERS];
    bt_sensor_query query[BT_MAX_FINGERS];
    uint8_t asked;   // bit masks of fingers: asked for a serial number in this round, not sampled
    uint8_t unsure;  // may be another sensor than info says
    uint8_t other;   // is another sensor than at START
    uint8_t refused; // likewise, and calibration or map are for the old one: no result would be right
    bool bus_rate_overridden; // at a rate of SET_BUS_RATE
    bt_settings settings;
    bt_calibration calibration[BT_MAX_FINGERS];
    uint8_t calibration_state[BT_MAX_FINGERS]; // enum bt_calibration_state; derived from the above
    bt_finger_map map[BT_MAX_FINGERS];
    uint8_t map_state[BT_MAX_FINGERS]; // likewise
    bt_upload upload;
    bt_solve_settings solve[BT_MAX_FINGERS];
    bt_tare_settings tare[BT_MAX_FINGERS];
    uint32_t status_period_us;
    uint32_t hold_timeout_us; // 0: HOLD never lapses
    uint16_t idle_rounds;
    bt_msg_hello hello; // identity of this board; commands.c fills in the rest
    bt_link_write write;
    void *context;
    bt_board_actions board; // set after bt_session_init; commands for a NULL are answered NOT_HERE
    bt_deframer deframer[BT_LINKS];
    uint8_t owner; // port with the right to change things; BT_NO_LINK until first used
    uint8_t link;  // port that messages go to: the owner's, or that of the running command

    // Streams, faults (status.h) and counters, as sent next, with the next seq. status.c fills in t_us,
    // req_id and fingers_present.
    bt_msg_status status;
    uint8_t fingers;              // bit mask of the fingers that START named
    uint8_t event_fingers;        // bit mask of the fingers that send EVENTs in this round
    uint8_t events_due[BT_SLOTS]; // and of those with a possible EVENT in each slot
    uint16_t keepalive_ms;
    uint32_t owner_rx_us; // time of the owner's latest packet
    uint32_t command_us;  // time of the latest command of any host
    uint32_t status_us;
    uint32_t second_us; // start of the current second of uptime
    uint16_t sensor_status_seq;
    bt_scheduler scheduler;
} bt_session;

// hello: the board, with a slot_hz of 0 where rounds come whole; wire versions and schema are added here.
// context: first argument of `write` and of the board's actions.
void bt_session_init(bt_session *session, const bt_msg_hello *hello, bt_link_write write, void *context,
                     uint32_t now_us);

// Apply changed settings, calibrations or sensors. Not while streaming: one recording, one set of settings.
void bt_session_use_settings(bt_session *session);

// End every stream. A change of sensor that had to wait for this takes effect.
void bt_session_stop(bt_session *session);

// Set the sensors' bus to the usual rate again.
void bt_session_end_trial(bt_session *session);
// True while the owner streams with a keep-alive, holds a finger or has taken the link.
bool bt_session_is_owned(const bt_session *session);

// Finger f's sensor has a serial number; other: not the one that was there before.
void bt_session_sensor_changed(bt_session *session, unsigned f, bool other);

// Bit mask of the fingers with a sensor that answers.
uint8_t bt_session_present(const bt_session *session);

// Send the payload at frame + BT_PAYLOAD_AT as one message (bt_frame_seal), counting it as sent or dropped.
void bt_session_send_sealed(bt_session *session, uint8_t id, uint8_t *frame);

// bt_msg_reply_send(session, &msg), and so on: pack one message and send it.
#define BT_SENDER(NAME, message)                                                                             \
    static inline void message##_send(bt_session *session, const message *msg)                               \
    {                                                                                                        \
        _Alignas(4) uint8_t frame[BT_PAYLOAD_AT + BT_##NAME##_BYTES + BT_CRC_BYTES + 1];                     \
        message##_pack(msg, frame + BT_PAYLOAD_AT);                                                          \
        bt_session_send_sealed(session, BT_##NAME##_ID, frame);                                              \
    }
BT_WIRE_MESSAGES(BT_SENDER)

#endif
