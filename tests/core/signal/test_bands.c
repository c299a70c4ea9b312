// Bands of dynamic pressure against their definition in double, and what they do with lost words.
#include "../support.h"

#include "signal/bands.h"

#include <math.h>

#define ROUNDS  40
#define SAMPLES (ROUNDS * BT_PAC_PER_FRAME)
#define PI      3.14159265358979323846

static bt_bands bands;
static uint16_t pac[SAMPLES];
static uint32_t energy_q4[ROUNDS][BT_BANDS];

static int anew(void **state)
{
    (void)state;
    memset(&bands, 0, sizeof bands);
    return 0;
}

static void run(void)
{
    for (int k = 0; k < ROUNDS; k++) {
        assert_int_equal(bt_bands_round(&bands, pac + k * BT_PAC_PER_FRAME, energy_q4[k]), BT_PAC_PER_FRAME);
    }
}

static void sine(double hz, double counts)
{
    for (int k = 0; k < SAMPLES; k++) {
        pac[k] = (uint16_t)lround(2038 + counts * sin(2 * PI * hz * k / 2200 + 0.3));
    }
}

// ---- the definition ----------------------------------------------------------------------------

// What a smoother sees `back` samples before the k-th.
static double before(const double *in, int k, int back)
{
    return in[k > back ? k - back : 0];
}

// Smooths n samples, and adds up what that takes away, round by round; each stands for `worth` samples of
// PAC.
static void smoothed(double *in, int n, int apart, int worth, double energy[ROUNDS])
{
    static double out[SAMPLES];
    memset(energy, 0, ROUNDS * sizeof *energy);
    for (int k = 0; k < n; k++) {
        const double weight[] = {1, 4, 6, 4, 1};
        out[k] = 0;
        for (int tap = 0; tap < 5; tap++) {
            out[k] += weight[tap] / 16 * before(in, k, tap * apart);
        }
        double removed = before(in, k, 2 * apart) - out[k];
        energy[k * worth / BT_PAC_PER_FRAME] += worth * removed * removed;
    }
    memcpy(in, out, (size_t)n * sizeof *in);
}

TEST(are_what_six_smoothers_take_away)
{
    static double line[SAMPLES], energy[BT_BANDS][ROUNDS];
    uint64_t seed = 5;
    for (int k = 0; k < SAMPLES; k++) { // steps, and noise that grows to the whole range
        int spread = 4 << (k * 10 / SAMPLES);
        int step = k / 150 % 2 ? 300 : -300;
        int64_t count = 2038 + step + random_range(&seed, -spread, spread);
        pac[k] = (uint16_t)(count < 0 ? 0 : count > 4095 ? 4095 : count);
        line[k] = pac[k];
    }
    run();
    smoothed(line, SAMPLES, 1, 1, energy[BT_BANDS - 1]);
    for (int k = 0; k < SAMPLES / 2; k++) {
        line[k] = line[2 * k + 1];
    }
    for (int band = BT_BANDS - 2, apart = 1; band >= 0; band--, apart *= 2) {
        smoothed(line, SAMPLES / 2, apart, 2, energy[band]);
    }
    for (int band = 0; band < BT_BANDS; band++) {
        for (int k = 0; k < ROUNDS; k++) {
            // Each smoother rounds to 1/4 count: by a half of that, and by what those before it did.
            double off = 22 * 0.125 * BT_BANDS * (2 * sqrt(energy[band][k] / 22) + 0.125 * BT_BANDS);
            assert_true(fabs(energy_q4[k][band] / 16.0 - energy[band][k]) <= off);
        }
    }
}

// ---- lost words --------------------------------------------------------------------------------

TEST(hold_the_last_good_word_for_a_lost_one)
{
    uint32_t lossy[BT_BANDS], held[BT_BANDS];
    sine(100, 300);
    uint16_t round[BT_PAC_PER_FRAME];
    memcpy(round, pac + 5, sizeof round);
    round[0] = round[9] = round[21] = BT_INVALID_COUNT;
    assert_int_equal(bt_bands_round(&bands, pac, lossy), 22);
    assert_int_equal(bt_bands_round(&bands, round, lossy), 19);
    (void)anew(NULL);
    round[0] = pac[21];
    round[9] = round[8];
    round[21] = round[20];
    assert_int_equal(bt_bands_round(&bands, pac, held), 22);
    assert_int_equal(bt_bands_round(&bands, round, held), 22);
    assert_memory_equal(lossy, held, sizeof held);
}

TEST(of_no_good_word_are_invalid_and_begin_with_the_first)
{
    uint16_t round[BT_PAC_PER_FRAME];
    uint32_t energy[BT_BANDS];
    memset(round, 0xFF, sizeof round);
    assert_int_equal(bt_bands_round(&bands, round, energy), 0);
    for (int band = 0; band < BT_BANDS; band++) {
        assert_true(energy[band] == UINT32_MAX);
    }
    round[20] = 3000;
    assert_int_equal(bt_bands_round(&bands, round, energy), 1);
    for (int band = 0; band < BT_BANDS; band++) {
        assert_int_equal(energy[band], 0);
    }
}

int main(void)
{
    return run_all(NULL, anew);
}
