// The sensor's 16-bit reply: [D11..D5 P] [D4..D0 0 0 P], each byte with odd parity.
#ifndef BIOTAC_WORD_H
#define BIOTAC_WORD_H

#include <stdint.h>

enum bt_word {
    BT_WORD_GOOD,
    BT_WORD_STUCK,  // 0x0000 or 0xFFFF: absent, unpowered or open line
    BT_WORD_ERROR,  // 0xA5xx: the sensor refuses (enum bt_error_word)
    BT_WORD_PARITY, // anything else with bad parity
};

// *count receives 0..4095 for a good word and BT_INVALID_COUNT otherwise.
enum bt_word bt_word_decode(uint16_t word, uint16_t *count);

#endif
