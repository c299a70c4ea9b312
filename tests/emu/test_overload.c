// More to compute than there is time for. The fake port's clock stands still while the main loop works, so
// the work's cost is put where it is done: at the calls that the linker wraps (tests/CMakeLists.txt).
#include "map_blob.h"
#include "rig.h"

#define FINGERS 5

static uint64_t map_ns, frame_ns; // cost of each

// The core's time passes, and with it interrupts come.
static void spend(uint64_t ns)
{
    uint64_t end_ns = fake.now_ns + ns;
    fake_interrupts_until(end_ns);
    fake.now_ns = fake.now_ns > end_ns ? fake.now_ns : end_ns;
}

#define MAP_ARGUMENTS                                                                                        \
    const bt_map *map, const int32_t *e_q4, const uint16_t *counts, const uint16_t *tare_q4, int32_t pdc_q4, \
        int32_t *force_100un, int32_t *torque_mnmm, int32_t *torsion_mnmm, bt_map_parts *parts

void __real_bt_map_wrench_of(MAP_ARGUMENTS);
void __wrap_bt_map_wrench_of(MAP_ARGUMENTS);
void __wrap_bt_map_wrench_of(MAP_ARGUMENTS)
{
    __real_bt_map_wrench_of(map, e_q4, counts, tare_q4, pdc_q4, force_100un, torque_mnmm, torsion_mnmm,
                            parts);
    spend(map_ns);
}

static bool accept_all(const uint8_t *data, size_t bytes)
{
    host.id = 0;
    (void)host_accept(data, bytes);
    spend(host.id == BT_FRAME_ID ? frame_ns : 0);
    return true;
}

// Every finger has a map in RAM and a tare, and every quantity is asked for.
static void start(void)
{
    map_ns = frame_ns = 0;
    boot(START_NS);
    fake_host_accepts = accept_all;
    run_rounds(60);
    for (uint8_t f = 0; f < FINGERS; f++) {
        bt_session *session = &gateway.session;
        size_t bytes = make_map(fake_map_ram[f], f + 1u, 2, "");
        assert_int_equal(bt_map_open(&session->map[f].map, fake_map_ram[f], bytes), BT_ERROR_OK);
        session->solve[f].map = &session->map[f].map;
        session->finger[f].quantities = 0xFF;
        assert_int_not_equal(session->finger[f].tare.reason, BT_TARE_REASON_NONE);
    }
    memset(host.frames, 0, sizeof host.frames);
}

static void run_ms(uint64_t ms)
{
    run_until(fake.now_ns + ms * 1000000);
}

// Guarantees that every overload must leave alone.
static void slots_and_commands_are_kept(void)
{
    assert_int_equal(gateway.session.status.slots_late, 0);
    uint64_t asked_ns = fake.now_ns;
    (void)send(BT_STOP_ID, "\1");
    while (host.error == NO_REPLY && fake.now_ns < asked_ns + 1000000000) {
        run_until(fake.now_ns + 1);
    }
    assert_true(fake.now_ns - asked_ns < 100000000);
    assert_int_equal(gateway.session.status.streams, 0);
}

TEST(what_there_is_time_for_is_all_done)
{
    start();
    map_ns = 1240000; // of the largest map on the RP2040; 80 % with all the rest
    frame_ns = 200000;
    run_ms(3000);
    assert_int_equal(gateway.session.status.wrench_repeated, 0);
    assert_int_equal(gateway.session.status.frames_shed, 0);
    slots_and_commands_are_kept();
}

TEST(first_goes_a_maps_rate_whose_last_wrench_is_repeated_with_its_age)
{
    uint32_t repeated = 0;
    start();
    map_ns = 3000000; // 150 %
    run_ms(3000);
    for (int f = 0; f < FINGERS; f++) {
        int fresh = 0;
        const bt_msg_frame *last = NULL;
        for (int k = 0; k < host.frames[f]; k++) {
            const bt_msg_frame *frame = &host.frame[f][k];
            assert_true(frame->flags & BT_FRAME_FLAG_MAPPED);
            assert_false(frame->flags & BT_FRAME_FLAG_NOT_ASKED);
            if (!(frame->flags & BT_FRAME_FLAG_REPEATED)) {
                assert_int_equal(frame->wrench_age_ms, 0);
                last = frame;
                fresh++;
                continue;
            }
            repeated++;
            assert_non_null(last);
            assert_int_equal(frame->wrench_age_ms, (uint16_t)(frame->seq - last->seq) * 10);
            assert_in_range(frame->wrench_age_ms, 10, 100);
            assert_memory_equal(frame->force_100un, last->force_100un, sizeof last->force_100un);
            assert_memory_equal(frame->torque_mnmm, last->torque_mnmm, sizeof last->torque_mnmm);
            assert_int_equal(frame->torsion_mnmm, last->torsion_mnmm);
            assert_int_not_equal(frame->poc_um[0], BT_INVALID_I16); // it is cheap, and stays fresh
        }
        assert_in_range(host.frames[f], 298, 301);
        assert_true(fresh > 3 * 10); // at 150 % no finger is starved
    }
    assert_int_equal(repeated, gateway.session.status.wrench_repeated);
    assert_int_equal(gateway.session.status.frames_shed, 0);
    slots_and_commands_are_kept();
}

TEST(whole_frames_go_last)
{
    int frames = 0;
    start();
    frame_ns = 3000000; // 150 % for packing alone
    map_ns = 500000;
    run_ms(3000);
    const bt_msg_status *status = &gateway.session.status;
    assert_true(status->frames_shed > 100 && status->wrench_repeated > 0);
    for (int f = 0; f < FINGERS; f++) {
        for (int k = 1; k < host.frames[f]; k++) {
            const bt_msg_frame *frame = &host.frame[f][k];
            if (frame->seq - frame[-1].seq != 1) {
                assert_true(frame->flags & BT_FRAME_FLAG_SHED);
            }
        }
        assert_true(host.frames[f] > 30);
        frames += host.frames[f];
    }
    assert_in_range(frames + (int)status->frames_shed, 1485, 1505); // none is lost without a count
    slots_and_commands_are_kept();
}

TEST(a_wrench_is_not_repeated_from_before_a_start)
{
    start();
    run_ms(100);
    const bt_finger *finger = &gateway.session.finger[0];
    assert_true(finger->kept.valid);
    (void)send(BT_STOP_ID, "\1");
    run_ms(20);
    bt_msg_start msg = {2, BT_STREAM_FLAG_FRAMES, 0x1F, 0};
    uint8_t payload[BT_START_BYTES];
    bt_msg_start_pack(&msg, payload);
    (void)send(BT_START_ID, payload);
    memset(host.frames, 0, sizeof host.frames);
    map_ns = 20000000;
    run_ms(30);
    assert_false(host.frame[0][0].flags & BT_FRAME_FLAG_REPEATED);
}
