// The Pico's GPIOs; README.md beside this file has the wiring.
#ifndef BIOTAC_SENSOR_BOARD_PINS_H
#define BIOTAC_SENSOR_BOARD_PINS_H

#define IMAGE_BOARD      BT_BOARD_PICO_SENSOR
#define IMAGE_BOARD_NAME "Pico (sensors)"
#define IMAGE_NAME       "biotac-sensor"
#define IMAGE_PURPOSE    "emulated BioTac sensors on SPI"
#define IMAGE_PRODUCT    "BioTac sensors (Pico)"
#define PINS_BOARD       "pico"
#define PIN_LED          25

// Same as on the gateway, so that these leads go straight across.
#define PIN_MISO 16
#define PIN_SCK  18
#define PIN_MOSI 19

// One chip select a finger, side by side: the state machine reads all of them at once.
#define PIN_SELECT_0 2
#define PIN_SELECT_1 3
#define PIN_SELECT_2 4
#define PIN_SELECT_3 5
#define PIN_SELECT_4 6

#endif
