// Every assertion that the C tests use fails when it should, and only then. Runs with cmocka on this computer
// and with the stand-in on boards, so that the stand-in cannot let through an error that cmocka would not.
#include "../core/support.h"

static int reached; // statements that only a passing assertion lets run

#define FAILS(name, statement)                                                                               \
    TEST(name)                                                                                               \
    {                                                                                                        \
        statement;                                                                                           \
        reached++;                                                                                           \
    }

static const uint8_t first[3] = {1, 2, 3}, second[3] = {1, 2, 4};
static const uint8_t *const nothing = NULL;

FAILS(not_true, assert_true(reached < 0))
FAILS(not_false, assert_false(reached >= 0))
FAILS(null, assert_non_null(nothing))
FAILS(pointers_differ, assert_ptr_equal(first, second))
FAILS(integers_differ, assert_int_equal(reached, -1))
FAILS(differ_above_32_bits, assert_int_equal(1ull << 32, 0))
FAILS(equal_after_all, assert_int_not_equal(reached, reached))
FAILS(below_the_range, assert_in_range(4, 5, 6))
FAILS(above_the_range, assert_in_range(7, 5, 6))
FAILS(negative_is_large, assert_in_range(-1, 0, 10))
FAILS(a_byte_differs, assert_memory_equal(first, second, 3))
FAILS(on_demand, fail_msg("told to, %d", 1))

static int no_setup(void **state)
{
    (void)state;
    return 1;
}

static void not_set_up(void **state)
{
    (void)state;
    reached++;
}

static void what_holds_passes(void **state)
{
    (void)state;
    assert_true(reached == 0);
    assert_false(reached != 0);
    assert_non_null(first);
    assert_ptr_equal(first, &first[0]);
    assert_int_equal(-1, (int64_t)-1);
    assert_int_not_equal(1, 2);
    assert_in_range(5, 5, 6);
    assert_in_range(6, 5, 6);
    assert_memory_equal(first, second, 2);
}

int main(void)
{
    const struct CMUnitTest bad[] = {cmocka_unit_test_setup(not_set_up, no_setup)};
    const struct CMUnitTest good[] = {cmocka_unit_test(what_holds_passes)};
    int want = 12 + 1; // the failures above, all of which must be in the list, and this one
    int failed = run_all() + cmocka_run_group_tests(bad, NULL, NULL);
    print_message("%d of %d failed, as they should; %d ran on\n", failed, want, reached);
    return failed == want && reached == 0 && cmocka_run_group_tests(good, NULL, NULL) == 0 ? 0 : 1;
}
