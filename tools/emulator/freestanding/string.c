#include "string.h"

// -fno-builtin keeps the compiler from making these loops into calls of themselves.

void *memset(void *to, int byte, size_t bytes)
{
    for (size_t k = 0; k < bytes; k++) {
        ((unsigned char *)to)[k] = (unsigned char)byte;
    }
    return to;
}

void *memmove(void *to, const void *from, size_t bytes)
{
    unsigned char *t = to;
    const unsigned char *f = from;
    if (t < f) {
        for (size_t k = 0; k < bytes; k++) {
            t[k] = f[k];
        }
    } else {
        for (size_t k = bytes; k > 0; k--) {
            t[k - 1] = f[k - 1];
        }
    }
    return to;
}

void *memcpy(void *restrict to, const void *restrict from, size_t bytes)
{
    return memmove(to, from, bytes);
}

int memcmp(const void *a, const void *b, size_t bytes)
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

size_t strlen(const char *text)
{
    return strcspn(text, "");
}

size_t strcspn(const char *text, const char *stop)
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

char *strncpy(char *restrict to, const char *restrict from, size_t bytes)
{
    size_t k = 0;
    for (; k < bytes && from[k] != '\0'; k++) {
        to[k] = from[k];
    }
    memset(to + k, 0, bytes - k);
    return to;
}
