// The check of maps: a blob of any length with any bytes, up to the first look at coefficients.
#include "map/map.h"

#include <__fc_builtin.h>

/*@ assigns \result \from *map;
    ensures \result == 0 || \result == 1; */
static bool coefficients_bounded(const bt_map *map);

#include "map/open.c"

static uint8_t blob[BT_MAP_MAX_BYTES] __attribute__((aligned(4)));

void main(void)
{
    bt_map map;
    Frama_C_make_unknown((char *)blob, sizeof blob);
    (void)bt_map_open(&map, blob, (size_t)Frama_C_interval(0, INT32_MAX));
}
