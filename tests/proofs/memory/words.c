// Readers of words, at every length with the alignment that END leaves it. Bytes lie at addresses of the
// RP2040's RAM, and the one before END is the last of the RAM.
#include "wire/cobs.h"
#include "wire/crc32.h"

#include <__fc_builtin.h>

static void check_length(size_t bytes)
{
    uint8_t *at = (uint8_t *)END - bytes;
    Frama_C_make_unknown((char *)at, bytes);
    (void)bt_crc32(at, bytes);
    bt_cobs_in_place(at, bytes);
}

#define FOUR(n)    check_length(n), check_length(n + 1), check_length(n + 2), check_length(n + 3)
#define SIXTEEN(n) FOUR(n), FOUR(n + 4), FOUR(n + 8), FOUR(n + 12)

void main(void)
{
#ifdef FIRST
    SIXTEEN(FIRST);
#endif
}
