#include "properties.h"

#include "port.h"
#include "wire/sensor_gen.h"

#include <string.h>

// Property bytes carry no parity; 0x00 and 0xFF end a text (CLIB).
static void read_property(uint8_t finger, uint8_t selector, uint8_t *out, int bytes)
{
    port_spi_select((uint8_t)(1u << finger));
    (void)port_spi_transfer16((uint16_t)(BT_PROPERTY_READ_COMMAND << 8 | selector));
    port_spi_select(0);
    port_delay_us(BT_SETTLE_US + 1);
    port_spi_select((uint8_t)(1u << finger));
    for (int k = 0; k < bytes; k += 2) {
        uint16_t word = port_spi_transfer16(BT_LISTEN_WORD);
        out[k] = (uint8_t)(word >> 8);
        out[k + 1] = (uint8_t)word;
    }
    port_spi_select(0);
    port_delay_us(BT_GAP_US);
}

static void read_text(uint8_t finger, uint8_t selector, uint8_t *out, int bytes)
{
    read_property(finger, selector, out, bytes);
    int end = 0;
    while (end < bytes && out[end] >= 0x20 && out[end] < 0x7F) {
        end++;
    }
    memset(out + end, 0, (size_t)(bytes - end));
}

static uint16_t read_number(uint8_t finger, uint8_t selector)
{
    uint8_t bytes[2];
    read_property(finger, selector, bytes, 2);
    return (uint16_t)(bytes[0] << 8 | bytes[1]);
}

void bt_properties_read(uint8_t finger, bt_msg_sensor_info *info)
{
    memset(info, 0, sizeof *info);
    info->finger = finger;
    // SynTouch's library throws the first read after power-up away; so do we.
    read_text(finger, BT_PROPERTY_SOFTWARE_VERSION, info->software_version, sizeof info->software_version);
    read_text(finger, BT_PROPERTY_SERIAL, info->serial, sizeof info->serial);
    info->present = info->serial[0] == 'B' && info->serial[1] == 'T';
    if (!info->present) {
        memset(info, 0, sizeof *info);
        info->finger = finger;
        return;
    }
    read_text(finger, BT_PROPERTY_SOFTWARE_VERSION, info->software_version, sizeof info->software_version);
    read_text(finger, BT_PROPERTY_FLEX_VERSION, info->flex_version, sizeof info->flex_version);
    info->cpu_khz = read_number(finger, BT_PROPERTY_CPU_SPEED);
    info->sampling_hz = read_number(finger, BT_PROPERTY_SAMPLING_HZ);
}
