// The part of <string.h> that firmware/emu uses, for a WebAssembly module that has no C library.
#ifndef BIOTAC_EMULATOR_STRING_H
#define BIOTAC_EMULATOR_STRING_H

#include <stddef.h>

// An instruction each, with -mbulk-memory.
#define memset __builtin_memset
#define memcpy __builtin_memcpy

static inline int memcmp(const void *a, const void *b, size_t bytes)
{
    const unsigned char *x = a;
    const unsigned char *y = b;
    for (size_t k = 0; k < bytes; k++) {
        if (x[k] != y[k]) {
            return x[k] < y[k] ? -1 : 1;
        }
    }
    return 0;
}

static inline size_t strcspn(const char *text, const char *stop)
{
    for (size_t n = 0;; n++) {
        const char *s = stop;
        while (*s != '\0' && *s != text[n]) {
            s++;
        }
        if (text[n] == '\0' || *s != '\0') {
            return n;
        }
    }
}

static inline size_t strlen(const char *text)
{
    return strcspn(text, "");
}

static inline char *strncpy(char *restrict to, const char *restrict from, size_t bytes)
{
    for (size_t k = 0; k < bytes; k++) {
        to[k] = *from;
        from += *from != '\0';
    }
    return to;
}

#endif
