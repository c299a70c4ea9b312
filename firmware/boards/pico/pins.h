// Which of the Pico's GPIOs goes where; README.md beside this file has the wiring.
#ifndef BIOTAC_PICO_PINS_H
#define BIOTAC_PICO_PINS_H

// SPI0's, by the RP2040's function table.
#define PIN_MISO 16
#define PIN_SCK  18
#define PIN_MOSI 19

// One chip select a finger.
#define PIN_SELECT_0 17
#define PIN_SELECT_1 20
#define PIN_SELECT_2 21
#define PIN_SELECT_3 22
#define PIN_SELECT_4 26

// The Pico's own regulator, not on a board pin: high keeps it from its power-save mode, which ripples more.
#define PIN_SMPS_PWM 23

#endif
