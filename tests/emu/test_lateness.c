// Data under a late main loop, a late interrupt, and a late sensor or host.
#include "rig.h"

// ---- a late main loop ----------------------------------------------------------------------------------

static uint32_t missing_words(int finger)
{
    uint32_t n = 0;
    for (int k = 0; k < host.frames[finger]; k++) {
        const bt_msg_frame *frame = &host.frame[finger][k];
        for (int i = 0; i < BT_ELECTRODES; i++) {
            n += frame->counts[i] == BT_INVALID_COUNT;
        }
        n += frame->pdc == BT_INVALID_COUNT;
        n += frame->tac == BT_INVALID_COUNT;
        n += frame->tdc == BT_INVALID_COUNT;
        for (int i = 0; i < BT_PAC_PER_FRAME; i++) {
            n += host.pac[finger][k].pac[i] == BT_INVALID_COUNT;
        }
    }
    return n;
}

TEST(a_late_main_loop_loses_whole_slots_that_are_counted_and_marked)
{
    boot(START_NS);
    run_rounds(20);
    assert_int_equal(missing_words(0), 0);
    fake_interrupts_until(fake.now_ns + 28000000); // within the ring: nothing is lost
    run_rounds(20);
    assert_int_equal(gateway.session.status.slots_late, 0);
    fake_interrupts_until(fake.now_ns + 33000000);
    run_rounds(20);
    uint32_t lost = gateway.session.status.slots_late;
    uint32_t shed = 0;
    assert_in_range(lost, 15, 25); // 33 ms are 145 slots, 128 fit
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        assert_int_equal(missing_words(f), lost); // the same slots for every finger
        for (int k = 1; k < host.frames[f]; k++) {
            int gap = host.frame[f][k].seq - host.frame[f][k - 1].seq - 1;
            assert_int_equal(gap != 0, (host.frame[f][k].flags & BT_FRAME_FLAG_SHED) != 0);
            shed += (uint32_t)gap;
        }
    }
    assert_int_equal(shed,
                     gateway.session.status.frames_shed); // those with slots that had waited for too long
}

TEST(rounds_lost_whole_leave_a_gap_in_time)
{
    boot(START_NS);
    run_rounds(20);
    int before = host.frames[0];
    fake_interrupts_until(fake.now_ns + 200000000);
    run_rounds(20);
    uint32_t gap = 0;
    for (int k = before; k < host.frames[0]; k++) {
        uint32_t step = host.frame[0][k].t_us - host.frame[0][k - 1].t_us;
        gap = step > gap ? step : gap;
    }
    assert_true(gap > 150000);
    assert_in_range(gateway.session.status.slots_late, 740, 770);
    assert_int_equal(host.frame[0][host.frames[0] - 1].flags & BT_FRAME_FLAG_ELECTRODE_MISSING, 0);
}

TEST(t_us_is_that_of_slot_0_even_when_it_was_lost)
{
    uint32_t worst_us = 0;
    int lost = 0;
    for (uint64_t late_us = 29600; late_us < 49000; late_us += 400) {
        boot(START_NS);
        run_rounds(10);
        fake_interrupts_until(fake.now_ns + late_us * 1000);
        run_rounds(4);
        for (int k = 0; k < host.frames[0]; k++) {
            // Rounds begin every 10 ms.
            uint32_t after_us = (host.frame[0][k].t_us - (uint32_t)(t0_ns / 1000)) % 10000;
            uint32_t error_us = after_us < 5000 ? after_us : 10000 - after_us;
            worst_us = error_us > worst_us ? error_us : worst_us;
            lost += host.frame[0][k].counts[0] == BT_INVALID_COUNT;
        }
    }
    assert_true(lost > 5);
    if (worst_us > 1) { // the clock cuts to whole us
        fail_msg("t_us is up to %u us off slot 0", (unsigned)worst_us);
    }
}

