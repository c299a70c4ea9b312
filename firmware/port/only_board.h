// For ports of which a program has one board: their functions ignore which one they are asked for.
#ifndef BIOTAC_ONLY_BOARD_H
#define BIOTAC_ONLY_BOARD_H

#include "port.h"

#define ONLY_BOARD ((bt_port *)NULL)

#pragma GCC diagnostic ignored "-Wunused-parameter"

#endif
