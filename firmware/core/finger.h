// One finger: slots in, what to send out. Holds what belongs to that sensor alone, so that a fault on
// one finger cannot reach another.
#ifndef BIOTAC_FINGER_H
#define BIOTAC_FINGER_H

#include "events/events.h"
#include "signal/bands.h"
#include "signal/round.h"
#include "solve/pressure.h"
#include "solve/results.h"
#include "touch/tare.h"

// Counts of what the bus delivered; wrap at 2^32.
typedef struct {
    uint32_t good;
    uint32_t stuck;  // 0x0000 or 0xFFFF
    uint32_t error;  // 0xA5xx
    uint32_t parity; // anything else with bad parity
    uint16_t last_error_word;
} bt_word_counts;

// The latest wrench of a map, for rounds in which there is no time for another.
typedef struct {
    bool valid;
    uint16_t seq; // of its round
    int32_t force_100un[3];
    int32_t torque_mnmm[3];
    int32_t torsion_mnmm;
} bt_kept_wrench;

// What a FRAME does without, for want of time; a mask.
enum bt_shed { BT_SHED_SIGMA = 1, BT_SHED_MAP = 2 };

// A wrench is repeated for so long and no longer: a tenth of a second.
#define BT_REPEAT_MAX_ROUNDS 10

typedef struct {
    uint8_t index;
    bool present; // the last whole frame had at least one good word
    uint16_t seq; // of the next frame; rounds in which nothing answered are not counted
    uint8_t silent_rounds;
    bool answered;      // since it was plugged in
    uint8_t next_slot;  // of this round
    uint8_t quantities; // BT_QUANTITY_FLAG_*
    uint16_t unsent;    // rounds for which an IDLE is still to speak
    bool fresh;         // nothing was sent since START: the first is a FRAME
    bool tare_unsent;   // the tare changed in the latest round
    bt_round round;     // the latest round, or being assembled
    bt_tare tare;
    bt_pressure pressure;
    bt_lanes sent; // filtered counts when the last FRAME was sent
    bt_kept_wrench kept;
    bt_events events; // kept up while somebody subscribes to them
    bt_bands bands;   // kept up while they are streamed
    bool shed;        // FRAMEs were left out for want of time since the last one
    bt_word_counts words;
} bt_finger;

// A quarter of a second without one good word is an unplugged sensor; less may be a bus fault or a late main
// loop. The tare holds in either case: whose it is, talk/sensors.h finds out.
#define BT_UNPLUGGED_ROUNDS 25

void bt_finger_reset(bt_finger *finger, uint8_t index);

// A round of slots begins.
void bt_finger_begin(bt_finger *finger, uint32_t t_us, const bt_tare_settings *settings);

// The word of one slot: 0..4095 or BT_INVALID_COUNT. Slots come in order; those left out are missing.
// Returns true in the slot in which a resting finger is first touched, or in the next if that was left out.
bool bt_finger_put(bt_finger *finger, uint8_t slot, uint16_t count);

// The events that this word shows, a mask of 1 << BT_EVENT_KIND_*; `touched` is what bt_finger_put said of
// it. Only where that is true, in slots of BT_FINGER_EVENT_SLOTS and in the slot that is watched (events.h);
// 0 in all others, which need not be asked.
uint32_t bt_finger_events(bt_finger *finger, uint8_t slot, bool touched);
void bt_finger_event(bt_finger *finger, uint8_t event, uint8_t slot, uint32_t t_us, bt_msg_event *msg);

// Of the 8th, 15th and 22nd PAC word.
#define BT_FINGER_EVENT_SLOTS {14, 28, 42}

// The round is over. False when no word of it was good: the sensor is absent, and nothing else of it
// is to be read.
bool bt_finger_end(bt_finger *finger, const bt_tare_settings *settings);

// The round is over in which this finger was not sampled; nothing of it counts.
void bt_finger_pass(bt_finger *finger);

// Another sensor is there: its tare begins anew.
void bt_finger_forget(bt_finger *finger);

// Nothing touches, nothing changed, and nobody asked for FRAMEs all the same: nothing to compute.
bool bt_finger_idle(const bt_finger *finger);

// The filtered counts have moved beyond noise since the last FRAME that was sent.
bool bt_finger_moved(const bt_finger *finger);

// How old the latest wrench of the finger's map is; more than BT_REPEAT_MAX_ROUNDS when there is none to
// repeat.
uint32_t bt_finger_wrench_age(const bt_finger *finger, const bt_solve_settings *settings);

// The round that has ended as messages. PoC, force and torque are computed in the first, less what is to be
// shed: BT_SHED_MAP only where bt_finger_wrench_age allows it. An IDLE stands for `unsent` rounds, of which
// the round that has ended is the last or, when its FRAME follows, not one.
void bt_finger_frame(bt_finger *finger, const bt_solve_settings *settings, uint32_t shed, bt_msg_frame *msg);
void bt_finger_idle_message(const bt_finger *finger, bool frame_follows, bt_msg_idle *msg);
void bt_finger_pac(const bt_finger *finger, bt_msg_pac *msg);
void bt_finger_bands(bt_finger *finger, bt_msg_bands *msg); // once a round

// Where the finger is touched now, from the latest word of every electrode, be it of this round or of the
// one before.
void bt_finger_point(bt_finger *finger, const bt_solve_settings *settings, bt_msg_point *msg);
void bt_finger_tare(const bt_finger *finger, bt_msg_tare *msg);

#endif
