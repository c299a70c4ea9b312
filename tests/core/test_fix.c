// The core's arithmetic helpers at their edges.
#include "support.h"

#include "fixed_point.h"

// Half away from zero: round(|num| / den) = floor((2 |num| + den) / (2 den)), stated in 128 bits where the
// compiler has them. A 32-bit one compares the remainder: twice the remainder fits into 64 bits unsigned.
static int64_t rounded(int64_t num, int64_t den)
{
    uint64_t magnitude = bt_abs(num);
    uint64_t divisor = (uint64_t)den;
#ifdef __SIZEOF_INT128__
    uint64_t quotient =
        (uint64_t)((2 * (unsigned __int128)magnitude + divisor) / (2 * (unsigned __int128)divisor));
#else
    uint64_t quotient = magnitude / divisor;
    quotient += 2 * (magnitude - quotient * divisor) >= divisor;
#endif
    return num < 0 ? (int64_t)(0 - quotient) : (int64_t)quotient;
}

TEST(halves_go_away_from_zero)
{
    static const struct {
        int64_t num, den, want;
    } table[] = {
        {0, 1, 0},   {1, 2, 1}, {-1, 2, -1}, {3, 2, 2},    {-3, 2, -2},  {5, 2, 3},      {-5, 2, -3},
        {1, 3, 0},   {2, 3, 1}, {-1, 3, 0},  {-2, 3, -1},  {7, 4, 2},    {-7, 4, -2},    {6, 4, 2},
        {-6, 4, -2}, {5, 4, 1}, {-5, 4, -1}, {49, 100, 0}, {50, 100, 1}, {-50, 100, -1},
    };
    for (size_t k = 0; k < sizeof table / sizeof *table; k++) {
        assert_int_equal(bt_div_round(table[k].num, table[k].den), table[k].want);
    }
}

TEST(extremes_do_not_wrap)
{
    static const int64_t ends[] = {INT64_MAX,     INT64_MAX - 1, INT64_MIN,         INT64_MIN + 1,
                                   INT64_MAX / 2, INT64_MIN / 2, INT64_MAX / 2 + 1, INT64_MIN / 2 - 1};
    static const int64_t dens[] = {
        1, 2, 3, 1000, 1 << 20, INT64_MAX / 2, INT64_MAX / 2 + 1, INT64_MAX - 1, INT64_MAX};
    for (size_t n = 0; n < sizeof ends / sizeof *ends; n++) {
        for (size_t d = 0; d < sizeof dens / sizeof *dens; d++) {
            assert_int_equal(bt_div_round(ends[n], dens[d]), rounded(ends[n], dens[d]));
        }
    }
}

TEST(random_quotients_are_right)
{
    uint64_t seed = 2;
    for (int k = 0; k < 200000; k++) {
        int64_t num = (int64_t)(random_u64(&seed) >> random_range(&seed, 0, 60));
        int64_t den = (int64_t)(random_u64(&seed) >> random_range(&seed, 1, 62)) | 1;
        num = random_u64(&seed) & 1 ? num : -num;
        den = k % 3 ? den : den / 2 + 1; // even ones have halves
        assert_int_equal(bt_div_round(num, den), rounded(num, den));
    }
}

TEST(magnitudes_hold_at_the_ends)
{
    assert_true(bt_abs(INT64_MIN) == (uint64_t)1 << 63);
    assert_true(bt_abs(INT64_MAX) == (uint64_t)INT64_MAX);
    assert_true(bt_abs(-1) == 1 && bt_abs(0) == 0);
    for (int64_t value = -2000; value <= 2000; value++) {
        assert_true(bt_abs(value) == (uint64_t)(value < 0 ? -value : value));
        for (int bits = 1; bits < 12; bits++) {
            assert_int_equal(bt_shift_round(value, bits), rounded(value, (int64_t)1 << bits));
        }
    }
    for (int32_t value = -9; value <= 9; value++) {
        assert_int_equal(bt_clamp(value, -5, 7), value < -5 ? -5 : value > 7 ? 7 : value);
    }
    assert_int_equal(bt_shift_down(-1, 3), -1);
    assert_int_equal(bt_shift_down(-8, 3), -1);
    assert_int_equal(bt_shift_down(-9, 3), -2);
}

// The 32-bit helpers against the 64-bit one, which is tested above.
TEST(scaling_is_a_rounded_division)
{
    uint64_t seed = 31;
    for (int k = 0; k < 300000; k++) {
        int bits = 1 + k % 7;
        uint32_t value = (uint32_t)random_range(&seed, 0, INT32_MAX) >> k % 31;
        uint32_t multiplier = (uint32_t)random_range(&seed, 0, 1 << 30);
        multiplier = k % 11 ? multiplier : 1u << 30;
        value = k % 13 ? value : INT32_MAX;
        int64_t want = bt_div_round((int64_t)value * multiplier, (int64_t)1 << (32 + bits));
        assert_true(bt_scale(value, multiplier >> 16, multiplier & 0xFFFF, bits) == want);
    }
}

TEST(small_divisions_round_to_the_nearest)
{
    uint64_t seed = 33;
    for (int k = 0; k < 300000; k++) {
        uint32_t den = 1 + (uint32_t)(random_u64(&seed) >> (33 + k % 31));
        uint32_t num = (uint32_t)(random_u64(&seed) >> (32 + k % 32));
        num = num > UINT32_MAX - den / 2 ? num - den / 2 : num;
        assert_true(bt_div_round_u32(num, den) == bt_div_round(num, den));
    }
}
