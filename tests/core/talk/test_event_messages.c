// EVENTs of a session: who gets them, when, and that nobody pays who does not ask.
#include "../fake_host.h"

static uint32_t t_us;

// A round of finger 0 and 3, electrodes at `count`; returns the slot in which the first EVENT came, or
// BT_SLOTS.
static uint8_t played(uint16_t count)
{
    uint8_t sent_in = BT_SLOTS;
    bt_session_begin(&session, t_us);
    for (uint8_t slot = 0; slot < BT_SLOTS; slot++) {
        uint16_t words[BT_MAX_FINGERS];
        bool electrode = bt_slot_channel[slot] >= BT_CHANNEL_E1;
        for (int f = 0; f < BT_MAX_FINGERS; f++) {
            words[f] = f == 0 || f == 3 ? (electrode ? count : 2000) : BT_INVALID_COUNT;
        }
        int before = host_count(BT_EVENT_ID);
        bt_session_slot(&session, slot, words, t_us + slot * 1000000u / BT_SLOT_HZ);
        sent_in = sent_in == BT_SLOTS && host_count(BT_EVENT_ID) > before ? slot : sent_in;
    }
    bt_session_end_round(&session);
    t_us += BT_FRAME_MS * 1000;
    return sent_in;
}

static void play(int rounds, uint16_t count)
{
    for (int k = 0; k < rounds; k++) {
        (void)played(count);
    }
}

static void rest(void)
{
    t_us = 0;
    play(100, 3000);
    host_forget();
}

// The payload of the only message with this id.
static const uint8_t *only(uint8_t id)
{
    const uint8_t *payload = NULL;
    assert_int_equal(host_count(id), 1);
    for (int k = 0; k < host.count; k++) {
        payload = host.message[k].id == id ? host.message[k].payload : payload;
    }
    return payload;
}

static const uint8_t none[BT_SLOTS];

TEST(who_subscribes_is_told_in_the_slot_that_shows_it)
{
    bt_msg_event event;
    bt_msg_touch touch;
    uint8_t due[BT_SLOTS];
    rest();
    assert_int_equal(subscribe(1 << 3, BT_QUANTITY_FLAG_EVENTS | BT_QUANTITY_FLAG_TOUCH), BT_ERROR_OK);
    assert_int_equal(start(BT_STREAM_FLAG_FRAMES, 1 << 0 | 1 << 3, 0), BT_ERROR_OK);
    (void)played(3000);
    memcpy(due, session.events_due, sizeof due);
    host_forget();
    uint8_t slot = played(2900);
    slot = slot == BT_SLOTS ? played(2900) : slot; // a far word waits for its second
    bt_msg_event_unpack(&event, only(BT_EVENT_ID));
    bt_msg_touch_unpack(&touch, only(BT_TOUCH_ID));
    assert_true(event.kind == BT_EVENT_KIND_TOUCH && event.finger == 3);
    assert_true(event.slot == slot && event.slot == touch.slot);
    assert_true(event.seq == touch.seq && event.t_us == touch.t_us);
    play(10, 2900);
    assert_int_equal(session.events_due[session.finger[3].events.watched], 1 << 3);
    host_forget();
    play(2, 3000);
    assert_memory_equal(session.events_due, due, sizeof due); // nothing more to be watched
    bt_msg_event_unpack(&event, only(BT_EVENT_ID));
    assert_int_equal(event.kind, BT_EVENT_KIND_LIFT);
}

TEST(nobody_is_told_who_did_not_ask_or_does_not_stream)
{
    rest();
    assert_int_equal(start(BT_STREAM_FLAG_FRAMES, 0x1F, 0), BT_ERROR_OK); // not subscribed
    play(20, 2900);
    assert_int_equal(host_count(BT_EVENT_ID), 0);
    assert_memory_equal(session.events_due, none, sizeof none); // so no slot looks for any
    play(100, 3000);
    assert_int_equal(subscribe(0x1F, BT_QUANTITY_FLAG_EVENTS), BT_ERROR_OK);
    assert_int_equal(start(BT_STREAM_FLAG_STATUS, 0x1F, 0), BT_ERROR_OK); // streams nothing they come with
    play(20, 2900);
    assert_int_equal(host_count(BT_EVENT_ID), 0);
    assert_memory_equal(session.events_due, none, sizeof none);
}

TEST(they_come_with_pac_alone_and_end_with_the_subscription)
{
    rest();
    assert_int_equal(subscribe(1 << 0, BT_QUANTITY_FLAG_EVENTS), BT_ERROR_OK);
    assert_int_equal(start(BT_STREAM_FLAG_PAC, 1 << 0, 0), BT_ERROR_OK);
    host_forget();
    play(5, 2900);
    assert_int_equal(host_count(BT_EVENT_ID), 1);
    assert_int_equal(subscribe(1 << 0, 0), BT_ERROR_OK);
    host_forget();
    play(100, 3000);
    assert_int_equal(host_count(BT_EVENT_ID), 0);
    assert_memory_equal(session.events_due, none, sizeof none);
}

int main(void)
{
    return run_all(NULL, new_session);
}
