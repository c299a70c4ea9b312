// The exact kernel's integer square root against bisection, and around every kind of square; the core's
// reciprocal of one against double.
#include "support.h"

#include "exact.h"
#include "solve/rsqrt.h"
#include "wire/sensor_gen.h"

#include <math.h>

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
    assert_int_equal(exact_isqrt64(k * k), k);
    assert_int_equal(exact_isqrt64(k * k + 1), k == 0 ? 1 : k);
    if (k > 0) {
        assert_int_equal(exact_isqrt64(k * k - 1), k - 1);
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

// The core's 1 / sqrt, at every entry of its table, next to it, in the middle and anywhere.
static void one_over_a_root_is_as_near_as_its_header_says(void **state)
{
    (void)state;
    uint64_t seed = 4;
    double share = BT_CORE_RADIUS_UM / (2.0 * BT_ROOT_UM_FACTOR);
    double worst = 0;
    for (int64_t k = 0; k < 2000000; k++) {
        int64_t at = (1 << 30) + (k / 6 << BT_ROOT_STEP_BITS);
        static const int64_t near[5] = {0, 1, -1, 1 << (BT_ROOT_STEP_BITS - 1), 3 << (BT_ROOT_STEP_BITS - 2)};
        int64_t q = k % 6 < 5 ? at + near[k % 6] : UINT32_MAX - k;
        q = q < 1 << 30 || q > UINT32_MAX ? (int64_t)((random_u64(&seed) >> 32) | 1u << 30) : q;
        double want = share * 4294967296.0 / sqrt((double)q);
        double error = fabs(bt_root_inverse((uint32_t)q) - want);
        assert_true(error <= 1 + want * 5.8e-6); // 2^-17.4
        worst = error / want > worst ? error / want : worst;
    }
    print_message("1 / sqrt: off by at most %.2e\n", worst);
    assert_true(worst <= 1.0 / (1 << 16));
}

static void the_top_of_the_range_is_exact(void **state)
{
    (void)state;
    for (uint64_t k = UINT32_MAX; k > UINT32_MAX - 3000ull; k--) {
        check_around(k);
    }
    for (uint64_t n = UINT64_MAX; n > UINT64_MAX - 3000; n--) {
        assert_int_equal(exact_isqrt64(n), UINT32_MAX);
    }
    assert_int_equal(exact_isqrt64((uint64_t)1 << 63), 3037000499u);
    assert_int_equal(exact_isqrt64(((uint64_t)1 << 63) - 1), 3037000499u);
}

static void any_number_agrees_with_bisection(void **state)
{
    (void)state;
    uint64_t seed = 4;
    for (uint64_t n = 0; n < 5000; n++) {
        assert_int_equal(exact_isqrt64(n), bisected(n));
    }
    for (int k = 0; k < 200000; k++) {
        uint64_t n = random_u64(&seed) >> (k % 64);
        assert_int_equal(exact_isqrt64(n), bisected(n));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(squares_and_their_neighbours_are_exact),
        cmocka_unit_test(one_over_a_root_is_as_near_as_its_header_says),
        cmocka_unit_test(the_top_of_the_range_is_exact),
        cmocka_unit_test(any_number_agrees_with_bisection),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
