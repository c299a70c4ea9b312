#include "wire/cobs.h"

int bt_cobs_decode(const uint8_t *in, size_t bytes, uint8_t *out)
{
    size_t at = 0;
    size_t k = 0;
    while (k < bytes) {
        uint8_t code = in[k++];
        if (code == 0 || (size_t)(code - 1) > bytes - k) {
            return -1;
        }
        for (uint8_t n = 1; n < code; n++) {
            if (in[k] == 0) {
                return -1;
            }
            out[at++] = in[k++];
        }
        if (code != 0xFF && k < bytes) {
            out[at++] = 0;
        }
    }
    return (int)at;
}
