// A bench image's output on the Cortex-M4F reference board (tests/target/m4f). QEMU logs the address of
// each instruction it runs; names and results go out by semihosting.
#include "mark.h"

#include "semihosting.h"

__attribute__((noipa, used)) void bench_mark(void)
{
    __asm volatile("" ::: "memory");
}

void bench_name(const char *kernel, const char *scene)
{
    semihost_write(kernel);
    semihost_write("\t");
    semihost_write(scene);
    semihost_write("\n");
}

void bench_result(uint32_t value)
{
    semihost_write_hex(value);
    semihost_write("\n");
}

void bench_end(void)
{
    semihost(SYS_EXIT, EXIT_DONE);
}
