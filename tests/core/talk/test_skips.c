// Skipped work must leave no trace in the rest: the same course through a session that computes and
// sends everything, and through sessions that skip, compared message by message.
#include "course.h"

static course_log full, lean, short_of_room;

#define WANTED_AT_ALL                                                                                        \
    (BT_QUANTITY_FLAG_POC | BT_QUANTITY_FLAG_FORCE | BT_QUANTITY_FLAG_TORQUE | BT_QUANTITY_FLAG_PRESSURE)

#define BY_POPULATION (BT_FRAME_FLAG_POPULATION | BT_FRAME_FLAG_OUTSIDE)

static const uint8_t subscriptions[] = {
    0,
    BT_QUANTITY_FLAG_POC,
    BT_QUANTITY_FLAG_FORCE,
    BT_QUANTITY_FLAG_TORQUE,
    BT_QUANTITY_FLAG_TOUCH,
    BT_QUANTITY_FLAG_PRESSURE,
    BT_QUANTITY_FLAG_POC | BT_QUANTITY_FLAG_FORCE,
    BT_QUANTITY_FLAG_FORCE,
    BT_QUANTITY_FLAG_POC | BT_QUANTITY_FLAG_FORCE,
    BT_QUANTITY_FLAG_POC | BT_QUANTITY_FLAG_TORQUE,
    BT_QUANTITY_FLAG_FORCE | BT_QUANTITY_FLAG_TORQUE | BT_QUANTITY_FLAG_TOUCH,
    WANTED_AT_ALL,
    WANTED_AT_ALL | BT_QUANTITY_FLAG_TOUCH,
};

BEFORE_EACH(the_full_course)
{
    if (full.count == 0) {
        run_course(EVERYTHING, 1, &full, NULL);
    }
}

// A FRAME as sent with these quantities (MESSAGES.md).
static void as_subscribed(bt_msg_frame *frame, uint8_t quantities)
{
    bool poc = quantities & BT_QUANTITY_FLAG_POC, force = quantities & BT_QUANTITY_FLAG_FORCE;
    bool torque = quantities & BT_QUANTITY_FLAG_TORQUE;
    bool pressure = quantities & BT_QUANTITY_FLAG_PRESSURE;
    frame->trust = force ? frame->trust : BT_TRUST_NONE;
    frame->flags |= poc && force && torque && pressure ? 0 : BT_FRAME_FLAG_NOT_ASKED;
    frame->flags &= poc ? ~0u : ~(uint32_t)BT_FRAME_FLAG_TORSION_OK;
    if (!poc && !torque && !(frame->flags & BT_FRAME_FLAG_UNTARED)) {
        frame->flags &= ~(uint32_t)BT_FRAME_FLAG_POC_INVALID;
    }
    frame->flags &= force || torque ? ~0u : ~(uint32_t)BY_POPULATION;
    frame->pdc_filtered_q4 = pressure ? frame->pdc_filtered_q4 : 0xFFFF;
    frame->pressure_force_100un = pressure ? frame->pressure_force_100un : INT32_MIN;
    frame->torsion_mnmm = torque ? frame->torsion_mnmm : INT32_MIN;
    if (!poc || !force) { // no interval either, so do not act on the force
        frame->trust = frame->trust == BT_TRUST_ACT ? BT_TRUST_INTERVAL : frame->trust;
        frame->normal_mn = frame->normal_half_mn = frame->shear_mn = frame->shear_half_mn = 0xFFFF;
    }
    for (int d = 0; d < 3; d++) {
        frame->poc_um[d] = poc ? frame->poc_um[d] : INT16_MIN;
        frame->force_100un[d] = force ? frame->force_100un[d] : INT32_MIN;
        frame->torque_mnmm[d] = torque ? frame->torque_mnmm[d] : INT32_MIN;
    }
}

static int messages_of(const course_log *log, uint8_t id, int finger)
{
    int n = 0;
    for (int k = 0; k < log->count; k++) {
        n += log->message[k].id == id && is_from_finger(&log->message[k], finger);
    }
    return n;
}

