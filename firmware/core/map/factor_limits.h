// Limits of a map's factors, by which bt_map_open bounds the sums; wrench_map.c asserts them.
#ifndef BIOTAC_FACTOR_LIMITS_H
#define BIOTAC_FACTOR_LIMITS_H

#include "map/conductance.h"

#define BT_MAP_SIGNAL_MAX   (BT_FULL_SCALE_COUNT << BT_MAP_SIGNAL_Q)
#define BT_MAP_PRESSURE_MAX (BT_FULL_SCALE_COUNT << BT_MAP_PRESSURE_Q)

// In the order of enum bt_map_kind.
#define BT_MAP_FACTOR_MAX                                                                                    \
    {1 << BT_MAP_ONE_Q, BT_MAP_SIGNAL_MAX,  BT_MAP_SIGNAL_MAX,  BT_MAP_SIGNAL_MAX,                           \
     BT_MAP_SIGNAL_MAX, BT_CONDUCTANCE_MAX, BT_CONDUCTANCE_MAX, BT_MAP_PRESSURE_MAX}

#endif
