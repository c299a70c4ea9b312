// Identity of the Pico's and Pico W's images; pico_pins.h has the pins.
#ifndef BIOTAC_PICO_PINS_H
#define BIOTAC_PICO_PINS_H

#ifdef BIOTAC_PICO_W
#define IMAGE_BOARD      BT_BOARD_PICO_W
#define IMAGE_BOARD_NAME "Pico W"
#define PINS_BOARD       "pico_w"
#else
#define IMAGE_BOARD      BT_BOARD_PICO
#define IMAGE_BOARD_NAME "Pico"
#define PINS_BOARD       "pico"
#endif
#define IMAGE_PRODUCT "BioTac gateway (Pico)"

#include "pico_pins.h"

#endif
