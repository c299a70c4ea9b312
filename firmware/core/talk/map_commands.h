// The commands for wrench maps.
#ifndef BIOTAC_MAP_COMMANDS_H
#define BIOTAC_MAP_COMMANDS_H

#include "talk/session.h"

// Rows of the table in commands.c, which lists the checks made before.
uint8_t bt_map_get(bt_session *session, const uint8_t *payload);
uint8_t bt_map_read(bt_session *session, const uint8_t *payload);
uint8_t bt_map_begin(bt_session *session, const uint8_t *payload);
uint8_t bt_map_write(bt_session *session, const uint8_t *payload);
uint8_t bt_map_end(bt_session *session, const uint8_t *payload);
uint8_t bt_map_clear(bt_session *session, const uint8_t *payload);

#endif
