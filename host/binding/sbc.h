// The board that is a Linux computer: the gateway app over a port whose bus, clock and link are Python's.
//
// The same sampler, session and framing as on every board. Python's spidev has whole chip-select periods
// only, one sensor at a time; sbc.c describes the differences from a microcontroller's bus.
#ifndef BIOTAC_SBC_H
#define BIOTAC_SBC_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct bt_sbc bt_sbc;

// devices: how many sensors are wired, fingers 0 to devices - 1; none: a board without a bus, for whole
// rounds. timed: with the times of the slots. python: handed to every function below. NULL without memory.
// Several may live at once, each on a separate thread.
bt_sbc *bt_sbc_new(void *python, uint8_t devices, bool timed, uint32_t boot_id);
void bt_sbc_free(bt_sbc *sbc);

// main.c, taken apart, since Python has the loop: start once, then poll, and alarm whenever bt_sbc_due_us()
// has come.
void bt_sbc_start(bt_sbc *sbc);
void bt_sbc_poll(bt_sbc *sbc);
void bt_sbc_alarm(bt_sbc *sbc);
uint32_t bt_sbc_due_us(const bt_sbc *sbc);

// Of a board without a bus: finger f's sensor (zeros: unknown), and whether it is no BioTac with 19
// electrodes. Again when that changes.
void bt_sbc_sensor(bt_sbc *sbc, uint8_t f, const uint8_t serial[16], bool foreign);

// A round of counts [44][5] by slot and finger, BT_INVALID_COUNT where there is none; slot_us: after t_us. Of
// the fingers in sp_fingers, a bit mask, the counts [5][24] of a BioTac SP are sent too.
void bt_sbc_round(bt_sbc *sbc, uint32_t t_us, const uint32_t *slot_us, const uint16_t *counts,
                  uint8_t sp_fingers, const uint16_t *sp_counts);

// Python's part of port.h. exchange: one chip-select period of one sensor; MISO's bits replace bytes.
#ifdef BT_CDEF
extern "Python+C" uint32_t bt_sbc_now_us(void *python);
extern "Python+C" void bt_sbc_delay_us(void *python, uint32_t us);
extern "Python+C" void bt_sbc_exchange(void *python, uint8_t finger, uint8_t *bytes, size_t n);
extern "Python+C" bool bt_sbc_link_write(void *python, const uint8_t *data, size_t bytes);
extern "Python+C" size_t bt_sbc_link_read(void *python, uint8_t *data, size_t bytes);
#else
uint32_t bt_sbc_now_us(void *python);
void bt_sbc_delay_us(void *python, uint32_t us);
void bt_sbc_exchange(void *python, uint8_t finger, uint8_t *bytes, size_t n);
bool bt_sbc_link_write(void *python, const uint8_t *data, size_t bytes);
size_t bt_sbc_link_read(void *python, uint8_t *data, size_t bytes);
#endif

#endif
