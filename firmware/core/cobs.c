#include "cobs.h"

size_t bt_cobs_encode(const uint8_t *in, size_t bytes, uint8_t *out)
{
    size_t code_at = 0;
    size_t at = 1;
    uint8_t code = 1;
    for (size_t k = 0; k < bytes; k++) {
        if (in[k] != 0) {
            out[at++] = in[k];
            code++;
        }
        // A full block at the very end needs no successor; the decoder adds no zero after it.
        if (in[k] == 0 || (code == 0xFF && k + 1 < bytes)) {
            out[code_at] = code;
            code = 1;
            code_at = at++;
        }
    }
    out[code_at] = code;
    return at;
}

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
