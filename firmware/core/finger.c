#include "finger.h"

#include "fixed_point.h"
#include "solve/poc.h"
#include "touch/adopt.h"

#include <string.h>

#define PDC_FREE 6 // counts above the tare

void bt_finger_reset(bt_finger *finger, uint8_t index)
{
    bt_settings initial;
    memset(finger, 0, sizeof *finger);
    finger->index = index;
    finger->quantities = BT_SUBSCRIBED_AT_FIRST;
    bt_finger_forget(finger);
    bt_settings_reset(&initial);
    bt_pressure_use(&finger->pressure, &initial);
    bt_round_clear(&finger->round);
}

void bt_finger_begin(bt_finger *finger, uint32_t t_us, const bt_tare_settings *settings)
{
    bt_tare_begin(&finger->tare, settings);
    finger->round.t_us = t_us;
    finger->round.good_words = 0;
    finger->next_slot = 0;
    finger->events.slip_level = BT_SLIP_LEVEL_NONE; // until all of this round's PAC has come
}

static bool place(bt_finger *finger, uint8_t slot, uint16_t count)
{
    bt_round *round = &finger->round;
    unsigned channel = bt_slot_channel[slot];
    round->good_words = (uint8_t)(round->good_words + (count != BT_INVALID_COUNT));
    if (channel == BT_CHANNEL_PAC) {
        round->pac[bt_slot_pac[slot]] = count;
        return false;
    }
    unsigned electrode = channel - BT_CHANNEL_E1;
    if (electrode < BT_ELECTRODES) {
        round->electrode[electrode] = count;
        return bt_tare_electrode(&finger->tare, electrode, count);
    }
    switch (channel) {
    case BT_CHANNEL_PDC:
        round->pdc = count;
        return bt_tare_pressure(&finger->tare, count);
    case BT_CHANNEL_TAC:
        round->tac = count;
        break;
    case BT_CHANNEL_TDC:
        round->tdc = count;
        bt_tare_temperature(&finger->tare, count);
        break;
    }
    return false;
}

// Fill the skipped slots before this one with missing words.
static BT_NOINLINE bool fill(bt_finger *finger, uint8_t slot)
{
    bool touched = false;
    while (finger->next_slot < slot) {
        touched = place(finger, finger->next_slot++, BT_INVALID_COUNT) || touched;
    }
    return touched;
}

bool bt_finger_put(bt_finger *finger, uint8_t slot, uint16_t count)
{
    bool late = finger->next_slot < slot && fill(finger, slot);
    finger->next_slot = (uint8_t)(slot + 1);
    return place(finger, slot, count) || late;
}

static bool ends_pac(uint8_t slot)
{
    static const uint8_t pac_slot[] = BT_FINGER_EVENT_SLOTS;
    for (size_t k = 0; k < sizeof pac_slot; k++) {
        if (slot == pac_slot[k]) {
            return true;
        }
    }
    return false;
}

uint32_t bt_finger_events(bt_finger *finger, uint8_t slot, bool touched)
{
    bt_events *events = &finger->events;
    if (touched) {
        return bt_events_touch(events, &finger->tare);
    }
    if (slot == events->strongest_slot) {
        return bt_events_lift(events, &finger->tare);
    }
    if (!ends_pac(slot)) {
        return 0;
    }
    uint16_t none[BT_PAC_PER_FRAME];
    const uint16_t *pac = finger->round.pac;
    if (finger->health.leap.pending || bt_finger_sensor_fault(finger) != BT_SENSOR_FAULT_NONE) {
        memset(none, 0xFF, sizeof none); // another channel's words shake more than any slip
        pac = none;
    }
    return bt_events_pac(events, &finger->tare, pac, bt_slot_pac[slot] + 1u);
}

void bt_finger_event(bt_finger *finger, uint8_t event, uint8_t slot, uint32_t t_us, bt_msg_event *msg)
{
    bt_events_message(&finger->events, event, &finger->tare, t_us, msg);
    msg->seq = finger->seq;
    msg->finger = finger->index;
    msg->slot = slot;
    msg->trust = event == BT_EVENT_KIND_TRUST ? finger->trust : UINT8_MAX;
}

void bt_finger_forget(bt_finger *finger)
{
    bt_tare_reset(&finger->tare);
    finger->health = (bt_health){0};
    bt_events_reset(&finger->events);
    finger->pressure.learned = (bt_pressure_learned){0, 0};
    finger->answered = false;
}

