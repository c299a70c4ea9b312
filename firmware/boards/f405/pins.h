// The pins of the Adafruit Feather STM32F405 Express. README.md beside this file has the wiring.
#ifndef BIOTAC_F405_PINS_H
#define BIOTAC_F405_PINS_H

#define IMAGE_BOARD      BT_BOARD_STM32F405
#define IMAGE_BOARD_NAME "Feather F405"
#define CRYSTAL_HZ       12000000u

// Ports: 0 is A. SPI2, marked SCK, MI and MO.
#define PORT_SPI     1
#define PIN_SCK      13
#define PIN_MISO     14
#define PIN_MOSI     15
#define SPI_FUNCTION 5

// One chip select a finger, all on one port so that they fall at once: D5, D6, D11, D12, A4.
#define PORT_SELECT 2
#define PIN_SELECTS {7, 6, 3, 2, 4}

// D13, the red LED.
#define PORT_LED 2
#define PIN_LED  1

// See boards/pico/pico_pins.h.
#define SELECT_SETUP_NS 1800
#define SELECT_HOLD_NS  230

// USART3, marked TX and RX, also used by the ROM's loader.
#define PORT_UART     1
#define PIN_UART_TX   10
#define PIN_UART_RX   11
#define UART_FUNCTION 7

// Continue without a crystal: QEMU has neither the crystal nor the registers.
#ifndef CLOCKS_ARE_NOT_MODELLED
#define CLOCKS_ARE_NOT_MODELLED false
#endif

#endif