static void assert_frames_are_those_of_the_full_session(uint8_t quantities)
{
    for (int k = 0; k < lean.count; k++) {
        const received_message *message = &lean.message[k];
        if (message->id != BT_FRAME_ID) {
            continue;
        }
        uint8_t want[BT_FRAME_BYTES];
        bt_msg_frame frame;
        const received_message *same = find_message(&full, BT_FRAME_ID, message->payload[6], seq_at(message));
        assert_non_null(same);
        bt_msg_frame_unpack(&frame, same->payload);
        as_subscribed(&frame, quantities);
        bt_msg_frame_pack(&frame, want);
        for (int byte = 0; byte < BT_FRAME_BYTES; byte++) {
            if (message->payload[byte] != want[byte]) {
                fail_msg("quantities 0x%02X: FRAME %u differs at byte %d", quantities, seq_at(message), byte);
            }
        }
    }
}

TEST(the_course_has_everything_in_it)
{
    uint32_t seen = 0;
    int states[4] = {0}, grips = 0, pressures = 0;
    for (int k = 0; k < full.count; k++) {
        bt_msg_frame frame;
        if (full.message[k].id != BT_FRAME_ID) {
            continue;
        }
        bt_msg_frame_unpack(&frame, full.message[k].payload);
        seen |= frame.flags;
        states[frame.tare_state]++;
        pressures += frame.pressure_force_100un != INT32_MIN;
        grips += frame.normal_half_mn != 0xFFFF;
    }
    // All but a railed electrode and a degree; and no returned sensor is asked for a serial number.
    uint32_t all = ((1u << 18) - 1 - (1u << 10)) | BT_FRAME_FLAG_SENSOR_UNSURE | BT_FRAME_FLAG_TARE_UNSURE
                   | BY_POPULATION | BT_FRAME_FLAG_ELECTRODE_OUT;
    assert_int_equal(seen,
                     all & ~(uint32_t)(BT_FRAME_FLAG_RAIL | BT_FRAME_FLAG_TEMP | BT_FRAME_FLAG_NOT_ASKED));
    for (int s = 0; s < 4; s++) {
        assert_true(states[s] > 10);
    }
    assert_true(grips > 100);
    assert_true(pressures > 100);
    assert_true(messages_of(&full, BT_TOUCH_ID, FIRST_FINGER) >= 4);
    assert_true(messages_of(&full, BT_TARE_ID, FIRST_FINGER) >= 8);
}

// ---- every round is accounted for ------------------------------------------------------------------

static bool must_be_sent(const bt_msg_frame *frame)
{
    return frame->tare_state == BT_TARE_STATE_CONTACT || frame->tare_state == BT_TARE_STATE_FAULT
           || frame->flags & BT_FRAME_FLAG_TARE_CHANGED;
}

