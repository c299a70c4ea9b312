// The sensors' end of the bus, in hardware: a selected sensor's offer is out before the first clock.
#ifndef BIOTAC_SENSOR_BOARD_SHIFTER_H
#define BIOTAC_SENSOR_BOARD_SHIFTER_H

#include <stdbool.h>
#include <stdint.h>

// A sensor's answer when selected alone. All other bits are the shifter's own.
#define OFFER_DRIVE         (1u << 31) // else MISO floats, and the word is 0
#define OFFER_WORD(w)       ((uint32_t)(w) << 14)
#define OFFER_SETTLED       (1u << 5) // after the 50 us, not before
#define OFFERED_WORD(offer) ((uint16_t)((offer) >> 14))

// A first byte up to this one reads: 0x00, and 0x01 of a public driver. Others are commands.
#define BT_READ_MOSI_MAX 0x01FFu

// An exchange on the bus, from the fall of some selects to the next change of any.
typedef struct {
    uint32_t offer;   // sent
    uint32_t t_us;    // the end
    uint16_t mosi;    // the first two bytes
    uint8_t bytes;    // all of them, 255 at most
    uint8_t selected; // bit mask
} exchange;

// All sensors leave MISO floating until the first offer. exchanged() is called from an interrupt that any
// other may interrupt but the USB's, when there is an exchange to read.
void shifter_start(void (*exchanged)(void));

// after_byte: the next offer, at once, after a read of exactly one byte of this one; 0: MISO floats. False,
// without effect, while exchanges of this finger are unread: they decide the offer.
bool shifter_offer(uint8_t finger, uint32_t offer, uint32_t after_byte);

uint32_t shifter_released_us(uint8_t finger);

// The next exchange, or false. The sensor leaves MISO floating after it, until the next offer.
bool shifter_read(exchange *done);

// Exchanges that were not read in time.
uint32_t shifter_lost(void);

#endif