void bt_finger_pass(bt_finger *finger)
{
    if (finger->next_slot < BT_SLOTS) {
        (void)fill(finger, BT_SLOTS);
    }
    finger->next_slot = 0; // a POINT between rounds belongs to the next, of which no word has come yet
    bt_pressure_add(&finger->pressure, finger->round.pdc);
}

// Without pressure nothing touches, whatever the electrodes say, if presses have shown that they move it.
static bool may_be_touched(const bt_finger *finger)
{
    const bt_tare *tare = &finger->tare;
    bool free = tare->witness.moves && bt_tare_pdc_known(tare) && bt_tare_pdc_above(tare) < PDC_FREE;
    return tare->state != BT_TARE_STATE_REST && !free;
}

// What the tare begins anew with, electrodes that rest again, and what a new tare ends.
static void recover(bt_finger *finger)
{
    uint8_t reason = finger->tare.reason;
    bool rests = finger->tare.state == BT_TARE_STATE_REST;
    bool by_host = reason == BT_TARE_REASON_HOST_NOW || reason == BT_TARE_REASON_HOST_SET;
    if (rests) {
        finger->health.alone = 0;
    }
    if (rests && finger->tare_unsent) {
        bt_health_tared(&finger->health, by_host);
        finger->tare.witness.silent = by_host ? 0 : finger->tare.witness.silent;
    }
    if (finger->health.out != 0 && (rests || !bt_usable_without(finger->health.out))) {
        bt_health_back(&finger->health);
    }
}

bool bt_finger_end(bt_finger *finger, const bt_tare_settings *settings)
{
    bt_finger_pass(finger);
    if (finger->round.good_words == 0) {
        finger->present = false;
        finger->silent_rounds = bt_count_up(finger->silent_rounds, BT_UNPLUGGED_ROUNDS);
        return false;
    }
    finger->seq++;
    finger->present = true;
    finger->answered = true;
    finger->silent_rounds = 0;
    // A tare command between two rounds may already have changed the tare.
    finger->tare_unsent = finger->tare.changed;
    bt_health_round(&finger->health, &finger->round, &finger->tare.trigger, &finger->tare.noise,
                    may_be_touched(finger));
    if (finger->health.sensor_fault == BT_SENSOR_FAULT_FROZEN) {
        finger->tare.trigger.without = finger->tare.trigger.odd = BT_ALL_ELECTRODES;
    }
    bt_tare_end(&finger->tare, finger->round.t_us, settings);
    finger->tare_unsent = finger->tare_unsent || finger->tare.changed;
    finger->tare.changed = false;
    recover(finger);
    bt_trigger_leave_out(&finger->tare.trigger, finger->health.out);
    return true;
}

bool bt_finger_idle(const bt_finger *finger)
{
    const bt_tare *tare = &finger->tare;
    bool untouched =
        tare->state == BT_TARE_STATE_REST ? tare->trigger.room >= 0 : tare->state == BT_TARE_STATE_INIT;
    return untouched && !finger->tare_unsent && !(finger->quantities & BT_QUANTITY_FLAG_REST_FRAMES);
}

bool bt_finger_moved(const bt_finger *finger)
{
    uint32_t energy = 0;
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        int32_t change = finger->tare.trigger.smooth.lane[i] - finger->sent.lane[i];
        energy += (uint32_t)(change * change);
    }
    return energy > finger->tare.threshold_count2;
}

uint8_t bt_finger_sensor_fault(const bt_finger *finger)
{
    uint8_t fault = finger->foreign ? BT_SENSOR_FAULT_OTHER_KIND : bt_health_sensor_fault(&finger->health);
    bool silent = fault == BT_SENSOR_FAULT_NONE && bt_witness_silent(&finger->tare.witness);
    return silent ? BT_SENSOR_FAULT_SILENT : fault;
}

// Of the sensor as a whole.
static uint32_t health_flags(const bt_finger *finger)
{
    const bt_trigger *trigger = &finger->tare.trigger;
    // One that several rounds have shown, or that is condemned in this one; and before any round can show it,
    // one that leaps by more than any glitch while no other is far off.
    uint32_t leapt = trigger->leapt & BT_ALL_ELECTRODES;
    bool narrow = bt_usable_without(leapt) && (trigger->far & ~leapt) == 0;
    uint32_t alone = finger->health.alone | (finger->health.out & ~trigger->without) | (narrow ? leapt : 0);
    bool unfelt = bt_tare_touched(&finger->tare) && bt_release_pending(&finger->tare.release);
    bool pending = finger->health.leap.pending || unfelt;
    return finger->sensor_flags | (bt_finger_sensor_fault(finger) != 0 ? BT_FRAME_FLAG_SENSOR_FAULT : 0)
           | (pending ? BT_FRAME_FLAG_LEAP_PENDING : 0) | (alone != 0 ? BT_FRAME_FLAG_ELECTRODE_ALONE : 0);
}

