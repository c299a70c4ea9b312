// The whole device: sampler, fingers and session, wired together. main.c runs it.
#ifndef BIOTAC_GATEWAY_H
#define BIOTAC_GATEWAY_H

#include "kept_tares.h"
#include "port.h"
#include "sampler.h"
#include "talk/session.h"
#include "uart.h"

typedef struct {
    bt_port *port;
    bt_sampler sampler;
    bt_session session;
    bt_flash flash;
    bt_map_flash map_flash;
    uint32_t round;    // being assembled
    uint32_t dma_late; // the sampler's, as last seen
    uint8_t queried;   // bit mask of the fingers asked for a serial number in that round
    bool round_open;
    atomic_bool in_use;              // at the end of the latest round; for the interrupt
    uint32_t link_turns[PORT_LINKS]; // as of the last poll
    bt_uart uart;
    bt_kept_tares *kept;  // NULL: no memory that outlives a hang
    uint32_t kept_rounds; // since the tares were stored
} bt_gateway;

// Wait for the sensors to power up, identify them, start sampling; without a bus, none of this (start.c).
void bt_gateway_init(bt_gateway *gateway, bt_port *port);

// Main loop: host bytes, finished slots, periodic work.
void bt_gateway_poll(bt_gateway *gateway);

// Interrupt: the sampler's alarm. Returns true when a slot is over, so that there is something to poll for.
bool bt_gateway_alarm(bt_gateway *gateway);

#endif
