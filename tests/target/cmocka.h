// The part of cmocka's interface that the C tests use, for boards: Debian has cmocka for this computer only.
// The same test sources run with either; test_asserts.c holds the two against each other.
#ifndef BIOTAC_TARGET_CMOCKA_H
#define BIOTAC_TARGET_CMOCKA_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef void (*CMUnitTestFunction)(void **state);
typedef int (*CMFixtureFunction)(void **state);

struct CMUnitTest {
    const char *name;
    CMUnitTestFunction test_func;
    CMFixtureFunction setup_func;
};

#define cmocka_unit_test(test)              {#test, test, NULL}
#define cmocka_unit_test_setup(test, setup) {#test, test, setup}

// Runs them all, and gives how many failed.
#define cmocka_run_group_tests(tests, group_setup, group_teardown)                                           \
    target_run_tests(#tests, tests, sizeof(tests) / sizeof *(tests), group_setup, group_teardown)

#define assert_true(value)  target_assert_true((value) ? true : false, #value, __FILE__, __LINE__)
#define assert_false(value) target_assert_true((value) ? false : true, "!(" #value ")", __FILE__, __LINE__)
#define assert_non_null(pointer) assert_true((pointer) != NULL)
#define assert_ptr_equal(a, b)   assert_int_equal((uintptr_t)(a), (uintptr_t)(b))
#define assert_int_equal(a, b)   target_assert_int((uintmax_t)(a), (uintmax_t)(b), true, __FILE__, __LINE__)
#define assert_int_not_equal(a, b)                                                                           \
    target_assert_int((uintmax_t)(a), (uintmax_t)(b), false, __FILE__, __LINE__)
#define assert_in_range(value, low, high)                                                                    \
    target_assert_in_range((uintmax_t)(value), (uintmax_t)(low), (uintmax_t)(high), __FILE__, __LINE__)
#define assert_memory_equal(a, b, bytes) target_assert_memory((a), (b), (bytes), __FILE__, __LINE__)
#define fail_msg(...)                    target_fail(__FILE__, __LINE__, __VA_ARGS__)

__attribute__((format(printf, 1, 2))) void print_message(const char *format, ...);

int target_run_tests(const char *group, const struct CMUnitTest *tests, size_t count,
                     CMFixtureFunction group_setup, CMFixtureFunction group_teardown);
__attribute__((format(printf, 3, 4), noreturn)) void target_fail(const char *file, int line,
                                                                 const char *format, ...);
void target_assert_true(bool good, const char *text, const char *file, int line);
void target_assert_int(uintmax_t a, uintmax_t b, bool equal, const char *file, int line);
void target_assert_in_range(uintmax_t value, uintmax_t low, uintmax_t high, const char *file, int line);
void target_assert_memory(const void *a, const void *b, size_t bytes, const char *file, int line);

#endif
