// The commands for wrench maps, and their part of SAVE_SETTINGS.
#ifndef BIOTAC_MAP_COMMANDS_H
#define BIOTAC_MAP_COMMANDS_H

#include "talk/session.h"

// Both return an enum bt_error. *answered: the command has sent a message of its own instead of a REPLY.
uint8_t bt_map_command(bt_session *session, uint8_t id, const uint8_t *payload, bool *answered);
uint8_t bt_save_maps(bt_session *session);

#endif