TEST(a_held_off_interrupt_loses_slots_and_never_the_time_base)
{
    boot(START_NS);
    run_rounds(10);
    fake.held_off_ns = 1000000; // four slots and a half
    run_rounds(10);
    assert_in_range(gateway.session.status.slots_late, 3, 5);
    assert_int_equal(missing_words(1), gateway.session.status.slots_late);
    uint32_t last = host.frame[1][host.frames[1] - 1].t_us;
    assert_int_equal((last - (uint32_t)(t0_ns / 1000)) % 10000, 0);
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        assert_int_equal(fake.bus.sensor[f].early_reads, 0);
    }
}

// ---- power-up and the link -------------------------------------------------------------------------------

TEST(sensors_are_known_by_name_and_absent_ones_stay_blank)
{
    trouble.finger = 2;
    trouble.absent = true;
    boot(START_NS);
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        const bt_sensor_info *info = &gateway.session.info[f];
        static const bt_sensor_info blank;
        assert_int_equal(info->finger, f);
        assert_int_equal(info->present, f != 2);
        if (f == 2) {
            assert_memory_equal(info->serial, blank.serial, sizeof blank.serial);
            assert_int_equal(info->cpu_khz, 0);
        } else {
            char serial[17] = "BTEMU00000000000";
            serial[15] = (char)('1' + f);
            assert_memory_equal(info->serial, serial, 16);
            assert_int_equal(info->sampling_hz, 4400);
        }
    }
    run_rounds(3);
    fake.bus.sensor[2].present = true; // plugged in later
    run_rounds(3);
    assert_true(gateway.session.finger[2].present);
    assert_true(fake.shortest_gap_ns >= 5000);
}

TEST(a_closed_port_ends_the_stream)
{
    boot(START_NS);
    run_rounds(5);
    fake.link_turns++;
    run_rounds(1);
    int before = host.frames[0];
    run_rounds(5);
    fake.link_turns++;
    run_rounds(5);
    assert_int_equal(host.frames[0], before);
}

// The board hangs while finger 2 is held.
TEST(a_hang_forgets_no_tare_and_no_hold)
{
    for (int damaged = 0; damaged <= 2; damaged++) { // so many of the two copies
        bt_baseline before[BT_MAX_FINGERS];
        boot(START_NS);
        run_rounds(100);
        bt_tare_hold(&gateway.session.finger[2].tare);
        run_rounds(60); // so that both copies know
        for (int f = 0; f < BT_MAX_FINGERS; f++) {
            assert_true(gateway.session.finger[f].tare.tared);
            before[f] = gateway.session.finger[f].tare.base;
        }
        gateway.kept->copy[0].finger[3].tare.base.pdc_q16 ^= damaged > 0;
        gateway.kept->copy[1].finger[3].tare.base.pdc_q16 ^= damaged > 1;
        fake_started_by = BT_FAULT_FLAG_HUNG;
        boot(START_NS);
        fake_started_by = BT_FAULT_FLAG_STARTED;
        const uint16_t restored = gateway.session.status.faults & BT_FAULT_FLAG_TARE_RESTORED;
        assert_int_equal(restored != 0, damaged < 2);
        for (int f = 0; f < BT_MAX_FINGERS; f++) {
            const bt_tare *tare = &gateway.session.finger[f].tare;
            assert_int_equal(tare->tared, damaged < 2);
            assert_int_equal(tare->held, damaged < 2 && f == 2);
            if (damaged < 2) {
                assert_int_equal(tare->reason, BT_TARE_REASON_RESTORED);
                // From the latest whole copy, a second old at most: a tare follows no more than 0.5 count/s.
                for (int i = 0; i < BT_ELECTRODES; i++) {
                    int32_t moved_q16 = (int32_t)(tare->base.electrode_q16[i] - before[f].electrode_q16[i]);
                    assert_in_range(moved_q16 + 32768, 0, 65536);
                }
            }
        }
        run_rounds(1);
        boot(START_NS); // power-on: the memory's content then means nothing
        assert_false(gateway.session.finger[0].tare.tared);
        assert_int_equal(gateway.session.status.faults & BT_FAULT_FLAG_TARE_RESTORED, 0);
    }
}
