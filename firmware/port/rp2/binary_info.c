// Data for `picotool info -a`: name, version, board and pins, in the layout that Raspberry Pi documents for
// programs of any origin (pico-sdk, pico_binary_info: structure.h). A header of five words, between two
// markers, lies within 256 bytes behind an RP2040's boot2, or in an RP2350's first 1024; it points to a list
// of pointers to records. picotool reads flash: the linker script puts these sections there, and the program
// never reads them.
#include "pins.h"
#include "version.h"
#include "wire/messages_gen.h"

#include <stdint.h>

#define MARKER_START 0x7188EBF2u
#define MARKER_END   0xE71AA390u

enum { ID_AND_STRING = 6, PINS_WITH_NAME = 9 };          // types of records
#define TAG_RP              ((uint16_t)('P' << 8 | 'R')) // Raspberry Pi: the ids below
#define PROGRAM_NAME        0x02031C86u
#define PROGRAM_VERSION     0x11A9BC3Au
#define PROGRAM_DESCRIPTION 0xB6A07C19u
#define PICO_BOARD          0xB63CFFBBu

typedef struct {
    uint16_t type;
    uint16_t tag;
    uint32_t id; // or a mask of pins
    const char *text;
} record;
_Static_assert(sizeof(record) == 12 || sizeof(void *) != 4, "picotool reads it byte by byte");

#define KEPT                __attribute__((section(".binary_info"), used))
#define DIGITS(x)           #x
#define NUMBER(x)           DIGITS(x)
#define STRING(name, words) KEPT static const char name[] = words
#define PIN(n)              (1u << (n))

STRING(name, IMAGE_NAME);
STRING(version, NUMBER(BT_VERSION_MAJOR) "." NUMBER(BT_VERSION_MINOR) "." NUMBER(
                    BT_VERSION_PATCH) ", wire " NUMBER(BT_WIRE_MAJOR) "." NUMBER(BT_WIRE_MINOR));
STRING(description, IMAGE_PURPOSE);
STRING(board, PINS_BOARD);
STRING(miso, "SPI MISO");
STRING(sck, "SPI SCK");
STRING(mosi, "SPI MOSI");
STRING(select_0, "chip select of finger 0");
STRING(select_1, "chip select of finger 1");
STRING(select_2, "chip select of finger 2");
STRING(select_3, "chip select of finger 3");
STRING(select_4, "chip select of finger 4");

KEPT static const record records[] = {
    {ID_AND_STRING, TAG_RP, PROGRAM_NAME, name},
    {ID_AND_STRING, TAG_RP, PROGRAM_VERSION, version},
    {ID_AND_STRING, TAG_RP, PROGRAM_DESCRIPTION, description},
    {ID_AND_STRING, TAG_RP, PICO_BOARD, board},
    {PINS_WITH_NAME, TAG_RP, PIN(PIN_MISO), miso},
    {PINS_WITH_NAME, TAG_RP, PIN(PIN_SCK), sck},
    {PINS_WITH_NAME, TAG_RP, PIN(PIN_MOSI), mosi},
    {PINS_WITH_NAME, TAG_RP, PIN(PIN_SELECT_0), select_0},
    {PINS_WITH_NAME, TAG_RP, PIN(PIN_SELECT_1), select_1},
    {PINS_WITH_NAME, TAG_RP, PIN(PIN_SELECT_2), select_2},
    {PINS_WITH_NAME, TAG_RP, PIN(PIN_SELECT_3), select_3},
    {PINS_WITH_NAME, TAG_RP, PIN(PIN_SELECT_4), select_4},
};

KEPT static const record *const list[] = {
    &records[0], &records[1], &records[2], &records[3], &records[4],  &records[5],
    &records[6], &records[7], &records[8], &records[9], &records[10], &records[11],
};
_Static_assert(sizeof list / sizeof *list == sizeof records / sizeof *records, "every record is listed");

// Parts of flash that the program has at another address: none of the above.
KEPT static const uint32_t no_copies[1] = {0};

typedef struct {
    uint32_t start;
    const record *const *first;
    const record *const *end;
    const uint32_t *copies;
    uint32_t stop;
} header;

__attribute__((section(".binary_info_header"), used)) static const header info = {
    MARKER_START, list, list + sizeof list / sizeof *list, no_copies, MARKER_END};
