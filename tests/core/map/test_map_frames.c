// The fields of a frame while a wrench map is in force.
#include "emulated_finger.h"
#include "map_words.h"
#include "solve/results.h"

static bt_msg_frame published(emulated_finger *finger, const bt_map *map, uint16_t pdc, uint32_t quantities)
{
    bt_settings all;
    bt_settings_reset(&all);
    if (map == NULL) { // a map stands before the population map, with the flags of Lin's scales
        (void)bt_settings_set(&all, BT_SETTING_FORCE_MODEL, BT_FORCE_MODEL_LIN);
    }
    bt_solve_settings settings = bt_solve_settings_from(&all);
    assert_true(settings.map == NULL);
    settings.map = map;
    bt_round frame = next_frame(finger);
    frame.pdc = pdc;
    finger->tare.noise.count2 = 400;
    bt_msg_frame msg;
    memset(&msg, 0, sizeof msg);
    bt_results(&frame, &finger->tare, &settings, quantities, &msg);
    memcpy(msg.counts, frame.electrode, sizeof msg.counts);
    return msg;
}

static emulated_finger pressed(void)
{
    emulated_finger finger = new_finger();
    finger.sigma = 0;
    finger.has_pdc = true;
    run_seconds(&finger, 5);
    load_by(&finger, 400, 50);
    (void)run_until(&finger, BT_TARE_STATE_CONTACT, 10);
    return finger;
}

static void mixed_map(blob *stored, bt_map *map, uint32_t axes)
{
    begin(stored, axes, 2);
    block(stored, BT_MAP_KIND_SIGNAL, BT_MAP_GATE_ONE, 6);
    block(stored, BT_MAP_KIND_PRESSURE, BT_MAP_GATE_X, 4);
    uint32_t signal = fill(stored, BT_MAP_KIND_SIGNAL, 0), pressure = fill(stored, BT_MAP_KIND_PRESSURE, 0);
    for (uint32_t k = 0; k < columns_of[BT_MAP_KIND_SIGNAL] * axes; k++) {
        *half(stored, signal, BT_MAP_KIND_SIGNAL, k / axes, k % axes) =
            (int16_t)(40 + 13 * (k % 7) - (k % axes == 1 ? 400 : 0));
    }
    for (uint32_t k = 0; k < axes; k++) {
        *half(stored, pressure, BT_MAP_KIND_PRESSURE, 0, k) = (int16_t)(100 + k);
    }
    assert_int_equal(opened(stored, map), BT_ERROR_OK);
}

TEST(a_mapped_frame_has_the_maps_force_and_says_so)
{
    static blob stored;
    bt_map map;
    emulated_finger finger = pressed();
    uint32_t rest_q4 = (finger.tare.base.pdc_q16 + (1 << 11)) >> 12;
    for (size_t k = 0; k < SOME_AXES; k++) {
        uint32_t axes = axes_of[k];
        mixed_map(&stored, &map, axes);
        map.margin.base_mn[0] = BT_INVALID_COUNT;
        bt_msg_frame plain = published(&finger, NULL, 1400, BT_WANT_ALL);
        bt_msg_frame msg = published(&finger, &map, 1400, BT_WANT_ALL);
        assert_memory_equal(plain.counts, msg.counts, sizeof msg.counts);
        assert_int_equal(msg.flags, plain.flags | BT_FRAME_FLAG_MAPPED | BT_FRAME_FLAG_OUTSIDE);
        assert_memory_equal(msg.poc_um, plain.poc_um, sizeof msg.poc_um);
        assert_int_equal(msg.normal_half_mn, 0xFFFF); // the map does not know
        assert_int_not_equal(plain.normal_half_mn, 0xFFFF);
        assert_int_not_equal(msg.normal_mn, plain.normal_mn);
        int32_t force[3], torque[3], torsion = BT_INVALID_I32;
        bt_map_wrench(&map, msg.counts, finger.tare.electrode_q4, 16 * 1400 - (int32_t)rest_q4, force, torque,
                      &torsion);
        assert_int_equal(plain.torsion_mnmm, BT_INVALID_I32);
        assert_int_equal(msg.torsion_mnmm, torsion);
        assert_true((torsion != BT_INVALID_I32) == (axes == 7));
        assert_memory_equal(msg.force_100un, force, sizeof force);
        for (int d = 0; d < 3; d++) {
            assert_int_not_equal(force[d], plain.force_100un[d]);
        }
        if (axes > 3) {
            assert_memory_equal(msg.torque_mnmm, torque, sizeof torque);
            continue;
        }
        assert_memory_equal(msg.torque_mnmm + 1, plain.torque_mnmm + 1, 2 * sizeof *torque);
        // x is the published point times the published force, within the rounding of the point to um.
        double y_mn = force[1] / 10.0, z_mn = force[2] / 10.0;
        double x = (msg.poc_um[1] * z_mn - msg.poc_um[2] * y_mn) / 1000;
        assert_true(fabs(msg.torque_mnmm[0] - x) < 0.6 + 0.0006 * (fabs(y_mn) + fabs(z_mn)));
        assert_int_not_equal(msg.torque_mnmm[0], plain.torque_mnmm[0]);
    }
}

