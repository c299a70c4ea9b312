// Shared by the C tests: cmocka with the headers that it needs, and reproducible random numbers.
#ifndef BIOTAC_TEST_SUPPORT_H
#define BIOTAC_TEST_SUPPORT_H

#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

// ---- tests -------------------------------------------------------------------------------------

#define MAX_TESTS 40 // of a file

static struct CMUnitTest test_list[MAX_TESTS];
static size_t test_count;

static inline void add_test(const char *name, CMUnitTestFunction test)
{
    if (test_count == MAX_TESTS) {
        abort();
    }
    test_list[test_count].name = name;
    test_list[test_count++].test_func = test;
}

// A test; it leaves no state to the next. Before main() begins it adds itself to the file's list.
#define TEST(name)                                                                                           \
    static void name(void **state);                                                                          \
    __attribute__((constructor)) static void add_##name(void)                                                \
    {                                                                                                        \
        add_test(#name, name);                                                                               \
    }                                                                                                        \
    static void name(void **state __attribute__((unused)))

// Run all tests in order; call `first` before the first, `setup` before each; NULL: neither.
static inline int run_all(CMFixtureFunction first, CMFixtureFunction setup)
{
    if (test_count == 0) {
        return 1; // nothing has added them: a startup code without constructors
    }
    struct CMUnitTest tests[test_count];
    for (size_t k = 0; k < test_count; k++) {
        tests[k] = test_list[k];
        tests[k].setup_func = setup;
    }
    return cmocka_run_group_tests(tests, first, NULL);
}

// ---- random numbers: xorshift64*, the same on every machine -----------------------------------

static inline uint64_t random_u64(uint64_t *state)
{
    *state ^= *state >> 12;
    *state ^= *state << 25;
    *state ^= *state >> 27;
    return *state * 0x2545F4914F6CDD1Dull;
}

// low..high, both included
static inline int64_t random_range(uint64_t *state, int64_t low, int64_t high)
{
    return low + (int64_t)(random_u64(state) % (uint64_t)(high - low + 1));
}

// 0 <= value < 1
static inline double random_unit(uint64_t *state)
{
    return (double)(random_u64(state) >> 11) / 9007199254740992.0;
}

#endif
