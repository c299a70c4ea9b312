#include "word.h"

#include "wire/messages_gen.h"

static unsigned odd_parity(uint8_t byte)
{
    byte = (uint8_t)(byte ^ byte >> 4);
    byte = (uint8_t)(byte ^ byte >> 2);
    byte = (uint8_t)(byte ^ byte >> 1);
    return byte & 1;
}

enum bt_word bt_word_decode(uint16_t word, uint16_t *count)
{
    uint8_t high = (uint8_t)(word >> 8);
    uint8_t low = (uint8_t)word;
    *count = BT_INVALID_COUNT;
    // Parity decides first: an error word begins with 0xA5, which has even parity, so it is never data.
    if (odd_parity(high) && odd_parity(low)) {
        *count = (uint16_t)((high >> 1) * 32 + (low >> 3));
        return BT_WORD_GOOD;
    }
    if (word == 0x0000 || word == 0xFFFF) {
        return BT_WORD_STUCK;
    }
    return high == 0xA5 ? BT_WORD_ERROR : BT_WORD_PARITY;
}