// The sequence number of the round that has ended.
static uint16_t seq_of(const bt_finger *finger)
{
    return (uint16_t)(finger->seq - 1);
}

uint32_t bt_finger_wrench_age(const bt_finger *finger, const bt_solve_settings *settings)
{
    bool has_wrench =
        finger->kept.valid && settings->map != NULL && finger->tare.reason != BT_TARE_REASON_NONE;
    return has_wrench ? (uint16_t)(seq_of(finger) - finger->kept.seq) : BT_REPEAT_MAX_ROUNDS + 1;
}

static void keep_wrench(bt_finger *finger, const bt_msg_frame *msg)
{
    bt_kept_wrench *kept = &finger->kept;
    kept->valid = !(msg->flags & BT_FRAME_FLAG_UNTARED);
    kept->seq = msg->seq;
    memcpy(kept->force_100un, msg->force_100un, sizeof kept->force_100un);
    memcpy(kept->torque_mnmm, msg->torque_mnmm, sizeof kept->torque_mnmm);
    kept->torsion_mnmm = msg->torsion_mnmm;
    kept->grip_mn[0] = msg->normal_mn;
    kept->grip_mn[1] = msg->normal_half_mn;
    kept->grip_mn[2] = msg->shear_mn;
    kept->grip_mn[3] = msg->shear_half_mn;
}

static void repeat_wrench(const bt_kept_wrench *kept, uint8_t quantities, bt_msg_frame *msg)
{
    if (quantities & BT_QUANTITY_FLAG_FORCE) {
        memcpy(msg->force_100un, kept->force_100un, sizeof msg->force_100un);
        msg->normal_mn = kept->grip_mn[0];
        msg->normal_half_mn = kept->grip_mn[1];
        msg->shear_mn = kept->grip_mn[2];
        msg->shear_half_mn = kept->grip_mn[3];
    }
    if (quantities & BT_QUANTITY_FLAG_TORQUE) {
        memcpy(msg->torque_mnmm, kept->torque_mnmm, sizeof msg->torque_mnmm);
        msg->torsion_mnmm = kept->torsion_mnmm;
    }
    msg->flags |= BT_FRAME_FLAG_REPEATED;
    msg->wrench_age_ms = (uint16_t)((uint16_t)(msg->seq - kept->seq) * BT_FRAME_MS);
}

// The results without what is shed; flags distinguish that from what nobody asked for.
static void fill_results(bt_finger *finger, const bt_solve_settings *settings, uint8_t quantities,
                         uint32_t shed, bt_msg_frame *msg)
{
    const uint32_t wrench = BT_QUANTITY_FLAG_FORCE | BT_QUANTITY_FLAG_TORQUE;
    uint32_t without = shed & BT_SHED_MAP ? wrench : 0;
    bt_results(&finger->round, &finger->tare, settings, quantities & ~without, msg);
    if (settings->map != NULL) {
        bt_pressure_witness(&finger->pressure.learned, settings->map, msg);
    }
    msg->wrench_age_ms = 0;
    if (shed & BT_SHED_MAP) {
        msg->flags = (msg->flags & ~BT_FRAME_FLAG_NOT_ASKED) | bt_not_asked(quantities);
        repeat_wrench(&finger->kept, quantities, msg);
    } else if (settings->map != NULL) {
        keep_wrench(finger, msg);
    }
    msg->flags |= finger->shed ? BT_FRAME_FLAG_SHED : 0;
    finger->shed = false;
}

