// port.h on a virtual clock, around five emulated sensors: the whole firmware without a board.
// Time passes only as the firmware spends it, or as the test allows.
#ifndef BIOTAC_TEST_FAKE_PORT_H
#define BIOTAC_TEST_FAKE_PORT_H

#include "failing_flash.h"

#include "bus.h"
#include "map/store.h"
#include "only_board.h"
#include "wire/sensor_gen.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// One sample command as it was clocked out.
typedef struct {
    uint64_t t_ns;
    uint16_t mosi;
    uint8_t mask; // chip selects that were low
} sent_command;

typedef struct {
    // Relaxed in the port's own accesses: it must not order data that threads share (test_interrupt.c).
    _Atomic uint64_t now_ns;
    bt_emu_bus bus;
    uint64_t held_off_ns; // the next interrupt comes this much later, once

    // Commands and transfers as the bus saw them.
    void (*on_command)(const sent_command *command); // may be NULL
    uint64_t shortest_gap_ns;                        // between a chip select's rise and the next one's fall
    uint32_t selected_reads;                         // reads with other than one chip select low

    uint32_t link_turns; // odd: open
    bool touched;        // at 1200 baud
    uint32_t bits_per_s; // of the UART; 0: the port's default

    _Alignas(4) uint8_t kept[BT_KEPT_BYTES];
    failing_flash flash; // of the stored records
    bool flash_broken;   // programs nothing
    bool has_loader;
    int reboots; // how often the loader was asked for
} fake_port;

extern fake_port fake;

// The parts that outlive a reset: the memory, and how the board started.
extern uint32_t fake_kept[PORT_KEPT_BYTES / 4];
extern uint16_t fake_started_by;
extern _Alignas(4) uint8_t fake_map_ram[BT_MAX_FINGERS][BT_MAP_MAX_BYTES]; // the maps in force

// Sensors all present, with counts from source and the clock at start_ns.
void fake_reset(bt_emu_source source, uint64_t start_ns);

// Interrupts alone until end_ns: the main loop is busy elsewhere.
void fake_interrupts_until(uint64_t end_ns);

// The next interrupt; false when no alarm is set.
bool fake_next_interrupt(void);

// Bytes that port_link_read will give.
void fake_host_sends(const uint8_t *data, size_t bytes);

// Where port_link_write goes. Set before the firmware runs.
extern bool (*fake_host_accepts)(const uint8_t *data, size_t bytes);

#endif
