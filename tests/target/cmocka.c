#include "cmocka.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>

static jmp_buf after_test;

void print_message(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    (void)vprintf(format, arguments);
    va_end(arguments);
}

void target_fail(const char *file, int line, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    (void)vprintf(format, arguments);
    va_end(arguments);
    (void)printf("\n%s:%d: error: Failure!\n", file, line);
    longjmp(after_test, 1);
}

void target_assert_true(bool good, const char *text, const char *file, int line)
{
    if (!good) {
        target_fail(file, line, "%s", text);
    }
}

void target_assert_int(uintmax_t a, uintmax_t b, bool equal, const char *file, int line)
{
    if ((a == b) != equal) {
        target_fail(file, line, "%#llx %s %#llx", (unsigned long long)a,
                    equal ? "!=" : "==", (unsigned long long)b);
    }
}

void target_assert_in_range(uintmax_t value, uintmax_t low, uintmax_t high, const char *file, int line)
{
    if (value < low || value > high) {
        target_fail(file, line, "%llu is not within the range %llu-%llu", (unsigned long long)value,
                    (unsigned long long)low, (unsigned long long)high);
    }
}

void target_assert_memory(const void *a, const void *b, size_t bytes, const char *file, int line)
{
    const uint8_t *x = a, *y = b;
    for (size_t k = 0; k < bytes; k++) {
        if (x[k] != y[k]) {
            target_fail(file, line, "the first of %u bytes that differs is %u: 0x%02x 0x%02x", bytes, k, x[k],
                        y[k]);
        }
    }
}

static bool passes(const struct CMUnitTest *test)
{
    void *state = NULL;
    if (setjmp(after_test) != 0) {
        return false;
    }
    if (test->setup_func != NULL && test->setup_func(&state) != 0) {
        target_fail(test->name, 0, "its setup failed");
    }
    test->test_func(&state);
    return true;
}

static void does_nothing(void **state)
{
    (void)state;
}

int target_run_tests(const char *group, const struct CMUnitTest *tests, size_t count,
                     CMFixtureFunction group_setup, CMFixtureFunction group_teardown)
{
    int failed = 0;
    const struct CMUnitTest setup = {"the group's setup", does_nothing, group_setup};
    if (!passes(&setup)) {
        return 1;
    }
    (void)printf("[==========] %s: Running %u test(s).\n", group, (unsigned)count);
    for (size_t k = 0; k < count; k++) {
        (void)printf("[ RUN      ] %s\n", tests[k].name);
        (void)fflush(stdout);
        bool good = passes(&tests[k]);
        failed += !good;
        (void)printf("%s %s\n", good ? "[       OK ]" : "[  FAILED  ]", tests[k].name);
    }
    (void)printf("[==========] %s: %u test(s) run, %d failed.\n", group, (unsigned)count, failed);
    const struct CMUnitTest teardown = {"the group's teardown", does_nothing, group_teardown};
    return passes(&teardown) ? failed : failed + 1;
}
