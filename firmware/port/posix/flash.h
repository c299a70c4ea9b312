// The simulated board's flash for settings and maps: a file, without a name or with one.
// Behaves as NOR flash does: erasing sets whole sectors to 0xFF, programming only clears bits.
#ifndef BIOTAC_POSIX_FLASH_H
#define BIOTAC_POSIX_FLASH_H

#include <stdint.h>

// path may be NULL: then nothing outlives the process. A file that does not exist is made. Returns NULL, or
// what went wrong.
const char *flash_open(const char *path);

// Go on with the flash of a process before, by the number of its file there.
const char *flash_resume(int number);
int flash_inherit(void);

// The slots for maps.
const uint8_t *flash_maps(void);

#endif