void bt_finger_frame(bt_finger *finger, const bt_solve_settings *settings, uint8_t quantities, uint32_t shed,
                     bt_msg_frame *msg)
{
    const bt_round *round = &finger->round;
    quantities &= finger->foreign ? (uint8_t)~BT_WANT_ALL : UINT8_MAX; // its electrodes lie elsewhere
    msg->seq = seq_of(finger);
    msg->t_us = round->t_us;
    msg->finger = finger->index;
    msg->tare_state = finger->tare.state;
    msg->pdc = round->pdc;
    msg->tac = round->tac;
    msg->tdc = round->tdc;
    msg->pdc_tare_q4 = bt_tare_q4(finger->tare.base.pdc_q16);
    memcpy(msg->counts, round->electrode, sizeof msg->counts);
    memcpy(msg->tare_q4, finger->tare.electrode_q4, sizeof msg->tare_q4);
    fill_results(finger, settings, quantities, shed, msg);
    msg->flags |= health_flags(finger);
    msg->electrodes_out = finger->tare.trigger.without;
    msg->slip_level = finger->events.slip_level;
    bool asked = quantities & BT_QUANTITY_FLAG_PRESSURE;
    msg->pdc_filtered_q4 = asked ? bt_pressure_filtered_q4(&finger->pressure) : BT_INVALID_COUNT;
    msg->pressure_force_100un =
        bt_pressure_force(msg->pdc_filtered_q4, msg->pdc_tare_q4, finger->pressure.gain_nn);
    msg->flags |= finger->tare_unsent ? BT_FRAME_FLAG_TARE_CHANGED : 0;
    bool valid = msg->force_100un[2] != BT_INVALID_I32;
    finger->trust = valid ? bt_trust(msg->flags, msg->normal_mn, msg->normal_half_mn) : BT_TRUST_NONE;
    msg->trust = finger->trust;
    finger->sent = finger->tare.trigger.smooth;
}

uint32_t bt_finger_flags(const bt_finger *finger)
{
    return bt_channel_flags(&finger->round, &finger->tare) | health_flags(finger);
}

bool bt_finger_trust_changed(bt_finger *finger)
{
    bool higher = finger->trust > finger->trust_reported;
    finger->trust_rounds = higher ? (uint8_t)(finger->trust_rounds + 1) : 0;
    if (finger->trust == finger->trust_reported || (higher && finger->trust_rounds < BT_TRUST_ROUNDS)) {
        return false;
    }
    finger->trust_reported = finger->trust;
    finger->trust_rounds = 0;
    return true;
}

void bt_finger_idle_message(const bt_finger *finger, bool frame_follows, bt_msg_idle *msg)
{
    msg->seq = (uint16_t)(seq_of(finger) - frame_follows);
    msg->t_us = finger->round.t_us;
    msg->finger = finger->index;
    msg->tare_state = finger->tare.state;
    msg->flags = bt_finger_flags(finger) | BT_FRAME_FLAG_NOT_ASKED;
    msg->trust = bt_trust(msg->flags, 0, 0);
    msg->frames = finger->unsent;
    msg->energy_count2 = bt_trigger_energy(&finger->tare.trigger);
    msg->pdc = finger->round.pdc;
    msg->tdc = finger->round.tdc;
}

static uint32_t first_pac_us(const bt_finger *finger)
{
    return finger->round.t_us + BT_FIRST_PAC_SLOT * 1000000u / BT_SLOT_HZ;
}

void bt_finger_pac(const bt_finger *finger, bt_msg_pac *msg)
{
    msg->seq = seq_of(finger);
    msg->t_us = first_pac_us(finger);
    msg->finger = finger->index;
    memcpy(msg->pac, finger->round.pac, sizeof msg->pac);
}

void bt_finger_tare(const bt_finger *finger, bt_msg_tare *msg)
{
    const bt_tare *tare = &finger->tare;
    msg->seq = seq_of(finger);
    msg->t_us = finger->round.t_us;
    msg->finger = finger->index;
    msg->tare_state = tare->state;
    msg->reason = tare->reason;
    msg->noise_count2 = tare->noise.count2;
    memcpy(msg->tare_q16, tare->base.electrode_q16, sizeof msg->tare_q16);
    msg->pdc_tare_q16 = tare->base.pdc_q16;
}

void bt_finger_point(bt_finger *finger, const bt_solve_settings *settings, bt_msg_point *msg)
{
    int32_t e_q4[BT_ELECTRODES];
    bt_point point = {.um = {BT_INVALID_I16, BT_INVALID_I16, BT_INVALID_I16}};
    bt_point_signals(&finger->round, &finger->tare, e_q4);
    if (finger->tare.tared && !finger->foreign) {
        (void)bt_poc(e_q4, settings->poc_weights, &point);
    }
    msg->finger = finger->index;
    msg->seq = finger->seq;
    msg->slot = finger->next_slot;
    msg->tare_state = finger->tare.state;
    memcpy(msg->poc_um, point.um, sizeof msg->poc_um);
}
