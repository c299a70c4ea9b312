// One finger: takes the words of its slots and makes the messages to send. All of a sensor's state is in
// here, so a fault on one finger cannot affect another.
#ifndef BIOTAC_FINGER_H
#define BIOTAC_FINGER_H

#include "events/events.h"
#include "signal/health.h"
#include "signal/round.h"
#include "solve/flags.h"
#include "solve/pressure.h"
#include "solve/results.h"
#include "touch/tare.h"

// Words that the bus delivered, by kind; wrap at 2^32.
typedef struct {
    uint32_t good;
    uint32_t stuck;  // 0x0000 or 0xFFFF
    uint32_t error;  // 0xA5xx
    uint32_t parity; // anything else with bad parity
    uint16_t last_error_word;
} bt_word_counts;

// The latest wrench computed from a map, repeated in rounds that leave no time for a new one.
typedef struct {
    bool valid;
    uint16_t seq; // of the round it was computed in
    int32_t force_100un[3];
    int32_t torque_mnmm[3];
    int32_t torsion_mnmm;
    uint16_t grip_mn[4]; // normal, its half width, shear, its half width
} bt_kept_wrench;

// What is left out when time is short: the map's wrench, which is repeated, or all of a FRAME; a bit mask.
enum bt_shed { BT_SHED_MAP = 1, BT_SHED_FRAME = 2 };

// A wrench is repeated for at most a tenth of a second.
#define BT_REPEAT_MAX_ROUNDS 10

typedef struct {
    uint8_t index;
    bool foreign; // no BioTac, whose electrodes lie elsewhere or are none: no point, force or torque
    bool present; // the last complete round had at least one good word
    uint16_t seq; // of the next frame; does not count rounds in which nothing answered
    uint8_t silent_rounds;
    bool answered;      // has answered since it was plugged in
    uint8_t next_slot;  // in this round
    uint8_t quantities; // BT_QUANTITY_FLAG_*
    uint16_t unsent;    // rounds that the next IDLE is to report
    bool fresh;         // nothing sent since START: the first message is a FRAME
    bool tare_unsent;   // the tare changed in the latest round
    bt_round round;     // the latest round, or the one being assembled
    bt_health health;
    bt_tare tare;
    bt_pressure pressure;
    bt_lanes sent; // filtered counts when the last FRAME was sent
    bt_kept_wrench kept;
    bt_events events;       // updated only while a host subscribes to them
    uint32_t sensor_flags;  // BT_FRAME_FLAG_SENSOR_*, by the sensor's serial number
    uint8_t trust;          // enum bt_trust of the latest FRAME or IDLE
    uint8_t trust_reported; // what hosts were told, with the FRAMEs or by events
    uint8_t trust_rounds;   // in which it has been higher
    bool shed;              // FRAMEs were left out since the last one sent, because time was short
    bt_word_counts words;
} bt_finger;

// What a FRAME contains until a host subscribes to something else.
#define BT_SUBSCRIBED_AT_FIRST                                                                               \
    (BT_QUANTITY_FLAG_POC | BT_QUANTITY_FLAG_FORCE | BT_QUANTITY_FLAG_TORQUE | BT_QUANTITY_FLAG_PRESSURE     \
     | BT_QUANTITY_FLAG_REST_FRAMES)

// After a quarter of a second without a good word the sensor counts as unplugged; a shorter gap may be a bus
// fault or a late main loop. The tare survives both: talk/sensors.h finds out which sensor answers
// afterwards.
#define BT_UNPLUGGED_ROUNDS 25

void bt_finger_reset(bt_finger *finger, uint8_t index);

void bt_finger_begin(bt_finger *finger, uint32_t t_us, const bt_tare_settings *settings);

// Take the word of one slot: 0..4095 or BT_INVALID_COUNT. Slots come in order; skipped ones count as missing.
// Returns true in the slot in which a resting finger is first touched, or in the next one given if that slot
// was skipped.
bool bt_finger_put(bt_finger *finger, uint8_t slot, uint16_t count);

// The events that this word reveals, a mask of 1 << BT_EVENT_KIND_*; `touched` is what bt_finger_put returned
// for it. Needs calling only where `touched` is true, in BT_FINGER_EVENT_SLOTS and in the strongest slot
// (events.h); elsewhere it returns 0.
uint32_t bt_finger_events(bt_finger *finger, uint8_t slot, bool touched);
void bt_finger_event(bt_finger *finger, uint8_t event, uint8_t slot, uint32_t t_us, bt_msg_event *msg);

// The slots of the 8th, 15th and 22nd PAC word.
#define BT_FINGER_EVENT_SLOTS {14, 28, 42}

// End a round. Returns false when it had no good word: the sensor is absent, and nothing else of this round
// may be read.
bool bt_finger_end(bt_finger *finger, const bt_tare_settings *settings);

// End a round in which this finger was not sampled; the round counts for nothing.
void bt_finger_pass(bt_finger *finger);

// The flags of the round that do not depend on any result.
uint32_t bt_finger_flags(const bt_finger *finger);

// After a FRAME or a round of an IDLE: whether an EVENT is to report its trust. A fall is reported at once, a
// rise once it has lasted for BT_TRUST_ROUNDS.
#define BT_TRUST_ROUNDS 10
bool bt_finger_trust_changed(bt_finger *finger);

// What is wrong with the whole sensor, an enum bt_sensor_fault.
uint8_t bt_finger_sensor_fault(const bt_finger *finger);

// Another sensor is connected: forget the tare, and what was wrong with the one before.
void bt_finger_forget(bt_finger *finger);

// True when there is nothing to compute: nothing touches the finger, the tare has not changed, and nobody
// asked for FRAMEs at rest.
bool bt_finger_idle(const bt_finger *finger);

// True when the filtered counts have moved by more than noise since the last FRAME sent.
bool bt_finger_moved(const bt_finger *finger);

// Age in rounds of the latest wrench from the finger's map; more than BT_REPEAT_MAX_ROUNDS when there is none
// to repeat.
uint32_t bt_finger_wrench_age(const bt_finger *finger, const bt_solve_settings *settings);

// The messages of the round that has just ended. bt_finger_frame computes `quantities`, BT_QUANTITY_FLAG_*,
// except what `shed` leaves out; BT_SHED_MAP needs a bt_finger_wrench_age of at most BT_REPEAT_MAX_ROUNDS. An
// IDLE reports `unsent` rounds, up to this one or, if this one's FRAME follows, up to the one before.
void bt_finger_frame(bt_finger *finger, const bt_solve_settings *settings, uint8_t quantities, uint32_t shed,
                     bt_msg_frame *msg);
void bt_finger_idle_message(const bt_finger *finger, bool frame_follows, bt_msg_idle *msg);
void bt_finger_pac(const bt_finger *finger, bt_msg_pac *msg);

// Where the finger is touched now, from each electrode's latest word, whether of this round or of the one
// before.
void bt_finger_point(bt_finger *finger, const bt_solve_settings *settings, bt_msg_point *msg);
void bt_finger_tare(const bt_finger *finger, bt_msg_tare *msg);

#endif
