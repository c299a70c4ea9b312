// The host as the board sees it: bytes, silence and disconnection. Times are device time in us, wrapping at
// 2^32.
#ifndef BIOTAC_HOST_LINK_H
#define BIOTAC_HOST_LINK_H

#include "talk/session.h"

// Bytes from the host at a port. Every command gets exactly one reply.
void bt_session_receive(bt_session *session, unsigned link, const uint8_t *data, size_t bytes,
                        uint32_t now_us);

// Call often: keep-alive and periodic status.
void bt_session_tick(bt_session *session, uint32_t now_us);

// A port was closed, or opened by another host: the earlier host's streams end.
void bt_session_link_down(bt_session *session, unsigned link);

#endif
