#include "in_process.h"

#include "only_board.h"
#include "spi_word_by_word.h"

uint32_t port_now_us(bt_port *port)
{
    return port->kind->now_us(port);
}

void port_delay_us(bt_port *port, uint32_t us)
{
    port->kind->delay_us(port, us);
}

void port_alarm_at(bt_port *port, uint32_t at_us)
{
    port->alarm_us = at_us;
}

void port_spi_select(bt_port *port, uint8_t mask)
{
    port->kind->select(port, mask);
}

uint16_t port_spi_transfer16(bt_port *port, uint16_t mosi)
{
    return port->kind->transfer16(port, mosi);
}

uint8_t port_spi_transfer8(bt_port *port, uint8_t mosi)
{
    return port->kind->transfer8(port, mosi);
}

bool port_link_write(bt_port *port, unsigned link, const uint8_t *data, size_t bytes)
{
    return link == 0 && port->kind->write(port, data, bytes);
}

size_t port_link_read(bt_port *port, unsigned link, uint8_t *data, size_t bytes)
{
    return link == 0 ? port->kind->read(port, data, bytes) : 0;
}

uint32_t port_link_turns(bt_port *port, unsigned link)
{
    return link == 0 ? port->kind->turns(port) : 0;
}

bool port_flash_erase(bt_port *port, uint32_t sector_offset)
{
    return port->kind->erase(port, sector_offset);
}

bool port_flash_program(bt_port *port, uint32_t page_offset, const uint8_t *page)
{
    return port->kind->program(port, page_offset, page);
}

void port_flash_read(bt_port *port, uint32_t offset, uint8_t *data, size_t bytes)
{
    port->kind->read_flash(port, offset, data, bytes);
}

bool port_reboot(bt_port *port, bool into_bootloader)
{
    return !into_bootloader && port->kind->reboot(port); // a process has no loader
}

port_identity port_identify(bt_port *port)
{
    return port->kind->identify(port);
}

port_abilities port_describe(bt_port *port)
{
    return port->kind->describe(port);
}

// ---- what no board in a process has ------------------------------------------------------------

void port_link_uart(bt_port *port, uint32_t bits_per_s)
{
}

bool port_link_touched(bt_port *port)
{
    return false;
}

void port_measure(bt_port *port, bt_msg_board_facts *facts)
{
}

void port_spi_rate(bt_port *port, uint32_t khz)
{
}