// Walks one finger's messages; returns the number of rounds reported.
static int tile(const course_log *log, int finger, int idle_rounds)
{
    int next = 0; // the round that the next message has to begin with
    for (int k = 0; k < log->count; k++) {
        const received_message *message = &log->message[k];
        if (!is_from_finger(message, finger) || (message->id != BT_FRAME_ID && message->id != BT_IDLE_ID)) {
            continue;
        }
        assert_true(next > 0 || message->id == BT_FRAME_ID); // the first is a FRAME
        if (message->id == BT_FRAME_ID) {
            assert_int_equal(seq_at(message), next++);
            continue;
        }
        bt_msg_idle idle;
        bt_msg_frame frame;
        bt_msg_idle_unpack(&idle, message->payload);
        assert_in_range(idle.frames, 1, idle_rounds);
        assert_int_equal(idle.seq - idle.frames + 1, next);
        for (; next <= idle.seq; next++) {
            bt_msg_frame_unpack(&frame, find_message(&full, BT_FRAME_ID, finger, (uint16_t)next)->payload);
            assert_false(must_be_sent(&frame));
        }
        // The rest belongs to the last round, or to the one with a FRAME behind it.
        bool follows = idle.frames < idle_rounds;
        if (follows) {
            bt_msg_frame_unpack(&frame, find_message(&full, BT_FRAME_ID, finger, (uint16_t)next)->payload);
            const received_message *after = message + 1;
            after += after->id == BT_TARE_ID;
            assert_true(after->id == BT_FRAME_ID && is_from_finger(after, finger) && seq_at(after) == next);
        }
        uint32_t computed = BT_FRAME_FLAG_POC_LOW | BT_FRAME_FLAG_SHEAR_MIX | BT_FRAME_FLAG_TORSION_OK
                            | BT_FRAME_FLAG_TARE_CHANGED | BY_POPULATION;
        computed |= frame.flags & BT_FRAME_FLAG_UNTARED ? 0 : BT_FRAME_FLAG_POC_INVALID;
        assert_int_equal(idle.flags, (frame.flags & ~computed) | BT_FRAME_FLAG_NOT_ASKED);
        assert_int_equal(idle.t_us, frame.t_us);
        assert_int_equal(idle.tare_state, frame.tare_state);
        assert_int_equal(idle.pdc, frame.pdc);
        assert_int_equal(idle.tdc, frame.tdc);
    }
    return next;
}

static void assert_rounds_are_tiled(uint8_t quantities)
{
    int marked = 0, frames = 0, rounds = 0;
    for (int f = FIRST_FINGER; f <= SECOND_FINGER; f += SECOND_FINGER - FIRST_FINGER) {
        int all = messages_of(&full, BT_FRAME_ID, f);
        int tiled = tile(&lean, f, 10);
        int sent = messages_of(&lean, BT_FRAME_ID, f);
        assert_in_range(all - tiled, 0, 9); // less than a heartbeat is untold
        if (quantities & BT_QUANTITY_FLAG_REST_FRAMES) {
            assert_int_equal(sent, all);
        } else {
            assert_true(sent < all * 3 / 4);
        }
        marked += tiled;
        frames += sent;
        rounds += all;
    }
    assert_true(marked > 2 * (COURSE_ROUNDS - 60));
    // STATUS against a count of the messages that came.
    bool torque = quantities & BT_QUANTITY_FLAG_TORQUE;
    int idle = rounds - frames;
    assert_int_equal(lean.status.frames_idle, idle);
    assert_int_equal(lean.status.poc_skipped, torque || quantities & BT_QUANTITY_FLAG_POC ? idle : rounds);
    assert_int_equal(lean.status.force_skipped,
                     torque || quantities & BT_QUANTITY_FLAG_FORCE ? idle : rounds);
    assert_int_equal(lean.status.torque_skipped, torque ? idle : rounds);
    assert_int_equal(lean.status.messages_dropped, 0);
}

static void assert_tares_come_with_their_frame(void)
{
    for (int f = FIRST_FINGER; f <= SECOND_FINGER; f += SECOND_FINGER - FIRST_FINGER) {
        assert_int_equal(messages_of(&lean, BT_TARE_ID, f), messages_of(&full, BT_TARE_ID, f));
    }
    for (int k = 0; k < lean.count; k++) {
        const received_message *message = &lean.message[k], *next = message + 1;
        if (message->id != BT_TARE_ID) {
            continue;
        }
        const received_message *same = find_message(&full, BT_TARE_ID, message->payload[6], seq_at(message));
        assert_memory_equal(message->payload, same->payload, BT_TARE_BYTES);
        assert_true(k + 1 < lean.count && next->id == BT_FRAME_ID);
        assert_true(is_from_finger(next, message->payload[6]) && seq_at(next) == seq_at(message));
        bt_msg_frame frame;
        bt_msg_frame_unpack(&frame, next->payload);
        assert_true(frame.flags & BT_FRAME_FLAG_TARE_CHANGED);
    }
}

