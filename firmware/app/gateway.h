// The whole device: sampler, fingers and session, wired together. main.c runs it.
#ifndef BIOTAC_GATEWAY_H
#define BIOTAC_GATEWAY_H

#include "sampler.h"
#include "talk/session.h"

typedef struct {
    bt_sampler sampler;
    bt_session session;
    bt_map_flash map_flash;
    _Alignas(4) uint8_t map_ram[BT_MAX_FINGERS][BT_MAP_MAX_BYTES]; // what is in force
    uint32_t round;                                                // that the fingers are assembling
    bool round_open;
    bool link_was_up;
} bt_gateway;

// Wait for the sensors to power up, read who they are, start sampling.
void bt_gateway_init(bt_gateway *gateway);

// Main loop: host bytes, finished slots, periodic work.
void bt_gateway_poll(bt_gateway *gateway);

// Interrupt: the sampler's alarm. True when a slot is over: there is something to poll for.
bool bt_gateway_alarm(bt_gateway *gateway);

#endif
