// For ports with one board per program: functions ignore the board argument.
#ifndef BIOTAC_ONLY_BOARD_H
#define BIOTAC_ONLY_BOARD_H

#include "port.h"

#define ONLY_BOARD ((bt_port *)NULL)

#pragma GCC diagnostic ignored "-Wunused-parameter"

#endif
