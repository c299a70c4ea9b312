// The simulated fingers' skin in C, for memory and arithmetic under sanitizers; the results are compared from
// Python (test_counts.py, test_physics.py).
#include "skin/deform.h"
#include "skin/read.h"
#include "support.h"

#include <math.h>

enum { POINTS = BT_ELECTRODES + 3, INSTANTS = 6, ROUNDS = 5 };

static bt_skin_point point[POINTS];
static bt_skin skin = {
    .along_mm = 5,
    .across_mm = 3,
    .squeeze = 1,
    .exponent = 1,
    .bulge_share = 1,
    .hole = 0.4,
    .gap_mm = 2,
    .drag_along_n_mm = 4,
    .drag_across_n_mm = 5,
    .drag_max_mm = 1,
    .drag_reach_mm = 50,
    .lead_mm = 2,
    .lead_roll = 0.2,
    .plate_mm = 3.5,
    .plate_n = 4.5,
    .faint_n = 0.05,
    .pad_reach_mm = 4,
    .skin_mm = 2,
    .lead_reach_mm = 2.5,
    .lead_from_mm = 1,
    .squeeze_max_per_n = 2,
    .torsion_nmm_per_rad = 75,
    .torsion_max_rad = 0.2,
    .tip_from = 0.4,
    .side_from = 0.6,
    .side_to = 0.85,
    .squeeze_max = 4,
    .fixed_share = 0.5,
    .rest_celsius = 30,
    .load_ohm = 1e4,
    .tdc_a = 155183,
    .tdc_b = 46555,
    .tdc_beta_k = 4025,
    .points = POINTS,
    .point = point,
};

// Where x, y, N, shear to the tip and the side, N mm, width, C and mm/s.
static const double poses[INSTANTS][BT_POSE_NUMBERS] = {
    {-3, 1, 0, 0, 0, 0, 7, 30, 0},
    {-3, 1, 2, 0, 0, 0, 7, 30, 0},
    {-3, 1, 2, 0, 0, 0, 7, 30, 0},
    {5.08, 0, 1e-9, 1, -1, 5, 1, 5, 40},
    {-16, 5.08, 50, -20, 20, -60, 10, 60, 0},
    {0, -5.08, 50, 0, 0, 0, 0.5, 30, 1},
};

static double rest_ohm[BT_ELECTRODES], one[BT_ELECTRODES];

BEFORE_EACH(prepare)
{
    for (int k = 0; k < POINTS; k++) {
        bt_skin_point *p = &point[k];
        p->at_mm[0] = -k % 16;
        p->at_mm[2] = -BT_CORE_RADIUS_UM / 1e3;
        p->at2_mm2 = bt_dot(p->at_mm, p->at_mm);
        p->radial[2] = -1;
        p->area_mm2 = k < BT_ELECTRODES ? 0 : 1;
    }
    for (int e = 0; e < BT_ELECTRODES; e++) {
        rest_ohm[e] = 4000;
        one[e] = 1;
        for (int kind = 0; kind < 4; kind++) {
            skin.gain[kind][e] = 1;
        }
    }
}

// Arrays of their own on the heap, where the sanitizer sees a number read too far.
static double *numbers(size_t count)
{
    double *made = calloc(count, sizeof *made);
    assert_non_null(made);
    return made;
}

static bool is_finite(const double *value, size_t count)
{
    for (size_t k = 0; k < count; k++) {
        if (!isfinite(value[k])) {
            return false;
        }
    }
    return true;
}

TEST(states_and_their_deformation_stay_within_their_arrays)
{
    const size_t each = INSTANTS * BT_ELECTRODES;
    double *all = numbers(INSTANTS * BT_CONTACT_NUMBERS), *compression = numbers(each),
           *bulge = numbers(each);
    double *along = numbers(3 * INSTANTS), *half_mm = numbers(INSTANTS);
    bt_contact contact;
    bt_contact_of_poses(INSTANTS, poses[0], skin.rest_celsius, all, &contact);
    assert_true(is_finite(all, INSTANTS * BT_CONTACT_NUMBERS));
    bt_deform(&skin, NULL, INSTANTS, &contact, compression, bulge);
    assert_true(is_finite(compression, each) && is_finite(bulge, each));
    assert_true(compression[0] == 0 && bulge[0] == 0 && compression[BT_ELECTRODES] > 0);
    const size_t row = BT_ELECTRODES * sizeof *bulge;
    assert_memory_equal(bulge + BT_ELECTRODES, bulge + 2 * BT_ELECTRODES, row); // held
    for (int k = 0; k < INSTANTS; k++) {
        along[3 * k] = half_mm[k] = 1;
    }
    bt_footprints round = {half_mm, half_mm, along};
    bt_deform(&skin, &round, INSTANTS, &contact, compression, bulge);
    assert_true(is_finite(compression, each) && is_finite(bulge, each));
    free(half_mm);
    free(along);
    free(bulge);
    free(compression);
    free(all);
}

// The words of ROUNDS rounds that end with the poses, in pieces; noise ends after two of them, and then
// again.
static void read_all(int32_t pieces, uint16_t *words)
{
    const size_t each = INSTANTS * BT_ELECTRODES,
                 drawn = 2 * (2 * BT_ELECTRODES + 3 + 3 * BT_PAC_PER_FRAME) + 2 * each;
    double *all = numbers(INSTANTS * BT_CONTACT_NUMBERS), *both = numbers(2 * each), *noise = numbers(drawn);
    bt_effects *effects = calloc(INSTANTS, sizeof *effects);
    bt_contact contact;
    bt_contact_of_poses(INSTANTS, poses[0], skin.rest_celsius, all, &contact);
    bt_deform(&skin, NULL, INSTANTS, &contact, both, both + each);
    bt_touched touched[2] = {{&contact, both, both + each}, {&contact, both, both + each}};
    bt_skin_finger finger = {rest_ohm, one, one, 0.03, 2000, 100, 1.5, 1 / 1.5, 2.5, 1.5, 0.005};
    bt_effects_of(&skin, &finger, INSTANTS, 2, touched, effects);
    bt_sampling sampling = {10, 1, 9, 200, 0.8, 0.15, 60, 2045, 0.8, 0.5, 2038, 4, 10, 100};
    bt_ringing ringing = {.ring = {1, 0.5, [BT_RING_SAMPLES - 1] = 0.25},
                          .amplitude_counts = 80,
                          .drawn_mm = 0.1,
                          .pac_hz = 2200};
    bt_reader reader = {.ringing = &ringing};
    const int64_t stride = pieces == 1 ? 1 : 0;
    for (int64_t done = 0; done < ROUNDS;) {
        const double *normal = noise, *pairs = noise;
        bt_drawn two = {normal, normal, normal, pairs, pairs, 2, 0};
        done += bt_read(&reader, &sampling, &finger, ROUNDS - done, pieces, effects + done * stride, stride,
                        &two, words + done * BT_SLOTS);
    }
    free(effects);
    free(noise);
    free(both);
    free(all);
}

TEST(rounds_of_any_number_of_pieces_are_read)
{
    for (int32_t pieces = 1; pieces <= INSTANTS; pieces++) {
        uint16_t words[ROUNDS * BT_SLOTS];
        memset(words, 0xFF, sizeof words);
        read_all(pieces, words);
        for (int k = 0; k < ROUNDS * BT_SLOTS; k++) {
            assert_in_range(words[k], 0, BT_FULL_SCALE_COUNT);
        }
    }
}
