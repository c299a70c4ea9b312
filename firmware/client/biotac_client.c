#define BT_CLIENT_LAYOUT
#include "biotac_client.h"

#define CRC_BYTES 4

// COBS then adds exactly one byte.
typedef char a_frame_fits_one_cobs_block[BT_FRAME_MAX_BYTES <= 254 ? 1 : -1];

// Half a byte at a time: 64 bytes of table in place of 1024.
uint32_t bt_client_crc(const uint8_t *data, size_t bytes)
{
    static const uint32_t nibble_crc[16] = {
        0x00000000, 0x1DB71064, 0x3B6E20C8, 0x26D930AC, 0x76DC4190, 0x6B6B51F4, 0x4DB26158, 0x5005713C,
        0xEDB88320, 0xF00F9344, 0xD6D6A3E8, 0xCB61B38C, 0x9B64C2B0, 0x86D3D2D4, 0xA00AE278, 0xBDBDF21C,
    };
    uint32_t crc = 0xFFFFFFFF;
    for (size_t k = 0; k < bytes; k++) {
        crc ^= data[k];
        crc = crc >> 4 ^ nibble_crc[crc & 15];
        crc = crc >> 4 ^ nibble_crc[crc & 15];
    }
    return ~crc;
}

int bt_client_uncobs(uint8_t *data, size_t bytes)
{
    size_t from = 0;
    size_t to = 0;
    while (from < bytes) {
        uint8_t code = data[from++];
        if (code == 0 || (size_t)code - 1 > bytes - from) {
            return -1;
        }
        for (uint8_t n = 1; n < code; n++) {
            if (data[from] == 0) {
                return -1;
            }
            data[to++] = data[from++];
        }
        if (code != 0xFF && from < bytes) {
            data[to++] = 0;
        }
    }
    return (int)to;
}

// Returns the runs of a known message, else NULL.
static const uint8_t *find_layout(uint8_t id)
{
    const uint8_t *at = bt_client_layout;
    while (at[0] != id || at[1] == 0) {
        if (at[1] == 0) {
            return NULL;
        }
        at += 2 + at[1];
    }
    return at + 1;
}

// Copies between a struct and the wire's bytes, which are little-endian on any machine. Returns the payload's
// length; with a NULL it only measures that.
static size_t copy(const uint8_t *layout, uint8_t *to, const uint8_t *from, int to_wire)
{
    const uint16_t probe = 1;
    const size_t big_endian = *(const uint8_t *)&probe == 0;
    size_t in_struct = 0;
    size_t on_wire = 0;
    for (uint8_t runs = *layout++; runs > 0; runs--, layout++) {
        size_t size = (size_t)1 << (*layout >> 6);
        in_struct = (in_struct + size - 1) & ~(size - 1);
        for (unsigned count = *layout & 0x3F; count > 0; count--, in_struct += size, on_wire += size) {
            for (size_t k = 0; to != NULL && k < size; k++) {
                size_t at = in_struct + (big_endian ? size - 1 - k : k);
                if (to_wire) {
                    to[on_wire + k] = from[at];
                } else {
                    to[at] = from[on_wire + k];
                }
            }
        }
    }
    return on_wire;
}

static int refuse(bt_client *client, int why)
{
    client->refused[-why - 1]++;
    return why;
}

int bt_client_push(bt_client *client, uint8_t byte)
{
    if (byte != 0) {
        if (client->filled < sizeof client->buffer) {
            client->buffer[client->filled] = byte;
        }
        if (client->filled <= sizeof client->buffer) {
            client->filled++;
        }
        return 0;
    }
    size_t bytes = client->filled;
    client->filled = 0;
    client->id = 0;
    if (bytes == 0) {
        return 0;
    }
    if (bytes > sizeof client->buffer) {
        return refuse(client, BT_REFUSED_TOO_LONG);
    }
    int plain = bt_client_uncobs(client->buffer, bytes);
    if (plain < 0) {
        return refuse(client, BT_REFUSED_COBS);
    }
    if (plain < 1 + CRC_BYTES) {
        return refuse(client, BT_REFUSED_CRC);
    }
    size_t covered = (size_t)plain - CRC_BYTES;
    uint32_t crc = bt_client_crc(client->buffer, covered);
    for (unsigned k = 0; k < CRC_BYTES; k++) {
        if (client->buffer[covered + k] != (uint8_t)(crc >> 8 * k)) {
            return refuse(client, BT_REFUSED_CRC);
        }
    }
    const uint8_t *layout = find_layout(client->buffer[0]);
    if (layout != NULL) {
        size_t known = copy(layout, NULL, NULL, 0);
        if (covered - 1 != known && !(covered - 1 > known && client->accept_longer)) {
            return refuse(client, BT_REFUSED_LENGTH);
        }
    }
    client->id = client->buffer[0];
    client->payload_bytes = (uint8_t)(covered - 1);
    return client->id;
}

int bt_client_read(const bt_client *client, uint8_t id, void *msg)
{
    const uint8_t *layout = find_layout(id);
    if (layout == NULL || client->id != id) {
        return 0;
    }
    copy(layout, (uint8_t *)msg, client->buffer + 1, 0);
    return 1;
}

size_t bt_client_seal(uint8_t id, size_t payload_bytes, uint8_t *out)
{
    size_t end = 2 + payload_bytes;
    out[1] = id;
    uint32_t crc = bt_client_crc(out + 1, end - 1);
    for (unsigned k = 0; k < CRC_BYTES; k++) {
        out[end++] = (uint8_t)(crc >> 8 * k);
    }
    size_t next = end;
    for (size_t at = end - 1; at > 0; at--) { // from the end: each zero becomes the distance to the next
        if (out[at] == 0) {
            out[at] = (uint8_t)(next - at);
            next = at;
        }
    }
    out[0] = (uint8_t)next;
    out[end] = 0;
    return end + 1;
}

size_t bt_client_write(uint8_t id, const void *msg, uint8_t out[BT_ENCODED_MAX_BYTES])
{
    const uint8_t *layout = find_layout(id);
    return layout == NULL ? 0 : bt_client_seal(id, copy(layout, out + 2, (const uint8_t *)msg, 1), out);
}
