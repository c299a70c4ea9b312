#define _DEFAULT_SOURCE // MAP_ANONYMOUS, sbrk
#include "registers.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#define MAPS 16
static struct {
    uint32_t from, bytes;
} map[MAPS];
static int maps;

uint64_t accesses, now_ns;
char broken[2048];
jmp_buf registers_left;
uint32_t registers_reset_at;

static struct {
    bool is;
    uint32_t at, old;
} pending;

// Linux puts the heap of a program with fixed addresses anywhere in a gigabyte behind it, at times where the
// chip has its registers, and the program would crash. With a page in its way the heap does not grow, and
// malloc uses mmap.
__attribute__((constructor)) static void stop_the_heap(void)
{
    const uintptr_t page = (uintptr_t)sysconf(_SC_PAGESIZE);
    const uintptr_t end = ((uintptr_t)sbrk(0) + page - 1) / page * page;
    if (mmap((void *)end, page, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED, -1, 0) == MAP_FAILED) {
        perror("stop_the_heap");
        abort();
    }
}

void registers_map(uint32_t from, uint32_t bytes)
{
    void *at = mmap((void *)(uintptr_t)from, bytes, PROT_READ | PROT_WRITE,
                    MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED, -1, 0);
    if (at == MAP_FAILED || maps == MAPS) {
        perror("registers_map");
        abort();
    }
    map[maps].from = from;
    map[maps++].bytes = bytes;
}

static bool is_mapped(uintptr_t at)
{
    for (int k = 0; k < maps; k++) {
        if (at - map[k].from < map[k].bytes) {
            return true;
        }
    }
    return false;
}

uint32_t peek(uint32_t at)
{
    uint32_t value;
    memcpy(&value, (const void *)(uintptr_t)at, 4);
    return value;
}

void poke(uint32_t at, uint32_t value)
{
    memcpy((void *)(uintptr_t)at, &value, 4);
}

void break_rule(const char *rule)
{
    const size_t used = strlen(broken);
    if (strstr(broken, rule) == NULL) {
        (void)snprintf(broken + used, sizeof broken - used, "%s\n", rule);
    }
}

void registers_settle(void)
{
    if (pending.is) {
        pending.is = false;
        on_write(pending.at, pending.old, peek(pending.at));
    }
}

void asm_seen(const char *text)
{
    registers_settle();
    on_asm(text);
}

bool broke(const char *words)
{
    registers_settle();
    const bool as_expected = strstr(broken, words) != NULL && (words[0] != '\0' || broken[0] == '\0');
    if (!as_expected) {
        (void)fprintf(stderr, "expected \"%s\" to be broken, seen \"%s\"\n", words, broken);
    }
    broken[0] = '\0';
    return as_expected;
}

// ---- called by the instrumented code before each access -------------------------------------------------

void __tsan_init(void);
void __tsan_func_entry(void *pc);
void __tsan_func_exit(void);
void __tsan_volatile_read4(void *at);
void __tsan_volatile_write4(void *at);

void __tsan_init(void)
{
}

void __tsan_func_entry(void *pc)
{
    (void)pc;
}

void __tsan_func_exit(void)
{
}

void __tsan_volatile_read4(void *at)
{
    registers_settle();
    now_ns += 50;
    if (is_mapped((uintptr_t)at)) {
        accesses++;
        on_read((uint32_t)(uintptr_t)at);
    }
}

void __tsan_volatile_write4(void *at)
{
    registers_settle();
    now_ns += 50;
    if (is_mapped((uintptr_t)at)) {
        accesses++;
        if ((uint32_t)(uintptr_t)at == registers_reset_at) {
            longjmp(registers_left, 1); // no access follows that would show the value
        }
        pending.is = true;
        pending.at = (uint32_t)(uintptr_t)at;
        pending.old = peek(pending.at);
    }
}

// Memory of the port's own, of which the model need not know.
#define IGNORED(name)                                                                                        \
    void __tsan_##name(void *at);                                                                            \
    void __tsan_##name(void *at)                                                                             \
    {                                                                                                        \
        (void)at;                                                                                            \
    }
IGNORED(read1)
IGNORED(read2)
IGNORED(read4)
IGNORED(read8)
IGNORED(read16)
IGNORED(write1)
IGNORED(write2)
IGNORED(write4)
IGNORED(write8)
IGNORED(write16)
IGNORED(volatile_read1)
IGNORED(volatile_read2)
IGNORED(volatile_write1)
IGNORED(volatile_write2)
IGNORED(unaligned_read4)
IGNORED(unaligned_read8)
IGNORED(unaligned_write4)
IGNORED(unaligned_write8)

void __tsan_read_range(void *at, long bytes);
void __tsan_write_range(void *at, long bytes);
uint32_t __tsan_atomic32_load(const uint32_t *at, int order);
void __tsan_atomic32_store(uint32_t *at, uint32_t value, int order);

void __tsan_read_range(void *at, long bytes)
{
    (void)at, (void)bytes;
}

void __tsan_write_range(void *at, long bytes)
{
    (void)at, (void)bytes;
}

uint32_t __tsan_atomic32_load(const uint32_t *at, int order)
{
    (void)order;
    return *at;
}

void __tsan_atomic32_store(uint32_t *at, uint32_t value, int order)
{
    (void)order;
    *at = value;
}

void __tsan_atomic_signal_fence(int order);
void __tsan_atomic_signal_fence(int order)
{
    (void)order;
}
