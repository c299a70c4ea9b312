// The sensors' end of the bus, in hardware: whoever is selected, his offer is out before the first clock.
#ifndef BIOTAC_SENSOR_BOARD_SHIFTER_H
#define BIOTAC_SENSOR_BOARD_SHIFTER_H

#include <stdbool.h>
#include <stdint.h>

// What a sensor will say when it is selected alone. Other bits are the shifter's own.
#define OFFER_DRIVE         (1u << 31) // else MISO is let go, and the word is 0
#define OFFER_WORD(w)       ((uint32_t)(w) << 14)
#define OFFER_SETTLED       (1u << 5) // after its 50 us, not before
#define OFFERED_WORD(offer) ((uint16_t)((offer) >> 14))

// A first byte up to this one reads: 0x00, and 0x01 of a public driver. Others are commands.
#define BT_READ_MOSI_MAX 0x01FFu

// What went over the bus from the fall of some selects to the next change of any.
typedef struct {
    uint32_t offer;   // that was out
    uint32_t t_us;    // the end
    uint16_t mosi;    // the first two bytes
    uint8_t bytes;    // all of them, 255 at most
    uint8_t selected; // bit mask
} exchange;

// All let MISO go, until the first offer. exchanged() is called from an interrupt that any other may
// interrupt but the USB's, when there is something to take.
void shifter_start(void (*exchanged)(void));

// after_byte: what to offer next, at once, where one byte of this one is read and no more; 0: let go. False,
// and nothing is done, while exchanges of this finger wait to be taken: they say what to offer.
bool shifter_offer(uint8_t finger, uint32_t offer, uint32_t after_byte);

uint32_t shifter_released_us(uint8_t finger);

// The next exchange, or false. Once it is over its sensor lets MISO go, until it has another offer.
bool shifter_read(exchange *done);

// Exchanges that nobody took in time.
uint32_t shifter_lost(void);

#endif
