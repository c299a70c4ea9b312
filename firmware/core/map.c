#include "map.h"

#include "little_endian.h"
#include "wire_gen.h"

#define VERSION      1
#define SERIAL_AT    4
#define MADE_AT      20
#define HEADER_BYTES 24

uint8_t bt_map_open(bt_map *map, const uint8_t *blob, size_t bytes)
{
    if (bytes < HEADER_BYTES || blob[0] != VERSION || blob[3] != 0) {
        return BT_ERROR_OUT_OF_RANGE;
    }
    map->serial = blob + SERIAL_AT;
    map->made_s = bt_get_u32(blob + MADE_AT);
    return BT_ERROR_OK;
}
