// The commands. Every command is answered exactly once: by a message of its own, or by REPLY.
#ifndef BIOTAC_COMMANDS_H
#define BIOTAC_COMMANDS_H

#include "talk/session.h"

// Handle one good packet from the host; payload is NULL if its length does not match its id.
void bt_command(bt_session *session, uint8_t id, const uint8_t *payload, uint32_t now_us);

#endif
