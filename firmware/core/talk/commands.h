// The commands. Every command is answered exactly once: by a special message, or by REPLY.
#ifndef BIOTAC_COMMANDS_H
#define BIOTAC_COMMANDS_H

#include "talk/session.h"

// Handle one good packet from the host; payload is NULL if the length does not match the id.
void bt_command(bt_session *session, uint8_t id, const uint8_t *payload, uint32_t now_us);

#endif
