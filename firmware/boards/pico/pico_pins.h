// The GPIOs of the Pico and the Pico 2; README.md beside this file has the wiring.
#ifndef BIOTAC_PICO_PICO_PINS_H
#define BIOTAC_PICO_PICO_PINS_H

#define IMAGE_NAME    "biotac-gateway"
#define IMAGE_PURPOSE "BioTac sensors to USB serial"

// SPI0's, by the chip's function table.
#define PIN_MISO 16
#define PIN_SCK  18
#define PIN_MOSI 19

// One chip select a finger.
#define PIN_SELECT_0 17
#define PIN_SELECT_1 20
#define PIN_SELECT_2 21
#define PIN_SELECT_3 22
#define PIN_SELECT_4 26

// Least time from a chip select's fall to a word's first clock, and from the last clock to the rise. Before:
// SynTouch's library for the Cheetah adapter waits about 1.8 us; the product manual names no figure. After:
// the PIC in the sensor needs none that is known; a bit's time is for long wires.
#define SELECT_SETUP_NS 1800
#define SELECT_HOLD_NS  230

// On a W, GPIO 23 is the radio's power switch, and the radio sets the regulator's mode (Pico W data sheet,
// 2.1): it stays off, and the sensors' supply ripples more under light load.
#ifndef BIOTAC_PICO_W
// Divided down to 3.3 V on the Pico's board: high while a host supplies power.
#define PIN_VBUS_SENSE 24
// The Pico's regulator, not on a board pin: high disables the power-save mode, which ripples more.
#define PIN_SMPS_PWM   23
// The LED on it; the Pico W's is the radio's.
#define PIN_LED        25
// A third of VSYS, at the ADC; on a Pico W it is the radio's clock, too.
#define PIN_SUPPLY     29
#endif

#endif
