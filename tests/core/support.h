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

// ---- tests, of which main.c runs all ------------------------------------------------------------

void add_test(const char *name, CMUnitTestFunction test);
void add_before_each(void (*prepare)(void));

// Before main() begins, `add` takes the name of the function whose body follows.
#define ADDED(add, ...)                                                                                      \
    __attribute__((constructor)) static void add(void)                                                       \
    {                                                                                                        \
        __VA_ARGS__;                                                                                         \
    }

// A test; it leaves no state to the next.
#define TEST(name)                                                                                           \
    static void name(void **state);                                                                          \
    ADDED(add_##name, add_test(#name, name))                                                                 \
    static void name(void **state __attribute__((unused)))

// What is done before each test; where a file has several, in their order.
#define BEFORE_EACH(name)                                                                                    \
    static void name(void);                                                                                  \
    ADDED(add_##name, add_before_each(name))                                                                 \
    static void name(void)

int run_all(void);

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
