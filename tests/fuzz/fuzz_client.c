// The C client reads any bytes, and a message that it accepts packs back to the same bytes.
#include "biotac_client.h"

#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes)
{
    bt_client client = {0};
    client.accept_longer = bytes > 0 && data[0] & 1;
    uint32_t refused = 0;
    for (size_t k = 0; k < bytes; k++) {
        int id = bt_client_push(&client, data[k]);
        refused += id < 0;
        if (id <= 0) {
            continue;
        }
        uint32_t msg[BT_FRAME_MAX_BYTES / sizeof(uint32_t) + 8];
        if (!bt_client_read(&client, (uint8_t)id, msg)) {
            continue; // an unknown id
        }
        uint8_t again[BT_ENCODED_MAX_BYTES];
        size_t sealed = bt_client_write((uint8_t)id, msg, again);
        int plain = bt_client_uncobs(again, sealed - 1);
        if (plain < 5 || plain - 5 > client.payload_bytes || again[0] != id
            || memcmp(again + 1, client.buffer + 1, (size_t)plain - 5) != 0
            || (!client.accept_longer && plain - 5 != client.payload_bytes)) {
            abort();
        }
    }
    if (refused != client.refused[0] + client.refused[1] + client.refused[2] + client.refused[3]) {
        abort();
    }
    return 0;
}
