// From power-on to the first slot: the port's calls for the core, and the gateway's start.
#include "gateway.h"

#include "port.h"
#include "properties.h"
#include "talk/saved.h"
#include "talk/sensors.h"

#include "version.h"

_Static_assert(sizeof(bt_kept_tares) <= PORT_KEPT_BYTES, "there is room for what outlives a hang");

// The gap after the last property read, plus the time of a slow board from here to setting its alarm. An
// alarm in the past would make the first slot and its frame's time late.
#define START_AHEAD_US (BT_GAP_US + 50)

// Calls that the core makes: the context is the gateway, and for the flash the port.

static bool erase_sector(void *port, uint32_t sector_offset)
{
    return port_flash_erase(port, sector_offset);
}

static bool program_page(void *port, uint32_t page_offset, const uint8_t page[BT_FLASH_PAGE_BYTES])
{
    return port_flash_program(port, page_offset, page);
}

static void read_flash(void *port, uint32_t offset, uint8_t *data, size_t bytes)
{
    port_flash_read(port, offset, data, bytes);
}

static bool write_link(void *context, unsigned link, const uint8_t *data, size_t bytes)
{
    const bt_gateway *gateway = context;
    return port_link_write(gateway->port, link, data, bytes);
}

static uint32_t now_us(void *context)
{
    const bt_gateway *gateway = context;
    return port_now_us(gateway->port);
}

static uint8_t reboot_board(void *context, bool into_bootloader)
{
    const bt_gateway *gateway = context;
    return port_reboot(gateway->port, into_bootloader) ? BT_ERROR_OK : BT_ERROR_NOT_HERE;
}

static void measure(void *context, bt_msg_board_facts *msg)
{
    const bt_gateway *gateway = context;
    msg->usb_frame = UINT16_MAX;
    msg->die_centi_c = BT_INVALID_I16;
    msg->bus_khz = BT_SPI_HZ / 1000;
    msg->slots_dma_late = gateway->sampler.dma_late;
    port_measure(gateway->port, msg);
}

static void clock_bus(void *context, uint16_t khz)
{
    const bt_gateway *gateway = context;
    port_spi_rate(gateway->port, khz);
}

void bt_gateway_init(bt_gateway *gateway, bt_port *port)
{
    const port_abilities can = port_describe(port);
    const bt_board_actions actions = {
        .reboot = reboot_board,
        .measure = measure,
        .set_bus_rate = clock_bus,
        .flash = &gateway->flash,
        .maps = can.map_bytes != 0 ? &gateway->map_flash : NULL,
        .now_us = can.no_bus ? NULL : now_us,
    };
    gateway->port = port;
    gateway->flash = (bt_flash){.sector_bytes = can.erase_bytes,
                                .context = port,
                                .erase = erase_sector,
                                .program = program_page,
                                .read = read_flash};
    gateway->map_flash = (bt_map_flash){
        .flash = &gateway->flash,
        .slot_bytes = (can.map_bytes + can.erase_bytes - 1) / can.erase_bytes * can.erase_bytes,
        .max_bytes = can.map_bytes,
        .slots = (uint8_t)BT_MAP_SLOTS_OF(can.fingers),
        .bytes = can.maps,
        .ram = can.map_ram,
    };
    const port_identity board = port_identify(port);
    bt_msg_hello hello = board.hello;
    hello.firmware_major = BT_VERSION_MAJOR;
    hello.firmware_minor = BT_VERSION_MINOR;
    hello.firmware_patch = BT_VERSION_PATCH;
    hello.fingers = can.fingers;
    hello.slot_hz = can.untimed ? 0 : BT_SLOT_HZ;
    const bool resumed =
        board.kept != NULL && board.started_by & (BT_FAULT_FLAG_HUNG | BT_FAULT_FLAG_CRASHED);
    gateway->kept = board.kept;
    const uint32_t powered_us = port_now_us(port);
    if (!resumed && powered_us < BT_POWER_ON_MS * 1000) { // after a resume, the sensors had power all along
        port_delay_us(port, BT_POWER_ON_MS * 1000 - powered_us);
    }
    bt_session_init(&gateway->session, &hello, write_link, gateway, port_now_us(port));
    gateway->session.board = actions;
    gateway->session.status.faults |= board.started_by;
    for (uint8_t f = 0; f < can.fingers && !can.no_bus; f++) {
        bt_properties_read(port, f, &gateway->sampler.query[f], &gateway->session.info[f]);
        gateway->session.finger[f].foreign = bt_serial_is_foreign(gateway->session.info[f].serial);
        gateway->session.finger[f].present = gateway->session.info[f].present;
        if (!gateway->session.info[f].present) {
            bt_sensors_doubt(&gateway->session, f);
        }
    }
    bt_session_load(&gateway->session); // a calibration needs to know the sensors
    if (resumed && bt_kept_tares_restore(gateway->kept, &gateway->session)) {
        gateway->session.status.faults |= BT_FAULT_FLAG_TARE_RESTORED;
    }
    bt_uart_start(&gateway->uart, port, &gateway->session.settings);
    gateway->round_open = false;
    for (unsigned link = 0; link < PORT_LINKS; link++) {
        gateway->link_turns[link] = port_link_turns(port, link);
    }
    if (can.no_bus) {
        return;
    }
    // Absent sensors are read too: one plugged in later shows up by itself.
    uint32_t start_us = port_now_us(port) + START_AHEAD_US;
    bt_sampler_start(&gateway->sampler, port, (uint8_t)((1u << can.fingers) - 1), start_us,
                     bt_settings_get(&gateway->session.settings, BT_SETTING_SLOTS_BY_CORE) != 0);
    port_alarm_at(port, start_us);
}
