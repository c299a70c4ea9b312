// Measurements of the chip and the board, for bring-up.
#include "only_board.h"

#include "pins.h"
#include "system.h"
#include "wait.h"

#include <string.h>

#define READS 16 // averaged; their sum is 16 bits of 3.3 V

static uint32_t adc_sum(uint32_t input)
{
    uint32_t sum = 0;
    for (int k = 0; k < READS; k++) {
        ADC_CS = ADC_EN | ADC_DIE_ON | ADC_START_ONCE | input;
        (void)wait_for(&ADC_CS, ADC_READY, ADC_READY, WAIT_SPI_TURNS); // 2 us
        sum += ADC_RESULT;
    }
    return sum;
}

void port_measure(bt_port *port, bt_msg_board_facts *facts)
{
    CLK_ADC_CTRL = CLK_ENABLE; // from PLL_USB
    if (reset_blocks(RESETS_ADC)) {
        // 27 degrees at 706 mV, -1.721 mV a degree (4.9.5); in 0.1 mV.
        (void)adc_sum(ADC_INPUT_DIE); // while the sensor comes up
        int32_t above = (int32_t)(adc_sum(ADC_INPUT_DIE) * 33000u >> 16) - 7060;
        facts->die_centi_c = (int16_t)(2700 - above * 581 / 100);
#ifdef PIN_SUPPLY
        PADS_BANK0_GPIO(PIN_SUPPLY) = PADS_OD; // and no pull, which would load the divider
        facts->supply_mv = (uint16_t)(adc_sum(ADC_INPUT_OF(PIN_SUPPLY)) * 9900u >> 16);
#endif
    }
    facts->chip_id = SYSINFO_CHIP_ID;
    memcpy(facts->flash_id, flash_jedec_id, sizeof facts->flash_id);
    facts->erase_us = flash_erase_us;
    facts->bus_khz = (uint16_t)spi_khz();
    facts->early_faults = early_faults;
    facts->t_us = port_now_us(port);
    facts->usb_frame = (uint16_t)USB_SOF_RD;
    facts->usb_starts = usb_starts;
}
