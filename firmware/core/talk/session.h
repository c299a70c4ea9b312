// What the board does for its host: fingers, settings, calibrations, maps, streams and link statistics. It
// knows no transport: bytes leave through one function that takes a whole frame or nothing, and arrive
// through host_link.h. Times are device time in us, wrapping at 2^32.
//
// A board has one or two ports, and each may have a host. Both are answered, but only one of them, the owner,
// changes anything: who changed something last. While it streams with a keep-alive, holds a finger or has
// taken the link, commands of the other that would change something are refused, LINK_BUSY.
#ifndef BIOTAC_SESSION_H
#define BIOTAC_SESSION_H

#include "finger.h"
#include "keep/calibration.h"
#include "keep/settings.h"
#include "map/upload.h"
#include "talk/scheduler.h"
#include "wire/framing.h"

// What a sensor says about itself, as sent to the host.
typedef bt_msg_sensor_info bt_sensor_info;

#define BT_LINKS   2
#define BT_NO_LINK BT_LINKS

// To the host at a port, 0 to BT_LINKS - 1. Takes all bytes or none; false: no room, or no host.
typedef bool (*bt_link_write)(void *context, unsigned link, const uint8_t *data, size_t bytes);

// What the session needs from its board. The actions return an enum bt_error.
typedef struct {
    uint8_t (*reboot)(void *context, bool into_bootloader); // OK: it happens once the reply is out
    void (*measure)(void *context, bt_msg_board_facts *facts);
    void (*set_bus_rate)(void *context, uint16_t khz); // 0: the usual one
    const bt_flash *flash;                             // where settings are kept; NULL: nowhere
    const bt_map_flash *maps;                          // and wrench maps, likewise
    uint32_t (*now_us)(void *context);                 // device time; NULL: the board is never short of time
} bt_board_actions;

// What sensors.c knows about which sensor is there.
typedef struct {
    uint8_t bad_words;   // consecutive, at most BT_AWAY_WORDS
    uint8_t rounds_left; // rounds until it is asked again
    uint8_t attempts;    // it was asked, up to a limit
    bool answered;       // in the last round
} bt_sensor_query;

typedef struct {
    bt_finger finger[BT_MAX_FINGERS];
    bt_sensor_info info[BT_MAX_FINGERS];
    bt_sensor_query query[BT_MAX_FINGERS];
    uint8_t asked;   // bit masks of fingers: asked for their serial number in this round, not sampled
    uint8_t unsure;  // may be another sensor than info says
    uint8_t other;   // is another one than at START
    uint8_t refused; // likewise, and calibration or map are not its own: no result would be right
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
    bt_msg_hello hello; // who this board is, as it is told; commands.c fills in what changes
    bt_link_write write;
    void *context;
    bt_board_actions board; // set after bt_session_init; what is NULL is answered NOT_HERE
    bt_deframer deframer[BT_LINKS];
    uint8_t owner; // port whose host may change things; BT_NO_LINK until one does
    uint8_t link;  // port that messages go to: the owner's, or while a command runs, its own

    // Streams, faults (status.h) and counters, kept as they are sent; seq is the next one's, and status.c
    // fills in t_us, req_id and fingers_present.
    bt_msg_status status;
    uint8_t fingers;              // bit mask of the fingers that START named
    uint8_t event_fingers;        // bit mask of the fingers that send EVENTs in this round
    uint8_t events_due[BT_SLOTS]; // and of those for which each slot may show one
    uint16_t keepalive_ms;
    uint32_t owner_rx_us; // when the owner last said anything
    uint32_t command_us;  // when the latest command came, whoever sent it
    uint32_t status_us;
    uint32_t second_us; // uptime is counted in whole seconds from here
    uint16_t sensor_status_seq;
    bt_scheduler scheduler;
} bt_session;

// hello: the board, with a slot_hz of 0 where rounds come whole; wire versions and schema are added here.
// context: the first argument of `write` and of the board's actions.
void bt_session_init(bt_session *session, const bt_msg_hello *hello, bt_link_write write, void *context,
                     uint32_t now_us);

// Apply changed settings, calibrations or sensors. Not while streaming: one recording, one set of settings.
void bt_session_use_settings(bt_session *session);

// End every stream. A change of sensor that had to wait for this takes effect.
void bt_session_stop(bt_session *session);

// The sensors' bus is at its usual rate again.
void bt_session_end_trial(bt_session *session);
// The owner streams with a keep-alive, holds a finger or has taken the link.
bool bt_session_is_kept(const bt_session *session);

// Finger f's sensor has told its serial number; other: it is not the one that was there before.
void bt_session_sensor_changed(bt_session *session, unsigned f, bool other);

// Bit mask of the fingers whose sensor answers.
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
