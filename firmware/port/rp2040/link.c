// The one link that the firmware knows: USB while a host has its port open, otherwise the UART, where there
// is one.
#include "only_board.h"

#include "system.h"

static bool on_usb;

void port_link_uart(bt_port *port, uint32_t bits_per_s, uint32_t pins)
{
    if (bits_per_s != 0) {
        uart_start(bits_per_s, pins);
    }
}

bool port_link_up(bt_port *port)
{
    bool usb = usb_link_up();
    if (usb != on_usb) {
        on_usb = usb;
        uart_forget_heard(); // nobody listened to what came while USB had the word
        return false;        // and one's stream does not go on at the other
    }
    return usb || uart_started();
}

bool port_link_write(bt_port *port, const uint8_t *data, size_t bytes)
{
    return on_usb || !uart_started() ? usb_link_write(data, bytes) : uart_write(data, bytes);
}

size_t port_link_read(bt_port *port, uint8_t *data, size_t bytes)
{
    return on_usb || !uart_started() ? usb_link_read(data, bytes) : uart_read(data, bytes);
}
