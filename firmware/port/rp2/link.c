// The firmware's links: 0 is USB, 1 the UART.
#include "only_board.h"

#include "system.h"

void port_link_uart(bt_port *port, uint32_t bits_per_s)
{
    if (bits_per_s != 0) {
        uart_start(bits_per_s);
    }
}

uint32_t port_link_turns(bt_port *port, unsigned link)
{
    return link == 0 ? usb_turns() : uart_started();
}

bool port_link_write(bt_port *port, unsigned link, const uint8_t *data, size_t bytes)
{
    return link == 0 ? usb_link_write(data, bytes) : uart_started() && uart_write(data, bytes);
}

size_t port_link_read(bt_port *port, unsigned link, uint8_t *data, size_t bytes)
{
    return link == 0 ? usb_link_read(data, bytes) : uart_read(data, bytes);
}
