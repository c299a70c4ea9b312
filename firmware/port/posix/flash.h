// The simulated board's flash for settings and maps: memory, or a file mapped into it. Behaves as NOR flash
// does: erasing sets whole sectors to 0xFF, programming only clears bits.
#ifndef BIOTAC_POSIX_FLASH_H
#define BIOTAC_POSIX_FLASH_H

#include <stdint.h>

// path may be NULL: then nothing outlives the process. A file that does not exist is made. Returns NULL, or
// what went wrong.
const char *flash_open(const char *path);

// The slots for maps.
const uint8_t *flash_maps(void);

#endif
