// The UART's rate. One that was saved by mistake, on a board without another link, must not lock the host
// out: until a frame decodes, the saved rate and the port's default alternate.
#ifndef BIOTAC_UART_H
#define BIOTAC_UART_H

#include "port.h"
#include "talk/session.h"

typedef struct {
    uint32_t doubtful_bytes; // received before a good frame at this rate
    bool by_default;         // the rate is the port's, not the saved one
} bt_uart;

// At the rate that holds now.
void bt_uart_start(const bt_uart *uart, bt_port *port, const bt_settings *settings);

// Bytes of any link came from a host, and the session has taken them.
void bt_uart_received(bt_uart *uart, bt_port *port, const bt_session *session, size_t bytes);

#endif
