// Identity of the Pico 2's and Pico 2 W's images; the pins are the Pico's and Pico W's (data sheets, 2.1).
#ifndef BIOTAC_PICO2_PINS_H
#define BIOTAC_PICO2_PINS_H

#ifdef BIOTAC_PICO_W
#define IMAGE_BOARD      BT_BOARD_PICO2_W
#define IMAGE_BOARD_NAME "Pico 2 W"
#define PINS_BOARD       "pico2_w"
#else
#define IMAGE_BOARD      BT_BOARD_PICO2
#define IMAGE_BOARD_NAME "Pico 2"
#define PINS_BOARD       "pico2"
#endif
#define IMAGE_PRODUCT "BioTac gateway (Pico 2)"

#include "pico_pins.h"

#endif
