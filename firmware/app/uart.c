#include "uart.h"

// A slower UART is not used: one FRAME would last longer than a link may wait.
#define LEAST_BITS_PER_S 1200
#define DOUBTFUL_BYTES   64 // more than the first frame of a host

void bt_uart_start(const bt_uart *uart, bt_port *port, const bt_settings *settings)
{
    const int32_t bits_per_s = bt_settings_get(settings, BT_SETTING_UART_BITS_PER_S);
    const bool none = bits_per_s < LEAST_BITS_PER_S || uart->by_default;
    port_link_uart(port, none ? 0 : (uint32_t)bits_per_s);
}

void bt_uart_received(bt_uart *uart, bt_port *port, const bt_session *session, size_t bytes)
{
    uart->doubtful_bytes += (uint32_t)bytes;
    if (session->status.rx_frames == 0 && uart->doubtful_bytes >= DOUBTFUL_BYTES) {
        uart->doubtful_bytes = 0;
        uart->by_default = !uart->by_default;
        bt_uart_start(uart, port, &session->settings);
    }
}
