// A gateway in this process: firmware/app over one kind of port or another. port.h's functions are in
// in_process.c, which hands them to the kind; several boards of both kinds may live at once.
#ifndef BIOTAC_IN_PROCESS_H
#define BIOTAC_IN_PROCESS_H

#include "gateway.h"
#include "port.h"

// The functions of a kind of port, as port.h describes them. None may be NULL.
typedef struct {
    uint32_t (*now_us)(bt_port *port);
    void (*delay_us)(bt_port *port, uint32_t us);
    void (*select)(bt_port *port, uint8_t mask);
    uint16_t (*transfer16)(bt_port *port, uint16_t mosi);
    uint8_t (*transfer8)(bt_port *port, uint8_t mosi);
    bool (*write)(bt_port *port, const uint8_t *data, size_t bytes); // the only link, number 0
    size_t (*read)(bt_port *port, uint8_t *data, size_t bytes);
    uint32_t (*turns)(bt_port *port);
    bool (*erase)(bt_port *port, uint32_t sector_offset);
    bool (*program)(bt_port *port, uint32_t page_offset, const uint8_t *page);
    void (*read_flash)(bt_port *port, uint32_t offset, uint8_t *data, size_t bytes);
    bool (*reboot)(bt_port *port);
    port_identity (*identify)(bt_port *port);
    port_abilities (*describe)(bt_port *port);
} bt_port_kind;

// The first member of each kind's board.
struct bt_port {
    const bt_port_kind *kind;
    uint32_t alarm_us;
    bt_gateway gateway;
};

#endif
