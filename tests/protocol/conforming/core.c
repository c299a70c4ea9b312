// The firmware's wire for protocol/conformance, or with -DCLIENT the C client's: a request a line in, an
// answer a line out.
#ifdef CLIENT
#define BT_CLIENT_FIELDS
#include "biotac_client.h"
#else
#include "wire/cobs.h"
#include "wire/crc32.h"
#include "wire/framing.h"
#include "wire/messages_gen.h"
#endif

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LINE_BYTES (1 << 16)

// The type names in the BT_*_FIELDS lists.
typedef uint8_t u8;
typedef uint16_t u16;
typedef uint32_t u32;
typedef int16_t i16;
typedef int32_t i32;

static size_t from_hex(const char *text, uint8_t *out)
{
    size_t bytes = text[0] == '-' ? 0 : strlen(text) / 2;
    for (size_t k = 0; k < bytes; k++) {
        char two[3] = {text[2 * k], text[2 * k + 1], 0};
        out[k] = (uint8_t)strtoul(two, NULL, 16);
    }
    return bytes;
}

static void put_hex(const uint8_t *data, size_t bytes)
{
    for (size_t k = 0; k < bytes; k++) {
        printf("%02x", data[k]);
    }
    if (bytes == 0) {
        putchar('-');
    }
}

#ifdef CLIENT
#define bt_crc32 bt_client_crc

static int bt_cobs_decode(uint8_t *in, size_t bytes, uint8_t *out)
{
    int plain = bt_client_uncobs(in, bytes);
    memcpy(out, in, plain < 0 ? 0 : (size_t)plain);
    return plain;
}

static size_t bt_frame_encode(uint8_t id, const uint8_t *payload, size_t bytes, uint8_t *out)
{
    memcpy(out + 2, payload, bytes);
    return bt_client_seal(id, bytes, out);
}

static void unframe(const uint8_t *wire, size_t bytes)
{
    bt_client client = {0};
    for (size_t k = 0; k < bytes; k++) {
        int id = bt_client_push(&client, wire[k]);
        if (id > 0) {
            printf("frame %02x ", (unsigned)id);
            put_hex(client.buffer + 1, client.payload_bytes);
            printf("; ");
        }
    }
    printf("counts");
    for (int k = 0; k < 4; k++) {
        printf(" %lu", (unsigned long)client.refused[k]);
    }
}

// Through a frame, as any user has to.
#define UNPACK(MESSAGE, struct_name)                                                                         \
    bt_client client = {0};                                                                                  \
    uint8_t frame[BT_ENCODED_MAX_BYTES];                                                                     \
    size_t sealed = bt_frame_encode(BT_##MESSAGE##_ID, payload, sizeof payload, frame);                      \
    for (size_t k = 0; k < sealed; k++) {                                                                    \
        bt_client_push(&client, frame[k]);                                                                   \
    }                                                                                                        \
    if (!bt_client_read(&client, BT_##MESSAGE##_ID, &msg)) {                                                 \
        abort();                                                                                             \
    }
#define PACK(MESSAGE, struct_name)                                                                           \
    uint8_t frame[BT_ENCODED_MAX_BYTES];                                                                     \
    size_t sealed = bt_client_write(BT_##MESSAGE##_ID, &msg, frame);                                         \
    if (bt_client_uncobs(frame, sealed - 1) != 1 + (int)sizeof payload + 4) {                                \
        abort();                                                                                             \
    }                                                                                                        \
    memcpy(payload, frame + 1, sizeof payload);
#else
static void unframe(const uint8_t *wire, size_t bytes)
{
    unsigned outcomes[6] = {0};
    bt_deframer deframer;
    bt_deframer_reset(&deframer);
    for (size_t k = 0; k < bytes; k++) {
        enum bt_deframed outcome = bt_deframer_push(&deframer, wire[k]);
        outcomes[outcome]++;
        if (outcome == BT_DEFRAMED_GOOD) {
            printf("frame %02x ", deframer.id);
            put_hex(deframer.buffer + 1, deframer.payload_bytes);
            printf("; ");
        }
    }
    printf("counts %u %u %u %u", outcomes[BT_DEFRAMED_TOO_LONG], outcomes[BT_DEFRAMED_BAD_COBS],
           outcomes[BT_DEFRAMED_BAD_CRC], outcomes[BT_DEFRAMED_BAD_LENGTH]);
}

#define UNPACK(MESSAGE, struct_name) struct_name##_unpack(&msg, payload);
#define PACK(MESSAGE, struct_name)   struct_name##_pack(&msg, payload);
#endif

#define PUT_FIELD(name, type, count)                                                                         \
    printf("%s%s", separator, #name);                                                                        \
    separator = "; ";                                                                                        \
    for (int k = 0; k < (count); k++) {                                                                      \
        printf(" %lld", (long long)((const type *)(const void *)&msg.name)[k]);                              \
    }
#define TAKE_FIELD(name, type, count)                                                                        \
    strtok(NULL, " ;");                                                                                      \
    for (int k = 0; k < (count); k++) {                                                                      \
        ((type *)(void *)&msg.name)[k] = (type)strtoll(strtok(NULL, " ;"), NULL, 10);                        \
    }
#define ONE_MESSAGE(MESSAGE, struct_name)                                                                    \
    if (id == BT_##MESSAGE##_ID) {                                                                           \
        struct_name msg;                                                                                     \
        uint8_t payload[BT_##MESSAGE##_BYTES];                                                               \
        if (unpack) {                                                                                        \
            from_hex(strtok(NULL, " "), payload);                                                            \
            UNPACK(MESSAGE, struct_name)                                                                     \
            BT_##MESSAGE##_FIELDS(PUT_FIELD)                                                                 \
        } else {                                                                                             \
            BT_##MESSAGE##_FIELDS(TAKE_FIELD) PACK(MESSAGE, struct_name) put_hex(payload, sizeof payload);   \
        }                                                                                                    \
    }

static void message(int unpack)
{
    const char *separator = "";
    unsigned long id = strtoul(strtok(NULL, " "), NULL, 16);
    BT_WIRE_MESSAGES(ONE_MESSAGE)
}

int main(void)
{
    static char line[LINE_BYTES];
    static uint8_t data[LINE_BYTES], out[LINE_BYTES];
    while (fgets(line, sizeof line, stdin)) {
        line[strcspn(line, "\n")] = 0;
        const char *word = strtok(line, " ");
        if (strcmp(word, "crc") == 0) {
            size_t bytes = from_hex(strtok(NULL, " "), data);
            printf("%08lx", (unsigned long)bt_crc32(data, bytes));
        } else if (strcmp(word, "uncobs") == 0) {
            int bytes = bt_cobs_decode(data, from_hex(strtok(NULL, " "), data), out);
            if (bytes < 0) {
                printf("bad");
            } else {
                put_hex(out, (size_t)bytes);
            }
        } else if (strcmp(word, "frame") == 0) {
            uint8_t id = (uint8_t)strtoul(strtok(NULL, " "), NULL, 16);
            size_t bytes = from_hex(strtok(NULL, " "), data);
            put_hex(out, bt_frame_encode(id, data, bytes, out));
        } else if (strcmp(word, "unframe") == 0) {
            strtok(NULL, " "); // it takes one byte at a time, whatever the chunks
            unframe(data, from_hex(strtok(NULL, " "), data));
        } else if (strcmp(word, "unpack") == 0 || strcmp(word, "pack") == 0) {
            message(word[0] == 'u');
        } else {
            printf("no");
        }
        putchar('\n');
    }
    return 0;
}