// ---- touches ---------------------------------------------------------------------------------------

static void assert_touches_come_in_their_slot(uint8_t quantities)
{
    for (int f = FIRST_FINGER; f <= SECOND_FINGER; f += SECOND_FINGER - FIRST_FINGER) {
        int wanted = quantities & BT_QUANTITY_FLAG_TOUCH ? messages_of(&full, BT_TOUCH_ID, f) : 0;
        assert_int_equal(messages_of(&lean, BT_TOUCH_ID, f), wanted);
    }
    for (int k = 0; k < lean.count; k++) {
        bt_msg_touch touch;
        bt_msg_frame frame;
        if (lean.message[k].id != BT_TOUCH_ID) {
            continue;
        }
        bt_msg_touch_unpack(&touch, lean.message[k].payload);
        const received_message *same = find_message(&full, BT_TOUCH_ID, touch.finger, touch.seq);
        assert_memory_equal(lean.message[k].payload, same->payload, BT_TOUCH_BYTES);
        // The FRAME is the finger's next that is not an IDLE or TARE of the same round.
        int at = k + 1;
        while (!is_from_finger(&lean.message[at], touch.finger) || lean.message[at].id != BT_FRAME_ID) {
            at++;
            assert_true(at < lean.count);
        }
        bt_msg_frame_unpack(&frame, lean.message[at].payload);
        assert_int_equal(frame.seq, touch.seq);
        assert_int_equal(touch.t_us - frame.t_us, touch.slot * 1000000 / 4400);
        unsigned channel = bt_slot_channel[touch.slot];
        assert_true(channel == BT_CHANNEL_PDC || channel - BT_CHANNEL_E1 < BT_ELECTRODES);
        assert_true(channel == BT_CHANNEL_PDC || touch.energy_count2 > 1000);
    }
}

TEST(what_is_left_out_leaves_no_trace_in_what_is_not)
{
    assert_int_equal(full.status.frames_idle + full.status.poc_skipped + full.status.force_skipped
                         + full.status.torque_skipped,
                     0);
    for (size_t k = 0; k < sizeof subscriptions; k++) {
        for (int rest = 0; rest < 2; rest++) {
            uint8_t quantities = (uint8_t)(subscriptions[k] | (rest ? BT_QUANTITY_FLAG_REST_FRAMES : 0));
            run_course(quantities, 1, &lean, NULL);
            assert_frames_are_those_of_the_full_session(quantities);
            assert_rounds_are_tiled(quantities);
            assert_tares_come_with_their_frame();
            assert_touches_come_in_their_slot(quantities);
        }
    }
}

// ---- a link without room ---------------------------------------------------------------------------

static uint64_t room_seed;

static void little_room(int k)
{
    if (k % 3 == 0) {
        host.room = (size_t)random_range(&room_seed, 0, 500);
    }
}

TEST(what_finds_no_room_is_missing_and_nothing_else_changes)
{
    static const uint8_t quantities[] = {WANTED_AT_ALL | BT_QUANTITY_FLAG_TOUCH, EVERYTHING};
    for (int q = 0; q < 2; q++) {
        run_course(quantities[q], 1, &lean, NULL);
        room_seed = 81;
        run_course(quantities[q], 1, &short_of_room, little_room);
        int lost = 0;
        for (int k = 0; k < lean.count; k++) { // the lean stream equals the full one, with holes
            int at = k - lost;
            bool came =
                at < short_of_room.count && short_of_room.message[at].id == lean.message[k].id
                && memcmp(short_of_room.message[at].payload, lean.message[k].payload, lean.message[k].bytes)
                       == 0;
            lost += !came;
        }
        assert_int_equal(lean.count - lost, short_of_room.count);
        assert_int_equal(short_of_room.status.messages_dropped, lost);
        assert_int_equal(short_of_room.status.frames_idle, lean.status.frames_idle);
        assert_true(lost > 100);
    }
}
