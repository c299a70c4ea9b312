#include "replay.h"

#include "solve/interval.h"

#include <string.h>

_Static_assert(BT_REPLAY_BYTES == BT_FRAME_BYTES + 3 + 3 * 4,
               "a row is a frame, three bytes and three words");
_Static_assert(BT_REPLAY_NO_TOUCH >= BT_SLOTS, "BT_REPLAY_NO_TOUCH must not be a slot");

static void mark_absent(const bt_finger *finger, bt_msg_frame *msg)
{
    memset(msg, 0, sizeof *msg);
    memset(msg->counts, 0xFF, sizeof msg->counts);
    memset(msg->tare_q4, 0xFF, sizeof msg->tare_q4);
    bt_grip_unknown(msg);
    msg->pdc = msg->tac = msg->tdc = msg->pdc_tare_q4 = BT_INVALID_COUNT;
    msg->pdc_filtered_q4 = BT_INVALID_COUNT;
    msg->pressure_force_100un = msg->torsion_mnmm = BT_INVALID_I32;
    for (int d = 0; d < 3; d++) {
        msg->poc_um[d] = BT_INVALID_I16;
        msg->force_100un[d] = msg->torque_mnmm[d] = BT_INVALID_I32;
    }
    msg->slip_level = BT_SLIP_LEVEL_NONE;
    msg->seq = (uint16_t)(finger->seq - 1); // as the last frame: a round without a word has no number
    msg->t_us = finger->round.t_us;
    msg->finger = finger->index;
    msg->tare_state = finger->tare.state;
    msg->electrodes_out = (1u << BT_ELECTRODES) - 1;
    msg->flags = BT_FRAME_FLAG_POC_INVALID | BT_FRAME_FLAG_ELECTRODE_MISSING | BT_FRAME_FLAG_PDC_MISSING
                 | BT_FRAME_FLAG_TAC_MISSING | BT_FRAME_FLAG_TDC_MISSING | BT_FRAME_FLAG_FAULT
                 | BT_FRAME_FLAG_ELECTRODE_OUT;
}

void bt_replay(bt_finger *finger, const bt_settings *settings, const bt_map *map, int64_t n,
               const uint16_t *words, const uint32_t *t_us, uint8_t *rows)
{
    bt_tare_settings tare_settings = bt_tare_settings_from(settings);
    bt_solve_settings kernel_settings = bt_solve_settings_from(settings);
    bt_pressure_use(&finger->pressure, settings);
    kernel_settings.map = map;
    for (int64_t k = 0; k < n; k++, words += BT_SLOTS, rows += BT_REPLAY_BYTES) {
        uint8_t touch_slot = BT_REPLAY_NO_TOUCH;
        bt_msg_frame msg;
        bt_finger_begin(finger, t_us[k], &tare_settings);
        for (uint8_t slot = 0; slot < BT_SLOTS; slot++) {
            const bool touched = bt_finger_put(finger, slot, words[slot]);
            touch_slot = touched ? slot : touch_slot;
            if (finger->quantities & BT_QUANTITY_FLAG_EVENTS) {
                (void)bt_finger_events(finger, slot, touched);
            }
        }
        bool present = bt_finger_end(finger, &tare_settings);
        if (present) {
            bt_finger_frame(finger, &kernel_settings, finger->quantities, 0, &msg);
        } else {
            mark_absent(finger, &msg);
        }
        bt_msg_frame_pack(&msg, rows);
        uint8_t *rest = rows + BT_FRAME_BYTES;
        rest[0] = present;
        rest[1] = finger->tare.reason;
        rest[2] = touch_slot;
        uint32_t measures[3] = {bt_trigger_energy(&finger->tare.trigger), finger->tare.noise.count2,
                                finger->tare.threshold_count2};
        memcpy(rest + 3, measures, sizeof measures);
    }
}

typedef struct {
    uint8_t *next;
    int64_t room;
    int64_t found;
} event_list;

static void append_events(event_list *list, uint32_t found, bt_finger *finger, uint8_t slot, uint32_t t_us)
{
    for (uint8_t kind = 0; found != 0; kind++, found >>= 1) {
        bt_msg_event msg;
        if (!(found & 1)) {
            continue;
        }
        bt_finger_event(finger, kind, slot, t_us + slot * 1000000u / BT_SLOT_HZ, &msg);
        if (list->found++ < list->room) {
            bt_msg_event_pack(&msg, list->next);
            list->next += BT_EVENT_BYTES;
        }
    }
}

int64_t bt_replay_events(bt_finger *finger, const bt_settings *settings, int64_t n, const uint16_t *words,
                         const uint32_t *t_us, uint8_t *events, int64_t room)
{
    bt_tare_settings tare_settings = bt_tare_settings_from(settings);
    event_list list = {.next = events, .room = room};
    for (int64_t k = 0; k < n; k++, words += BT_SLOTS) {
        bt_finger_begin(finger, t_us[k], &tare_settings);
        for (uint8_t slot = 0; slot < BT_SLOTS; slot++) {
            bool touched = bt_finger_put(finger, slot, words[slot]);
            append_events(&list, bt_finger_events(finger, slot, touched), finger, slot, t_us[k]);
        }
        (void)bt_finger_end(finger, &tare_settings);
    }
    return list.found;
}
