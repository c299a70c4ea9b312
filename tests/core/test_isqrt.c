// The integer square roots, the core's and the gold kernel's, against bisection, and around every kind of
// square.
#include "support.h"

#include "gold.h"
#include "isqrt.h"

// Bisection on r <= n / r: no squaring, so nothing can overflow.
static uint32_t bisected(uint64_t n)
{
    uint64_t low = 0;
    uint64_t high = UINT32_MAX;
    while (low < high) {
        uint64_t middle = low + (high - low + 1) / 2;
        if (middle <= n / middle) {
            low = middle;
        } else {
            high = middle - 1;
        }
    }
    return (uint32_t)low;
}

static void check_around(uint64_t k)
{
    assert_int_equal(gold_isqrt64(k * k), k);
    assert_int_equal(gold_isqrt64(k * k + 1), k == 0 ? 1 : k);
    if (k > 0) {
        assert_int_equal(gold_isqrt64(k * k - 1), k - 1);
    }
}

static void squares_and_their_neighbours_are_exact(void **state)
{
    (void)state;
    uint64_t seed = 3;
    for (uint64_t k = 0; k < 70000; k++) {
        check_around(k);
    }
    for (int bit = 16; bit < 32; bit++) {
        for (int64_t d = -40; d <= 40; d++) {
            check_around((uint64_t)(((int64_t)1 << bit) + d));
        }
    }
    for (int k = 0; k < 200000; k++) {
        check_around(random_u64(&seed) >> 32);
    }
}

// The largest root of 32 bits is 65535: every root and its neighbours, then both sides of random n.
static void every_32_bit_root_is_exact(void **state)
{
    (void)state;
    uint64_t seed = 4;
    for (uint32_t k = 1; k <= 65535; k++) {
        assert_int_equal(bt_isqrt32(k * k), k);
        assert_int_equal(bt_isqrt32(k * k - 1), k - 1);
        assert_int_equal(bt_isqrt32(k * k + 2 * k), k);
    }
    assert_int_equal(bt_isqrt32(0), 0);
    assert_int_equal(bt_isqrt32(UINT32_MAX), 65535);
    for (int k = 0; k < 200000; k++) {
        uint32_t n = (uint32_t)random_u64(&seed);
        assert_int_equal(bt_isqrt32(n), bisected(n));
    }
}

static void the_top_of_the_range_is_exact(void **state)
{
    (void)state;
    for (uint64_t k = UINT32_MAX; k > UINT32_MAX - 3000ull; k--) {
        check_around(k);
    }
    for (uint64_t n = UINT64_MAX; n > UINT64_MAX - 3000; n--) {
        assert_int_equal(gold_isqrt64(n), UINT32_MAX);
    }
    assert_int_equal(gold_isqrt64((uint64_t)1 << 63), 3037000499u);
    assert_int_equal(gold_isqrt64(((uint64_t)1 << 63) - 1), 3037000499u);
}

static void any_number_agrees_with_bisection(void **state)
{
    (void)state;
    uint64_t seed = 4;
    for (uint64_t n = 0; n < 5000; n++) {
        assert_int_equal(gold_isqrt64(n), bisected(n));
    }
    for (int k = 0; k < 200000; k++) {
        uint64_t n = random_u64(&seed) >> (k % 64);
        assert_int_equal(gold_isqrt64(n), bisected(n));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(squares_and_their_neighbours_are_exact),
        cmocka_unit_test(every_32_bit_root_is_exact),
        cmocka_unit_test(the_top_of_the_range_is_exact),
        cmocka_unit_test(any_number_agrees_with_bisection),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
