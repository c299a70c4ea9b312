// What runs the C tests: each adds itself before main() begins (support.h).
#include "support.h"

#define MAX_TESTS 40 // of a file

static struct CMUnitTest added[MAX_TESTS];
static size_t count;
static void (*before_each[4])(void); // a file and its headers have two at most

void add_test(const char *name, CMUnitTestFunction test)
{
    if (count == MAX_TESTS) {
        abort();
    }
    added[count].name = name;
    added[count++].test_func = test;
}

void add_before_each(void (*prepare)(void))
{
    size_t k = 0;
    while (before_each[k] != NULL) {
        k++;
    }
    before_each[k] = prepare;
}

static int prepare(void **state)
{
    (void)state;
    for (size_t k = 0; before_each[k] != NULL; k++) {
        before_each[k]();
    }
    return 0;
}

int run_all(void)
{
    if (count == 0) {
        return 1; // nothing has added them: a startup code without constructors
    }
    struct CMUnitTest tests[count];
    for (size_t k = 0; k < count; k++) {
        tests[k] = added[k];
        tests[k].setup_func = prepare;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}

__attribute__((weak)) int main(void)
{
    return run_all();
}