TEST(without_pressure_a_map_that_needs_it_gives_nothing)
{
    static blob stored;
    bt_map map;
    emulated_finger finger = pressed();
    for (size_t k = 0; k < SOME_AXES; k++) {
        uint32_t axes = axes_of[k];
        mixed_map(&stored, &map, axes);
        map.margin.base_mn[0] = BT_INVALID_COUNT;
        bt_msg_frame plain = published(&finger, NULL, BT_INVALID_COUNT, BT_WANT_ALL);
        bt_msg_frame msg = published(&finger, &map, BT_INVALID_COUNT, BT_WANT_ALL);
        assert_int_equal(msg.flags, plain.flags | BT_FRAME_FLAG_MAPPED | BT_FRAME_FLAG_OUTSIDE);
        assert_int_equal(msg.torsion_mnmm, BT_INVALID_I32);
        assert_true(msg.flags & BT_FRAME_FLAG_PDC_MISSING);
        for (int d = 0; d < 3; d++) {
            assert_int_equal(msg.force_100un[d], BT_INVALID_I32);
            bool by_gains = axes == 3 && d > 0;
            assert_int_equal(msg.torque_mnmm[d], by_gains ? plain.torque_mnmm[d] : BT_INVALID_I32);
        }
        uint32_t known = finger.tare.base.pdc_q16;
        finger.tare.base.pdc_q16 = BT_TARE_UNKNOWN; // a pressure, but nothing to compare it with
        msg = published(&finger, &map, 1400, BT_WANT_ALL);
        assert_int_equal(msg.force_100un[0], BT_INVALID_I32);
        finger.tare.base.pdc_q16 = known;
    }
    one_block(&stored, 3, BT_MAP_KIND_SIGNAL, BT_MAP_GATE_ONE, 6, 30); // needs none
    assert_int_equal(opened(&stored, &map), BT_ERROR_OK);
    assert_int_not_equal(published(&finger, &map, BT_INVALID_COUNT, BT_WANT_ALL).force_100un[0],
                         BT_INVALID_I32);
}

TEST(what_is_not_asked_for_changes_nothing_that_is)
{
    static blob stored;
    bt_map map;
    emulated_finger finger = pressed();
    for (size_t k = 0; k < SOME_AXES; k++) {
        uint32_t axes = axes_of[k];
        mixed_map(&stored, &map, axes);
        bt_msg_frame all = published(&finger, &map, 1400, BT_WANT_ALL);
        for (uint32_t wanted = 0; wanted <= BT_WANT_ALL; wanted++) {
            bt_msg_frame msg = published(&finger, &map, 1400, wanted);
            bool force = wanted & BT_WANT_FORCE, torque = wanted & BT_WANT_TORQUE, poc = wanted & BT_WANT_POC;
            assert_int_equal(msg.torsion_mnmm, torque ? all.torsion_mnmm : BT_INVALID_I32);
            for (int d = 0; d < 3; d++) {
                assert_int_equal(msg.force_100un[d], force ? all.force_100un[d] : BT_INVALID_I32);
                assert_int_equal(msg.torque_mnmm[d], torque ? all.torque_mnmm[d] : BT_INVALID_I32);
                assert_int_equal(msg.poc_um[d], poc ? all.poc_um[d] : BT_INVALID_I16);
            }
        }
    }
    finger.tare.tared = false;
    bt_msg_frame msg = published(&finger, &map, 1400, BT_WANT_ALL);
    assert_true(msg.flags & BT_FRAME_FLAG_UNTARED && !(msg.flags & BT_FRAME_FLAG_MAPPED));
    assert_int_equal(msg.force_100un[2], BT_INVALID_I32);
    assert_int_equal(msg.torsion_mnmm, BT_INVALID_I32);
}

// SPEC.md, Grip: 3 mN of normal and of shear for each count by which it last read further from rest.
TEST(each_count_that_an_electrode_takes_along_widens_both_by_3_mn)
{
    static blob stored;
    bt_map map;
    emulated_finger finger = pressed();
    bt_trigger *trigger = &finger.tare.trigger;
    bt_msg_frame msg[2];
    mixed_map(&stored, &map, BT_MAP_AXES_FORCE);
    map.margin = (bt_margin){{50, 50}, {0, 0}};
    trigger->without = trigger->odd = 1u << 7;
    for (int k = 0; k < 2; k++) {
        trigger->smooth.lane[7] = (uint16_t)(trigger->rest.lane[7] - 1000 - 100 * k);
        msg[k] = published(&finger, &map, 1400, BT_WANT_ALL);
        assert_true(msg[k].flags & BT_FRAME_FLAG_ELECTRODE_OUT);
        assert_int_equal(msg[k].normal_half_mn, msg[k].shear_half_mn);
    }
    assert_int_equal(msg[1].normal_half_mn - msg[0].normal_half_mn, 300);
}
