// The part of <string.h> that firmware/emu uses, for a WebAssembly module that has no C library.
#ifndef BIOTAC_EMULATOR_STRING_H
#define BIOTAC_EMULATOR_STRING_H

#include <stddef.h>

void *memset(void *to, int byte, size_t bytes);
void *memcpy(void *restrict to, const void *restrict from, size_t bytes);
void *memmove(void *to, const void *from, size_t bytes);
int memcmp(const void *a, const void *b, size_t bytes);
size_t strlen(const char *text);
size_t strcspn(const char *text, const char *stop);
char *strncpy(char *restrict to, const char *restrict from, size_t bytes);

#endif
